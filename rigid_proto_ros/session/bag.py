# SPDX-License-Identifier: MIT
"""Bags: the MCAP files that we record and that ``ros2 bag record`` writes, alone or in a folder, read up to where they
were cut; and what is whole of a cut one written anew.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from mcap import records
from mcap.stream_reader import StreamReader
from mcap.writer import Writer

from ..base.errors import InputError

ROS_PROFILE = "ros2"

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
    content = BagContent()
    for file in _files(path):
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
    if not (content.types or content.attachments or content.metadata):
        raise InputError("session", str(path), "a recording with data; this one ends before its first chunk")
    return content


def repair_mcap(path: Path, repaired: Path) -> None:
    """Write a finished file with all that is whole in a cut one; raises InputError where that can't be."""
    schemas: dict[int, int] = {0: 0}
    channels: dict[int, int] = {}
    try:
        with open(repaired, "wb") as stream:
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
                    writer.add_attachment(
                        record.create_time, record.log_time, record.name, record.media_type, record.data
                    )
                elif isinstance(record, records.Metadata):
                    writer.add_metadata(record.name, record.metadata)
            writer.finish()
    except OSError as error:
        raise InputError("--repair", str(repaired), f"a file that can be written ({error.strerror})") from None


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
        end, footer = 0, None
        try:
            for record in StreamReader(stream, validate_crcs=True).records:
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
            if not cut or end == 0:
                accepted = f"an undamaged .mcap, as ros2 bag record or ros2 bag convert writes it ({error})"
                raise InputError("session", str(path), accepted) from None


def _files(path: Path) -> list[Path]:
    """The files of a bag in their order, which are numbered where it was split; raises InputError."""
    if not path.is_dir():
        return [path]
    files = sorted(path.glob("*.mcap"), key=lambda file: (len(file.name), file.name))
    if not files:
        accepted = "a folder with .mcap files; ros2 bag convert makes one of other or compressed files"
        raise InputError("session", str(path), accepted)
    return files
