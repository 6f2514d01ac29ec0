# SPDX-License-Identifier: MIT
"""Bags: the MCAP files that we record and that ``ros2 bag record`` writes, alone or in a folder, read up to where they
were cut, and the runs in them: a reset starts simulated time again, and a bag holds it all in one. What is whole of a
cut file is written anew.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import zstandard
from mcap import records
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import MCAP0_MAGIC, Writer

from ..base.errors import InputError
from ..base.files import whole_file
from ..base.rotation import rotate, rotate_inverse
from ..base.vectors import FloatArray, IntArray
from .messages import FLOOR, MADE_WITH, PROJECTIONS, READ, read_state, read_string
from .recorded_session import RecordedSession, StampedRows, decode_event

ROS_PROFILE = "ros2"

MAX_RATIO, SPARE = 200, 64_000_000
"""Bytes that chunks hold unpacked, for each byte of the file and beyond: our states shrink to a sixteenth, and what is
made to fill the memory to a thirty thousandth.
"""

_RECORD_HEAD = struct.Struct("<BQ")
"""Opcode and length of what follows."""


@dataclass
class BagContent:
    """What is whole in a bag: messages by topic as (log_time, bytes) in the file's order, types by topic, attachments
    (name, bytes), metadata by name. complete: it was finished properly.
    """

    messages: dict[str, list[tuple[int, bytes]]] = field(default_factory=dict)
    types: dict[str, str] = field(default_factory=dict)
    attachments: list[tuple[str, bytes]] = field(default_factory=list)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    complete: bool = True


def read_bag(path: Path, wanted: Callable[[str], bool]) -> BagContent:
    """All that is whole in a bag, of the topics that are ``wanted(topic)``; raises InputError."""
    content, files = BagContent(), _files(path)
    for file in files:
        finished = False
        schemas: dict[int, str] = {}
        topics: dict[int, str] = {}
        for record in _whole_records(file):
            if isinstance(record, records.Message):
                topic = topics[record.channel_id]
                if wanted(topic):
                    content.messages.setdefault(topic, []).append((record.log_time, record.data))
            elif isinstance(record, records.Schema):
                schemas[record.id] = record.name
            elif isinstance(record, records.Channel):
                topics[record.id] = record.topic
                content.types[record.topic] = schemas.get(record.schema_id, "")
            elif isinstance(record, records.Attachment):
                content.attachments.append((record.name, record.data))
            elif isinstance(record, records.Metadata):
                content.metadata[record.name] = dict(record.metadata)
            else:
                finished = isinstance(record, records.Footer)
        content.complete &= finished
    if MADE_WITH in content.metadata and len(files) > 1:
        # Ours are never split: these would be taken for one flight.
        raise InputError("session", str(path), f"one of the {len(files)} recordings in this folder")
    if not (content.types or content.attachments or content.metadata):
        raise InputError("session", str(path), "a recording with data; this one ends before its first chunk")
    return content


def repair_mcap(path: Path, repaired: Path) -> None:
    """Write a finished file with all that is whole in a cut one; raises InputError where that can't be."""
    schemas: dict[int, int] = {0: 0}
    channels: dict[int, int] = {}
    with whole_file("--repair", repaired) as beside, open(beside, "wb") as stream:
        writer = Writer(stream)
        writer.start(profile=ROS_PROFILE)
        for record in _whole_records(path):
            if isinstance(record, records.Message):
                channel = channels[record.channel_id]
                writer.add_message(channel, record.log_time, record.data, record.publish_time, record.sequence)
            elif isinstance(record, records.Schema) and record.id not in schemas:
                schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
            elif isinstance(record, records.Channel) and record.id not in channels:
                channels[record.id] = writer.register_channel(
                    record.topic, record.message_encoding, schemas[record.schema_id], record.metadata
                )
            elif isinstance(record, records.Attachment):
                writer.add_attachment(record.create_time, record.log_time, record.name, record.media_type, record.data)
            elif isinstance(record, records.Metadata):
                writer.add_metadata(record.name, record.metadata)
        writer.finish()


def _whole_records(path: Path) -> Iterator[records.McapRecord]:
    """The records of a file, chunks opened, up to its end or to where it was cut: then no Footer is among them. Raises
    InputError for what is no MCAP file, or was damaged inside.
    """
    known: set[int] = set()
    try:
        stream = open(path, "rb")  # noqa: SIM115 (closed below)
    except OSError as error:
        raise InputError("session", str(path), f"a recording that can be read ({error.strerror})") from None
    with stream:
        if stream.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
            remedy = "ros2 bag convert rewrites other or compressed files"
            raise InputError("session", f"the content of {str(path)!r} is that of no .mcap recording; {remedy}")
        end, footer = stream.tell(), None
        left = MAX_RATIO * path.stat().st_size + SPARE
        stream.seek(0)
        try:
            for record in _unpacked(StreamReader(stream, emit_chunks=True, validate_crcs=True), left):
                end = stream.tell()
                if isinstance(record, records.Footer):
                    footer = record
                    continue
                if isinstance(record, records.Channel):
                    known.add(record.id)
                elif isinstance(record, records.Message) and record.channel_id not in known:
                    raise ValueError("a message of an unknown channel")
                yield record
            if footer is not None:
                yield footer
        except Exception as error:  # the library lets through whatever cut or damaged bytes lead to
            # Cut is what isn't as long as it says.
            stream.seek(end)
            head = stream.read(_RECORD_HEAD.size)
            cut = len(head) < _RECORD_HEAD.size or end + len(head) + _RECORD_HEAD.unpack(head)[1] > path.stat().st_size
            if not cut:
                reason = str(error) or type(error).__name__
                accepted = f"an undamaged .mcap, as ros2 bag record or ros2 bag convert writes it ({reason})"
                raise InputError("session", str(path), accepted) from None


