# SPDX-License-Identifier: MIT
"""From the messages of a bag to the runs in it: a reset starts simulated time again, and a bag holds it all in one."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..base.errors import InputError
from ..base.rotation import rotate, rotate_inverse
from ..scene.scenario import mesh_sha256_of
from .messages import FLOOR, MADE_WITH, PROJECTIONS, READ, read_state, read_string
from .recorded_session import RecordedSession, StampedRows

if TYPE_CHECKING:
    from .bag import BagContent  # .rrd files are read without the package mcap

RESET_WINDOW_NS = 1_000_000_000
"""Topics reach a recorder one by one: a reset's line and the first state after it lie this close in its log."""


def is_session_topic(topic: str) -> bool:
    """Whether a topic may hold a part of a session."""
    return topic.rpartition("/")[2] in READ


def session_runs(content: BagContent, path: Path, node: str = "") -> list[RecordedSession]:
    """The runs of one body in a bag, in their order; ``node`` chooses the body where there are several.

    Raises InputError for a bag without states, and for messages that can't be decoded.
    """
    prefix = _prefix(content, str(path), node)
    events = [(log, read_string(data, f"{prefix}/events")) for log, data in _messages(content, prefix, "events")]
    scenes = [(log, read_string(data, f"{prefix}/scene")) for log, data in _messages(content, prefix, "scene")]
    decoded = [decode_event(line, number) for number, (_, line) in enumerate(events, 1)]
    clocks = [
        (log, time_ns, content.get("offset_ns", 0))
        for (log, _), (time_ns, kind, content) in zip(events, decoded, strict=True)
        if kind == "clock"
    ]
    states = {name: _states(content, prefix, name, clocks) for name in PROJECTIONS}
    states = {name: found for name, found in states.items() if len(found[0])}
    # A topic without messages may be whole: nobody did anything. A latched one is never without.
    there = {"scene": bool(scenes), "events": f"{prefix}/events" in content.types, "pose": bool(states)}
    missing = [f"{prefix}/{name}" for name, is_there in there.items() if not is_there]
    resets = [log for (log, _), (_, kind, _) in zip(events, decoded, strict=True) if kind == "reset"]
    if not events and states:
        logs, rows = next(iter(states.values()))
        resets = logs[1:][np.diff(rows.times) < 0].tolist()
    whole = RecordedSession(
        complete=content.complete,
        node_name=prefix.strip("/"),
        scenes=[text for _, text in scenes],
        missing=tuple(missing),
        attachments=content.attachments,
        made_with=content.metadata.get(MADE_WITH, {}),
        folder=path if path.is_dir() else path.parent,
    )
    cuts = {name: _cuts(logs, rows.times, resets) for name, (logs, rows) in states.items()}
    runs = []
    for k, (begin, end) in enumerate(zip([None, *resets], [*resets, None], strict=True)):
        # The scene in force at a reset; at the recording's own start the first one that it holds.
        before = [text for log, text in scenes if begin is not None and log <= begin]
        run = replace(whole, scene=before[-1] if before else scenes[0][1] if scenes else "")
        run.mesh_sha256 = mesh_sha256_of(run.scene)
        run.accuracy_floor = content.metadata.get(FLOOR.format(k), {}).get("floor", "")
        run.events = [
            (time_ns, line)
            for (log, line), (time_ns, _, _) in zip(events, decoded, strict=True)
            if (begin is None or log >= begin) and (end is None or log < end)
        ]
        run.published = {
            name: StampedRows(
                rows.times[cuts[name][k] : cuts[name][k + 1]], rows.rows[cuts[name][k] : cuts[name][k + 1]]
            )
            for name, (_, rows) in states.items()
        }
        run.times, run.rows = _shown_rows(run.published)
        if run.events or len(run.times):
            runs.append(run)
    return runs or [whole]


def decode_event(line: str, number: int) -> tuple[int, str, dict]:
    """time_ns, kind and content of a line of the event log; raises InputError naming the event by number."""
    try:
        event = json.loads(line)
        time_ns, kind, content = event["time_ns"], event["kind"], event["content"]
        if type(time_ns) is int and time_ns >= 0 and isinstance(kind, str) and isinstance(content, dict):
            return time_ns, kind, content
    except (ValueError, KeyError, TypeError, RecursionError):
        pass
    raise InputError(f"event {number}", line[:80], "a JSON line with time_ns, kind and content")


