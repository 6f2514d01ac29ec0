# SPDX-License-Identifier: MIT
"""Reading of MCAP recordings, written by this package or by ``ros2 bag record``, as a file or a folder; truncated files
are read up to the truncation, and can be repaired. A recording holds one or more runs, separated by resets, at which
simulated time starts again.

States and events may be many: they are read from the file when they are needed. All else is read once.
"""

from __future__ import annotations

import heapq
import struct
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from operator import itemgetter
from pathlib import Path
from typing import Any

from ..base.errors import InputError, is_missing
from ..base.files import is_same_file, output_file, whole_file
from .messages import FLOOR, MADE_WITH, PROJECTIONS, READ, read_stamp, read_state, read_string
from .recorded_session import RecordedSession, States, decode_event

try:
    import zstandard
    from mcap import records
    from mcap.stream_reader import StreamReader, breakup_chunk
    from mcap.writer import MCAP0_MAGIC, Writer
except ImportError:
    raise InputError("session", is_missing("mcap", "mcap")) from None

ROS_PROFILE = "ros2"

MAX_RATIO, SPARE = 200, 64_000_000
"""Limit of the uncompressed size of all chunks: MAX_RATIO times the file size plus SPARE [bytes]. Our states compress
by a factor of 16, a decompression bomb by 30,000.
"""

RRD_MAGIC = b"RRF2"

_RECORD_HEAD = struct.Struct("<BQ")
"""Opcode and length of a record."""


def check_session(path: Path) -> None:
    """Raise InputError if the session doesn't exist or is an .rrd file, which is never read back."""
    if not path.exists():
        raise InputError("session", f"there is no file and no folder {str(path)!r}")
    head = b""
    # Ignores errors of folders, and of unreadable files, which are refused when they are read.
    with suppress(OSError), open(path, "rb") as stream:
        head = stream.read(len(RRD_MAGIC))
    if head == RRD_MAGIC or path.suffix == ".rrd":
        beside = path.with_suffix(".mcap")
        given = str(beside) if beside.exists() else "the .mcap of the same flight (record and --record take both names)"
        raise InputError("session", f"{path} is a view for Rerun, shown by `rerun {path}`; accepted: {given}")


def repair(path: Path, repaired: Path) -> None:
    """Write a complete file with the intact records of a truncated recording. Raises InputError if the output can't be
    written, or if the input is not a recording or is damaged.
    """
    check_session(path)
    if path.is_dir():
        raise InputError("--repair", str(path), "one .mcap file of the folder")
    if repaired.suffix != ".mcap":
        raise InputError("--repair", str(repaired), "a file that ends in .mcap")
    if is_same_file(repaired, path):
        raise InputError("--repair", str(repaired), "another file than the one that is repaired")
    output_file("--repair", repaired)
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
    """Yield the records of a file, chunks unpacked, up to its end or its truncation; a truncated file gives no Footer.
    Raises InputError for a file that isn't MCAP or is damaged.
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
        except Exception as error:  # the library raises various exceptions for truncated or damaged data
            # The file is truncated, not damaged, if its last record is shorter than the length that it states.
            stream.seek(end)
            head = stream.read(_RECORD_HEAD.size)
            cut = len(head) < _RECORD_HEAD.size or end + len(head) + _RECORD_HEAD.unpack(head)[1] > path.stat().st_size
            if not cut:
                reason = str(error) or type(error).__name__
                accepted = f"an undamaged .mcap, as ros2 bag record or ros2 bag convert writes it ({reason})"
                raise InputError("session", str(path), accepted) from None


def _unpacked(reader: StreamReader, left: int) -> Iterator[records.McapRecord]:
    """Yield the reader's records, chunks unpacked; raises ValueError if all chunks together exceed ``left`` bytes."""
    for record in reader.records:
        if not isinstance(record, records.Chunk):
            yield record
            continue
        left -= record.uncompressed_size
        # The library trusts the content size that a zstd frame states, if any, so it must be checked, too.
        if left < 0 or (
            record.compression == "zstd" and zstandard.frame_content_size(record.data) > record.uncompressed_size
        ):
            raise ValueError("chunks that hold more than a recording of this size can")
        yield from breakup_chunk(record, validate_crc=True)


def _files(path: Path) -> list[Path]:
    """The files of a bag in order; those of a split bag are numbered. Raises InputError."""
    if not path.is_dir():
        return [path]
    files = sorted(path.glob("*.mcap"), key=lambda file: (len(file.name), file.name))
    if not files:
        accepted = "a folder with .mcap files; ros2 bag convert rewrites other or compressed files"
        raise InputError("session", str(path), accepted)
    return files


