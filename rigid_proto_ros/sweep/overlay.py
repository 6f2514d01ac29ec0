# SPDX-License-Identifier: MIT
"""Numbers of a poke script that vary from row to row, written straight into the arrays of the compiled batch.

That is possible where a varied field changes numbers alone: when a poke acts, how long, how hard. Anything else (where
it acts, repeats, held wrenches) is expanded row by row.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..motion import loads as ld
from ..scene.command_codec import ScriptCommand
from ..scene.script import MAX_TIME_S, expand_script
from ..simulation import flight as fl
from .study import Study
from .targets import Target
from .templates import LoadResolver, Script, script_of

_VECTORS = {"force": ld.FORCE, "impulse": ld.FORCE, "torque": ld.TORQUE, "angular_impulse": ld.TORQUE}
_TIMING = {"repeat", "every", "jitter", "seed"}
_OTHER_KINDS = {"wrench", "thrusters", "state", "string", "set", "service"}


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
    """A script whose numbers vary. base: with the study's own numbers, in the order in which the script
    lists ``commands``.
    """

    base: Script
    commands: list[ScriptCommand]

    def rows(self, targets: list[tuple[Target, np.ndarray]], count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Commands (n, c, COMMAND) and loads (n, c, LOAD) of ``count`` rows in order of time, and which rows
        have good values (n,).
        """
        size = len(self.commands)
        commands = np.broadcast_to(self.base.commands, (count, size, fl.COMMAND)).copy()
        loads = np.broadcast_to(self.base.loads, (count, size, ld.LOAD)).copy()
        good = np.ones(count, bool)
        for target, values in targets:
            own = [k for k, command in enumerate(self.commands) if command.entry == target.entry]
            good &= _lay(target, values, own, commands, loads)
        # Stable: equal times act in the order of the script.
        order = np.argsort(commands[:, :, fl.AT_NS], axis=1, kind="stable")
        commands = np.take_along_axis(commands, order[:, :, None], axis=1)
        return commands, np.take_along_axis(loads, order[:, :, None], axis=1), good


def _lay(target: Target, values: np.ndarray, own: list[int], commands: np.ndarray, loads: np.ndarray) -> np.ndarray:
    """Write one varied field into its commands; which rows have an acceptable value (n,)."""
    key, *component = target.path
    lower, upper = {"t": (0.0, MAX_TIME_S), "duration": (1e-9, MAX_TIME_S)}.get(key, (-1e100, 1e100))
    within = (values >= lower) & (values <= upper)
    good = within if values.ndim == 1 else np.logical_and.reduce(within, axis=1)
    values = np.where(within, values, 0.0)
    for k in own:
        if key in ("t", "duration"):
            # To the nearest nanosecond, halves to even, as round() has it.
            commands[:, k, fl.AT_NS if key == "t" else fl.DURATION_NS] = np.rint(values * 1e9)
        elif key == "push":
            loads[:, k, ld.FORCE] = values
        elif component:
            loads[:, k, _VECTORS[key] + component[0]] = values
        else:
            loads[:, k, _VECTORS[key] : _VECTORS[key] + 3] = values
    return good


def make_overlay(study: Study, resolver: LoadResolver) -> tuple[Overlay, list]:
    """The script ready for varied numbers, and the loads that the integrator has to support; raises
    NotBatchable, InputError.
    """
    commands = expand_script(study.script, "script")
    commands.sort(key=lambda command: command.entry)
    script, loads = script_of(commands, resolver)
    return Overlay(script, commands), loads