def _unpacked(reader: StreamReader, left: int) -> Iterator[records.McapRecord]:
    """The records that are read, chunks opened that hold no more than ``left`` bytes together."""
    for record in reader.records:
        if not isinstance(record, records.Chunk):
            yield record
            continue
        left -= record.uncompressed_size
        # The library takes a frame's own word for its size, where that has one.
        if left < 0 or (
            record.compression == "zstd" and zstandard.frame_content_size(record.data) > record.uncompressed_size
        ):
            raise ValueError("chunks that hold more than a recording of this size can")
        yield from breakup_chunk(record, validate_crc=True)


def _files(path: Path) -> list[Path]:
    """The files of a bag in their order, which are numbered where it was split; raises InputError."""
    if not path.is_dir():
        return [path]
    files = sorted(path.glob("*.mcap"), key=lambda file: (len(file.name), file.name))
    if not files:
        accepted = "a folder with .mcap files; ros2 bag convert rewrites other or compressed files"
        raise InputError("session", str(path), accepted)
    return files


# Runs

RESET_WINDOW_NS = 1_000_000_000
"""Topics reach a recorder one by one: a reset's line and the first state after it lie this close in its log."""


def session_runs(path: Path, node: str = "") -> list[RecordedSession]:
    """The runs of one body in a bag, in their order; ``node`` chooses the body where there are several.

    Raises InputError for a bag without states, and for messages that can't be decoded.
    """
    content = read_bag(path, lambda topic: topic.rpartition("/")[2] in READ)
    prefix = _prefix(content, str(path), node)
    events = [(log, read_string(data, f"{prefix}/events")) for log, data in _messages(content, prefix, "events")]
    scenes = [(log, read_string(data, f"{prefix}/scene")) for log, data in _messages(content, prefix, "scene")]
    decoded = [decode_event(line, number) for number, (_, line) in enumerate(events, 1)]
    if MADE_WITH not in content.metadata and any(
        kind == "clock" and told.get("offset_ns") for _, kind, told in decoded
    ):
        accepted = "a recording by the parameter record; the stamps of these topics are those of a followed /clock"
        raise InputError("session", str(path), accepted)
    states = {name: _states(content, prefix, name) for name in PROJECTIONS}
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
        missing=tuple(missing),
        attachments=content.attachments,
        made_with=content.metadata.get(MADE_WITH, {}),
        folder=path.absolute().parent,
    )
    # Our own recorder logs all topics in the order in which they were told; another one gets each topic by itself.
    cut = _cuts_by_log if MADE_WITH in content.metadata else _cuts
    cuts = {name: cut(logs, rows.times, resets) for name, (logs, rows) in states.items()}
    runs = []
    for k, (begin, end) in enumerate(zip([None, *resets], [*resets, None], strict=True)):
        # The scene in force at a reset; at the recording's own start the first one that it holds. Logged at simulated
        # time, a run's first scene comes before those that it is changed to at time 0.
        before = [text for log, text in scenes if begin is not None and log < begin]
        at_reset = [text for log, text in scenes if log == begin]
        in_force = [*at_reset[:1], *before[-1:], *(text for _, text in scenes[:1])]
        later = [text for log, text in scenes if begin is None or log >= begin]
        run = replace(whole, scene=in_force[0] if in_force else "", scenes=later)
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


def _prefix(content: BagContent, path: str, node: str) -> str:
    """The prefix of the topics' names: the node's name after a slash."""
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


def _states(content: BagContent, prefix: str, name: str) -> tuple[IntArray, StampedRows]:
    """When a topic's states were logged, and they."""
    messages = _messages(content, prefix, name)
    read = [read_state(name, data, f"{prefix}/{name}") for _, data in messages]
    logs = np.array([log for log, _ in messages], dtype=np.int64)
    times = np.array([stamp for stamp, _ in read], dtype=np.int64)
    return logs, StampedRows(times, np.array([row for _, row in read], dtype=float))


def _cuts_by_log(logs: IntArray, stamps: IntArray, resets: list[int]) -> list[int]:
    """Where a topic's messages of each run begin, and the end: at the resets' places in the log."""
    return [0, *np.searchsorted(logs, np.array(resets, np.int64)).tolist(), len(stamps)]


def _cuts(logs: IntArray, stamps: IntArray, resets: list[int]) -> list[int]:
    """Where a topic's messages of each run begin, and the end: at the restarts of its stamps."""
    restarts = (np.flatnonzero(np.diff(stamps) < 0) + 1).tolist()
    # One each, however late the topic was logged.
    if len(restarts) == len(resets):
        return [0, *restarts, len(stamps)]
    cuts = [0]
    for reset in resets:
        # A reset of a body at time 0 shows in no stamp: there the log decides, where no restart is near.
        cut = int(np.searchsorted(logs, reset, side="right"))
        near = [k for k in restarts if abs(int(logs[k]) - reset) < RESET_WINDOW_NS and k >= cuts[-1]]
        cuts.append(max(cuts[-1], min(near, key=lambda k: abs(int(logs[k]) - reset)) if near else cut))
    return [*cuts, len(stamps)]


def _shown_rows(published: dict[str, StampedRows]) -> tuple[IntArray, FloatArray]:
    """Times, one per stamp, and state rows (n, 13) from what was published; velocities that weren't are 0."""
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