def _all_records(path: Path) -> Iterator[tuple[str, str, records.McapRecord]]:
    """Yield the records of all files in order, each as topic and type (of a message or channel) and record."""
    for file in _files(path):
        schemas: dict[int, str] = {}
        channels: dict[int, tuple[str, str]] = {}
        for record in _whole_records(file):
            topic = message_type = ""
            if isinstance(record, records.Message):
                topic, message_type = channels[record.channel_id]
            elif isinstance(record, records.Schema):
                schemas[record.id] = record.name
            elif isinstance(record, records.Channel):
                topic, message_type = channels[record.id] = record.topic, schemas.get(record.schema_id, "")
            yield topic, message_type, record


def has_scene(path: Path) -> bool:
    """Whether a bag contains a scene, as recordings by this package do; raises InputError."""
    return any(
        isinstance(record, records.Message) and topic.rpartition("/")[2] == "scene" and kind == READ["scene"]
        for topic, kind, record in _all_records(path)
    )


# Content of a file, without states and events


@dataclass
class _Span:
    """Consecutive messages of a state topic whose stamps don't decrease. begin: number of the first message, from 0;
    back: the place in the file if the stamp decreased there. first_ns, end_ns: first and last stamp; states: number of
    different stamps.
    """

    begin: int
    back: _Cut | None
    first_ns: int
    end_ns: int
    states: int = 1


@dataclass
class _Cut:
    """A place in the file where a run may begin. log: log time [ns]; counts: number of messages before it by state
    topic, and of events.
    """

    log: int
    counts: dict[str, int]


@dataclass
class _Body:
    """Topics with one prefix. names: declared topics, without the prefix. scenes: (log time [ns], text). spans: by
    state topic; counts: number of messages by topic; cut: state topics without a message since the last reset.
    undecodable: error of the first event that can't be decoded; timeouts: kinds of timeouts, as keys of their events;
    offset: the node followed a clock.
    """

    names: set[str] = field(default_factory=set)
    scenes: list[tuple[int, str]] = field(default_factory=list)
    resets: list[_Cut] = field(default_factory=list)
    spans: dict[str, list[_Span]] = field(default_factory=lambda: {name: [] for name in PROJECTIONS})
    counts: dict[str, int] = field(default_factory=lambda: dict.fromkeys((*PROJECTIONS, "events"), 0))
    cut: set[str] = field(default_factory=set)
    undecodable: InputError | None = None
    timeouts: set[str] = field(default_factory=set)
    offset: bool = False

    def take(self, name: str, topic: str, log: int, data: bytes) -> None:
        """Process a message; raises InputError if it can't be decoded."""
        if name == "scene":
            self.scenes.append((log, read_string(data, topic)))
        elif name == "events":
            self._take_event(log, read_string(data, topic))
        else:
            self._take_state(name, log, read_stamp(data, topic))

    def _take_event(self, log: int, line: str) -> None:
        kind, content = "", dict[str, Any]()
        try:
            _, kind, content = decode_event(line, self.counts["events"] + 1)
        except InputError as error:  # raised later if this body is the chosen one
            self.undecodable = self.undecodable or error
        if kind == "timeout":
            self.timeouts.update(content)
        self.offset |= kind == "clock" and bool(content.get("offset_ns"))
        if kind == "reset":
            self.resets.append(_Cut(log, dict(self.counts)))
            self.cut = set(PROJECTIONS)
        self.counts["events"] += 1

    def _take_state(self, name: str, log: int, stamp_ns: int) -> None:
        spans = self.spans[name]
        back = _Cut(log, dict(self.counts)) if spans and stamp_ns < spans[-1].end_ns else None
        if back or not spans or name in self.cut:
            spans.append(_Span(self.counts[name], back, stamp_ns, stamp_ns))
            self.cut.discard(name)
        elif stamp_ns != spans[-1].end_ns:
            spans[-1].end_ns = stamp_ns
            spans[-1].states += 1
        self.counts[name] += 1


@dataclass
class _Content:
    """Intact content of a recording: bodies by prefix, types by topic, attachments (name, bytes), metadata by name.
    complete: all files were closed properly.
    """

    bodies: dict[str, _Body] = field(default_factory=dict)
    types: dict[str, str] = field(default_factory=dict)
    attachments: list[tuple[str, bytes]] = field(default_factory=list)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    complete: bool = False


