# SPDX-License-Identifier: MIT
"""Numbers of a poke script that vary from row to row, written straight into the arrays of the compiled batch.

That is possible where a varied field changes numbers alone: when a poke acts, how long, how hard. Anything else (where it
acts, repeats, held wrenches) is expanded row by row.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..core import batch_flight as bf
from ..poke_script import MAX_TIME_S, ScriptCommand, expand_script
from .study import Study
from .targets import Target
from .templates import Script, Settler, acting_order, script_of

_VECTORS = {"force": bf.FORCE, "impulse": bf.FORCE, "torque": bf.TORQUE, "angular_impulse": bf.TORQUE}
_TIMING = {"repeat", "every", "jitter", "seed"}
_OTHER_KINDS = {"wrench", "string", "set", "service"}


def fits(study: Study) -> bool:
    """Whether all that varies of the script can be laid over it."""
    whole_timing = isinstance(study.script, dict) and bool(_TIMING & set(study.script))
    targets = [v.target for v in study.vary if v.target.entry]
    return all(_fits(target, study.entries[target.entry - 1], whole_timing) for target in targets)


def _fits(target: Target, entry: dict, whole_timing: bool) -> bool:
    key, *component = target.path
    if _OTHER_KINDS & set(entry) or key not in entry:
        return False
    if key == "t":
        return not whole_timing and not _TIMING & set(entry)
    if key in ("push", "duration"):
        return True
    return key in _VECTORS and (not component or isinstance(entry[key], list))


@dataclass(frozen=True)
class Overlay:
    """A script whose numbers vary. base: with the study's own numbers, in the order of ``commands``; ``clash`` (n, n): pairs
    whose order at equal times hangs on the varied numbers.
    """

    base: Script
    commands: list[ScriptCommand]
    clash: np.ndarray

    def rows(self, targets: list[tuple[Target, np.ndarray]], count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Commands (n, c, 3) and loads (n, c, LOAD) of ``count`` rows, and which of them are in order (n,)."""
        size = len(self.commands)
        commands = np.broadcast_to(self.base.commands, (count, size, 3)).copy()
        loads = np.broadcast_to(self.base.loads, (count, size, bf.LOAD)).copy()
        good = np.ones(count, bool)
        for target, values in targets:
            own = [k for k, command in enumerate(self.commands) if command.entry == target.entry]
            good &= _lay(target, values, own, commands, loads)
        # Equal times act by rank and by the bytes of the message, in which ``commands`` are.
        order = np.argsort(commands[:, :, bf.AT_NS], axis=1, kind="stable")
        if size > 1:
            sorted_ns = np.take_along_axis(commands[:, :, bf.AT_NS], order, axis=1)
            clashes = self.clash[order[:, :-1], order[:, 1:]] & (sorted_ns[:, :-1] == sorted_ns[:, 1:])
            good &= ~clashes.any(axis=1)
        commands = np.take_along_axis(commands, order[:, :, None], axis=1)
        return commands, np.take_along_axis(loads, order[:, :, None], axis=1), good


def _lay(target: Target, values: np.ndarray, own: list[int], commands: np.ndarray, loads: np.ndarray) -> np.ndarray:
    """Write one varied field into its commands; which rows have an acceptable value (n,)."""
    key, *component = target.path
    lower, upper = {"t": (0.0, MAX_TIME_S), "duration": (1e-9, MAX_TIME_S)}.get(key, (-1e100, 1e100))
    within = (values >= lower) & (values <= upper)
    good = within if values.ndim == 1 else within.all(axis=1)
    values = np.where(within, values, 0.0)
    for k in own:
        if key in ("t", "duration"):
            # To the nearest nanosecond, halves to even, as round() has it.
            commands[:, k, bf.AT_NS if key == "t" else bf.DURATION_NS] = np.rint(values * 1e9)
        elif key == "push":
            loads[:, k, bf.FORCE] = values
        elif component:
            loads[:, k, _VECTORS[key] + component[0]] = values
        else:
            loads[:, k, _VECTORS[key] : _VECTORS[key] + 3] = values
    return good


def make_overlay(study: Study, settler: Settler, wrench_timeout: float) -> tuple[Overlay, list]:
    """The script ready for varied numbers, and the loads that the integrator has to carry; raises NotCarried, InputError."""
    commands = expand_script(study.script, "script", wrench_timeout)
    at_once = [ScriptCommand(0, *_without_time(command)) for command in commands]
    order = acting_order(at_once)
    commands = [commands[k] for k in order]
    script, loads = script_of([at_once[k] for k in order], settler)
    script.commands[:, bf.AT_NS] = [command.t_ns for command in commands]
    keys: dict[int, set] = {}
    for vary in study.vary:
        if vary.target.entry:
            keys.setdefault(vary.target.entry, set()).add(vary.target.path[0])
    clash = np.zeros((len(commands), len(commands)), bool)
    for i, a in enumerate(commands):
        if a.entry in keys:
            for j, b in enumerate(commands):
                clash[i, j] = clash[j, i] = a.kind == b.kind and _hangs_on_numbers(a, b, keys)
    return Overlay(script, commands, clash), loads


def _without_time(command: ScriptCommand) -> tuple:
    fields = (command.kind, command.frame_id, command.force, command.torque, command.changes, command.point)
    return (*fields, command.contact, command.entry)


def _hangs_on_numbers(a: ScriptCommand, b: ScriptCommand, varied: dict[int, set]) -> bool:
    """Whether the order of two messages of equal time can change with what varies."""
    keys = varied.get(a.entry, set()) | varied.get(b.entry, set())
    if "duration" in keys:
        return True  # it stands in the frame's text
    return bool(keys - {"t"}) and a.frame_id == b.frame_id