def _prefix(content: BagContent, path: str, node: str) -> str:
    """What stands before the topics' names: the node's name with a slash before it."""
    kinds: dict[str, set[str]] = {}
    for topic, message_type in content.types.items():
        before, slash, name = topic.rpartition("/")
        if slash and READ.get(name) == message_type:
            kinds.setdefault(before, set()).add(name)
    flown = sorted(p for p, names in kinds.items() if names & {"scene", "events"}) or sorted(kinds)
    if node:
        flown = [p for p in kinds if p.strip("/") == node.strip("/")]
        if not flown:
            raise InputError("--node", node, f"one of the bag's: {', '.join(sorted(kinds)) or 'it has none'}")
    if not flown:
        topics = ", ".join(sorted(content.types)[:5]) or "no topics"
        raise InputError("session", f"{path} has {topics}, and no pose, twist or odom topic of a node")
    if len(flown) > 1:
        raise InputError("session", f"{path} has several bodies, {', '.join(flown)}; choose one with --node NAME")
    return flown[0]


def _messages(content: BagContent, prefix: str, name: str) -> list[tuple[int, bytes]]:
    """A topic's messages in the order they were logged."""
    return sorted(content.messages.get(f"{prefix}/{name}", []), key=lambda message: message[0])


def _states(
    content: BagContent, prefix: str, name: str, clocks: list[tuple[int, int, int]]
) -> tuple[np.ndarray, StampedRows]:
    """When a topic's states were logged, and they; clocks: as ``_simulated`` takes them."""
    messages = _messages(content, prefix, name)
    read = [read_state(name, data, f"{prefix}/{name}") for _, data in messages]
    logs = np.array([log for log, _ in messages], dtype=np.int64)
    rows = np.array([row for _, row in read], dtype=float)
    times = [_simulated(stamp, log, clocks) for log, (stamp, _) in zip(logs.tolist(), read, strict=True)]
    return logs, StampedRows(np.array(times, dtype=np.int64), rows)


def _simulated(stamp_ns: int, log: int, clocks: list[tuple[int, int, int]]) -> int:
    """Simulated time [ns] of a stamp of a node that may follow a /clock. clocks: when the log was told of another
    offset of stamps, the simulated time from which it holds, and how far stamps are ahead then; the last one counts
    that may have been in force.
    """
    for told, begin_ns, offset_ns in reversed(clocks):
        if told < log + RESET_WINDOW_NS and stamp_ns >= begin_ns + offset_ns:
            return stamp_ns - offset_ns
    return stamp_ns


def _cuts(logs: np.ndarray, stamps: np.ndarray, resets: list[int]) -> list[int]:
    """Where a topic's messages of each run begin, and the end: at the restart of the stamps nearest to each reset."""
    restarts = np.flatnonzero(np.diff(stamps) < 0) + 1
    cuts = [0]
    for reset in resets:
        # A reset of a body at time 0 shows in no stamp: there the log decides.
        cut = int(np.searchsorted(logs, reset, side="right"))
        near = [k for k in restarts.tolist() if abs(int(logs[k]) - reset) < RESET_WINDOW_NS and k >= cuts[-1]]
        cuts.append(max(cuts[-1], min(near, key=lambda k: abs(int(logs[k]) - reset)) if near else cut))
    return [*cuts, len(stamps)]


def _shown_rows(published: dict[str, StampedRows]) -> tuple[np.ndarray, np.ndarray]:
    """State rows (n, 13) and their times, one per stamp, from what was published; velocities that weren't are 0."""
    merged: dict[int, list[float]] = {}
    listed = {name: list(zip(r.times.tolist(), r.rows.tolist(), strict=True)) for name, r in published.items()}
    for name in ("odom", "pose"):
        for time_ns, row in listed.get(name, []):
            state = merged.setdefault(time_ns, [0.0] * 6 + [1.0] + [0.0] * 6)
            state[:7] = row[:7]
            if name == "odom":
                state[7:10], state[10:13] = rotate(*row[3:7], *row[7:10]), row[10:13]
    for time_ns, row in listed.get("twist", []):
        if time_ns in merged:
            state = merged[time_ns]
            state[7:10], state[10:13] = row[:3], rotate_inverse(*state[3:7], *row[3:6])
    times = sorted(merged)
    return np.array(times, dtype=np.int64), np.array([merged[t] for t in times]).reshape(-1, 13)