def _read(path: Path) -> _Content:
    content, footers = _Content(), 0
    for topic, message_type, record in _all_records(path):
        prefix, slash, name = topic.rpartition("/")
        ours = slash and READ.get(name) == message_type
        if isinstance(record, records.Message):
            if ours:
                content.bodies[prefix].take(name, topic, record.log_time, record.data)
        elif isinstance(record, records.Channel):
            content.types[topic] = message_type
            if ours:
                content.bodies.setdefault(prefix, _Body()).names.add(name)
        elif isinstance(record, records.Attachment):
            content.attachments.append((record.name, record.data))
        elif isinstance(record, records.Metadata):
            content.metadata[record.name] = dict(record.metadata)
        else:
            footers += isinstance(record, records.Footer)
    files = len(_files(path))
    content.complete = footers == files
    if MADE_WITH in content.metadata and files > 1:
        # Recordings by this package are never split, so these are several flights.
        raise InputError("session", str(path), f"one of the {files} recordings in this folder")
    if not (content.types or content.attachments or content.metadata):
        raise InputError("session", str(path), "a recording with data; this one ends before its first chunk")
    return content


# States and events


class _Reader:
    """Reads messages of one body from a recording, by run. Runs read in order take one pass over the file; memory holds
    only the messages by which one topic is ahead of another in the file.

    names: topics without their prefix, by topic.
    """

    def __init__(self, path: Path, names: Mapping[str, str]) -> None:
        self._path, self._names = path, names
        self._rewind()

    def _rewind(self) -> None:
        self._records = _all_records(self._path)
        self._read = dict.fromkeys(self._names.values(), 0)
        self._wanted = dict(self._read)
        self._waiting: dict[str, deque[tuple[str, bytes]]] = {name: deque() for name in self._read}

    def states(self, ranges: Mapping[str, range]) -> Iterator[tuple[int, str, list[float]]]:
        """Stamp [ns], topic name and row of the messages in these ranges of numbers by state topic, in order of time.
        Raises InputError for a message that can't be decoded.
        """
        self._begin(ranges)
        # The merge is stable: messages of the same time are in the order of the topics.
        return heapq.merge(*(self._states(name, len(own)) for name, own in ranges.items()), key=itemgetter(0))

    def _states(self, name: str, count: int) -> Iterator[tuple[int, str, list[float]]]:
        for topic, data in self._messages(name, count):
            stamp_ns, row = read_state(name, data, topic)
            yield stamp_ns, name, row

    def events(self, numbers: range) -> Iterator[tuple[int, str]]:
        """Time [ns] and line of the events with these numbers."""
        self._begin({"events": numbers})
        for number, (topic, data) in enumerate(self._messages("events", len(numbers)), 1):
            line = read_string(data, topic)
            yield decode_event(line, number)[0], line

    def _begin(self, ranges: Mapping[str, range]) -> None:
        """Seek to the beginnings of these ranges; invalidates iterators returned before."""
        if any(own.start < self._read[name] - len(self._waiting[name]) for name, own in ranges.items()):
            self._rewind()
        for name, own in ranges.items():
            waiting = self._waiting[name]
            for _ in range(min(len(waiting), own.start - (self._read[name] - len(waiting)))):
                waiting.popleft()
            self._wanted[name] = own.start

    def _messages(self, name: str, count: int) -> Iterator[tuple[str, bytes]]:
        waiting = self._waiting[name]
        for _ in range(count):
            while not waiting:
                self._read_next()
            yield waiting.popleft()

    def _read_next(self) -> None:
        """Read the next message of one of the topics."""
        for topic, message_type, record in self._records:
            name = self._names.get(topic)
            if name is None or not isinstance(record, records.Message) or READ[name] != message_type:
                continue
            if self._read[name] >= self._wanted[name]:
                self._waiting[name].append((topic, record.data))
            self._read[name] += 1
            return
        raise InputError("session", str(self._path), "a recording that stays as it is while it is read")


class _RunStates(States):
    """The states of one run. ranges: numbers of its messages by topic; spans: spans of the whole body."""

    def __init__(self, reader: _Reader, ranges: Mapping[str, range], spans: Mapping[str, list[_Span]]) -> None:
        self._reader = reader
        self._ranges = {name: own for name, own in ranges.items() if own}
        self.topics = tuple(self._ranges)
        found = {name: [span for span in spans[name] if span.begin in own] for name, own in self._ranges.items()}
        self.count = max((sum(span.states for span in own) for own in found.values()), default=0)
        every = [span for own in found.values() for span in own]
        self.first_ns = min((span.first_ns for span in every), default=0)
        self.end_ns = max((span.end_ns for span in every), default=0)

    def __iter__(self) -> Iterator[tuple[int, str, list[float]]]:
        return self._reader.states(self._ranges)


class _RunEvents:
    """The events of one run (``recorded_session.Events``). numbers: their numbers among all events of the body."""

    def __init__(self, reader: _Reader, numbers: range) -> None:
        self._reader, self._numbers = reader, numbers

    def __len__(self) -> int:
        return len(self._numbers)

    def __iter__(self) -> Iterator[tuple[int, str]]:
        return self._reader.events(self._numbers)


# Runs

RESET_WINDOW_NS = 1_000_000_000
"""Longest time between a reset's event and the first state after it in the log [ns]; topics reach a recorder
separately.
"""


