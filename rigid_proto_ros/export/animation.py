# SPDX-License-Identifier: MIT
"""From a record of a flight to the keys of an animation, with the error that was measured of them."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np

from .flight_record import FlightRecord
from .keys import PoseKeys, pose_keys
from .sampling import Motion, Sampler, Tolerance, body_size
from .state_source import StateSource
from .string_line import StringKeys, shapes_apart, string_keys, string_shapes

TIMES_CHECKED = 1000
"""Evenly over the flight, beside those that the keys were chosen from."""


@dataclass(frozen=True)
class Animation:
    """motion: samples of the flight; keys: of its tracks; string: None where none is tied, or none is asked for. error:
    the worst that was measured, in [m] and [rad], of all. report: what to say of it, a line each.
    """

    motion: Motion
    keys: list[PoseKeys]
    string: StringKeys | None
    error: tuple[float, float]
    report: list[str]


def animate(
    record: FlightRecord,
    source: StateSource | None,
    share: float = 1e-3,
    fps: float | None = None,
    parts: Collection[str] = (),
    progress: Callable[[float, float], None] = lambda *_: None,
) -> Animation:
    """Keys that err by at most ``share`` of the body's size and as many hundred degrees, as few as it takes; or ``fps``
    evenly spaced ones a second, whatever they err. parts: what moves beside the body, ``ghost`` and ``string``. Raises
    InputError where that takes too many.
    """
    size = body_size(record)
    tolerance = Tolerance.of(share, size)
    sampler = Sampler(record, source, tolerance, "ghost" in parts, "string" in parts)
    motion = sampler.within(progress) if fps is None else sampler.at(sampler.evenly(fps))
    keys = [pose_keys(motion, track, tolerance if fps is None else None) for track in motion.tracks]
    string = None
    if "string" in parts:
        string = string_keys(motion.seconds, _shapes(record, motion), tolerance.position if fps is None else None)
    between = np.linspace(sampler.start_ns, sampler.end_ns, TIMES_CHECKED + 2)[1:-1].astype(np.int64)
    checked = [sampler.at(sampler.without_changes(times)) for times in (motion.times_ns, between, record.times_ns)]
    errors = [
        own.errors((look.times_ns - motion.times_ns[0]) * 1e-9, track.poses)
        for look in checked
        for own, track in zip(keys, look.tracks, strict=False)
    ]
    if string is not None:
        errors += [(_string_error(string, record, look, motion.times_ns[0]), 0.0) for look in checked]
    worst = max(e[0] for e in errors), max(e[1] for e in errors)
    count = sum(len(own.places.times) + len(own.attitudes.times) for own in keys)
    text = (
        f"{count} keys; worst error {worst[0]:.2g} m ({worst[0] / size:.2g} of the body's size) and "
        f"{np.degrees(worst[1]):.2g} degrees, measured at {sum(len(look.times_ns) for look in checked)} times"
    )
    report = [text]
    if not (worst[0] <= tolerance.position and worst[1] <= tolerance.angle):
        report.append(
            f"beyond the tolerance of {share:g} body sizes and {100 * share:g} degrees: "
            + ("a larger --fps, or none, errs less" if fps else "single precision has no digits for less")
        )
    if sampler.note:
        report.append(sampler.note)
    return Animation(motion, keys, string, worst, report)


def _shapes(record: FlightRecord, motion: Motion) -> np.ndarray:
    return string_shapes(record, motion.times_ns, motion.body.poses)


def _string_error(string: StringKeys, record: FlightRecord, look: Motion, start_ns: int) -> float:
    """How far the string that is played is from the true one at most [m]."""
    apart = shapes_apart(string.played((look.times_ns - start_ns) * 1e-9), _shapes(record, look))
    return float(np.nan_to_num(apart).max())