def read_runs(path: str | Path, node: str = "") -> list[RecordedSession]:
    """The runs of one body in a recording, in order; ``node`` selects the body if there are several.

    Raises InputError if the recording doesn't exist, isn't one or has no body, and for messages that can't be decoded.
    """
    path = Path(path)
    check_session(path)
    content = _read(path)
    prefix = _prefix(content, str(path), node)
    body, ours = content.bodies[prefix], MADE_WITH in content.metadata
    if body.undecodable:
        raise body.undecodable
    if not ours and body.offset:
        accepted = "a recording by the parameter record; the stamps of these topics are those of a followed /clock"
        raise InputError("session", str(path), accepted)
    scenes = sorted(body.scenes, key=itemgetter(0))
    names = [name for name in PROJECTIONS if body.counts[name]]
    # The topic events may be complete without messages; the latched topic scene always has one.
    there = {"scene": bool(scenes), "events": "events" in body.names, "pose": bool(names)}
    resets = body.resets
    if not body.counts["events"] and names:
        resets = [span.back for span in body.spans[names[0]] if span.back]
    whole = RecordedSession(
        complete=content.complete,
        node_name=prefix.strip("/"),
        missing=tuple(f"{prefix}/{name}" for name, is_there in there.items() if not is_there),
        attachments=content.attachments,
        made_with=content.metadata.get(MADE_WITH, {}),
        logged_timeouts=body.timeouts,
        folder=path.absolute().parent,
    )
    # Our recorder writes all topics in one order; other recorders receive each topic separately.
    cuts = {name: _cuts(name, body, [] if ours else body.spans[name], resets) for name in names}
    cuts["events"] = [0, *(reset.counts["events"] for reset in resets), body.counts["events"]]
    state_reader = _Reader(path, {f"{prefix}/{name}": name for name in names})
    event_reader = _Reader(path, {f"{prefix}/events": "events"})
    runs = []
    for k, begin in enumerate([None, *(reset.log for reset in resets)]):
        # The scene at the time of the reset, or the first scene for the start of the recording. Among scenes logged at
        # the reset's own time, the first is the run's start, and the others are changes at time 0.
        before = [text for log, text in scenes if begin is not None and log < begin]
        at_reset = [text for log, text in scenes if log == begin]
        in_force = [*at_reset[:1], *before[-1:], *(text for _, text in scenes[:1])]
        numbers = {name: range(own[k], own[k + 1]) for name, own in cuts.items()}
        run = replace(
            whole,
            scene=in_force[0] if in_force else "",
            scenes=[text for log, text in scenes if begin is None or log >= begin],
            accuracy_floor=content.metadata.get(FLOOR.format(k), {}).get("floor", ""),
            events=_RunEvents(event_reader, numbers.pop("events")),
            states=_RunStates(state_reader, numbers, body.spans),
        )
        if len(run.events) or run.states.topics:
            runs.append(run)
    return runs or [whole]


def _prefix(content: _Content, path: str, node: str) -> str:
    """The prefix of the topic names: a slash and the node's name."""
    flown = sorted(p for p, body in content.bodies.items() if body.names & {"scene", "events"})
    flown = flown or sorted(content.bodies)
    if node:
        flown = [p for p in content.bodies if p.strip("/") == node.strip("/")]
        if not flown:
            known = ", ".join(sorted(content.bodies)) or "it has none"
            raise InputError("--node", node, f"one of the recording's: {known}")
    if not flown:
        topics = ", ".join(sorted(content.types)[:5]) or "no topics"
        raise InputError("session", f"{path} has {topics}, and no pose, twist or odom topic of a node")
    if len(flown) > 1:
        raise InputError("session", f"{path} has several bodies, {', '.join(flown)}; choose one with --node NAME")
    return flown[0]


def _cuts(name: str, body: _Body, spans: list[_Span], resets: list[_Cut]) -> list[int]:
    """Numbers of a topic's messages at which the runs begin, and their total: at the resets' places in the file, or
    where the stamps in ``spans`` restart.
    """
    restarts = [(span.begin, span.back.log) for span in spans if span.back]
    # One restart per reset, even if the topic was logged late.
    if resets and len(restarts) == len(resets):
        return [0, *(begin for begin, _ in restarts), body.counts[name]]
    cuts = [0]
    for reset in resets:
        # A reset at time 0 doesn't decrease a stamp: without a restart nearby, the log time decides.
        near = [(abs(log - reset.log), begin) for begin, log in restarts if begin >= cuts[-1]]
        away, begin = min(near, default=(RESET_WINDOW_NS, 0))
        cuts.append(max(cuts[-1], begin if away < RESET_WINDOW_NS else reset.counts[name]))
    return [*cuts, body.counts[name]]
