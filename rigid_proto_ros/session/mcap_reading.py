# SPDX-License-Identifier: MIT
"""MCAP files read as far as they are whole, and what is whole of a damaged one written anew."""

from __future__ import annotations

import io
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import zstandard
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.stream_reader import CRCValidationError, get_chunk_data_stream
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer

from ..base.errors import InputError
from .mcap_writing import MESSAGE_FIELDS, RECORD_HEAD, ROS_PROFILE

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"

_CHUNK_HEAD = struct.Struct("<QQQII")


@dataclass
class McapContent:
    """What is whole in a file: messages by topic as (log_time, bytes) in the file's order, types by topic, attachments
    (name, bytes), metadata by name. complete: it was finished properly; readable_bytes of it hold whole records.
    """

    messages: dict[str, list[tuple[int, bytes]]] = field(default_factory=dict)
    types: dict[str, str] = field(default_factory=dict)
    attachments: list[tuple[str, bytes]] = field(default_factory=list)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    complete: bool = False
    readable_bytes: int = 0
    file_bytes: int = 0


def read_mcap(data: bytes, name: str, wanted: Callable[[str], bool] = lambda _: True) -> McapContent:
    """Everything whole in an MCAP file's bytes, of the topics that are ``wanted(topic)``; ``name`` stands in errors.

    A file cut anywhere, or never finished, is read up to the cut. Raises InputError for bytes that are no MCAP file,
    hold nothing whole, or were damaged inside.
    """
    content = McapContent(file_bytes=len(data))
    schemas: dict[int, str] = {}
    channels: dict[int, records.Channel] = {}
    for record, end in whole_records(data, name):
        content.readable_bytes = end
        if isinstance(record, records.Schema):
            schemas[record.id] = record.name
        elif isinstance(record, records.Channel):
            channels[record.id] = record
            content.types[record.topic] = schemas.get(record.schema_id, "")
        elif isinstance(record, records.Message):
            channel = channels.get(record.channel_id)
            if channel is None:
                raise InputError(name, f"the message at byte {end} is of an unknown channel; the file is damaged")
            if wanted(channel.topic):
                content.messages.setdefault(channel.topic, []).append((record.log_time, record.data))
        elif isinstance(record, records.Attachment):
            content.attachments.append((record.name, record.data))
        elif isinstance(record, records.Metadata):
            content.metadata[record.name] = dict(record.metadata)
        elif isinstance(record, records.Footer):
            content.complete = data.endswith(MCAP0_MAGIC) and end == len(data) - len(MCAP0_MAGIC)
    if content.complete:
        content.readable_bytes = len(data)
    elif not content.readable_bytes:
        raise InputError("session", name, "a recording with data; this one ends before its first chunk")
    return content


_READERS: dict[int, Any] = {
    Opcode.SCHEMA: records.Schema,
    Opcode.CHANNEL: records.Channel,
    Opcode.ATTACHMENT: records.Attachment,
    Opcode.METADATA: records.Metadata,
    Opcode.FOOTER: records.Footer,
}


def whole_records(data: bytes, name: str) -> Iterator[tuple[records.McapRecord, int]]:
    """The schemas, channels, messages, attachments, metadata and footer that lie whole in ``data``, chunks opened, each
    with the byte behind its piece. A chunk that was cut gives the messages before the cut, unless it is compressed.
    """
    if data[: len(MCAP0_MAGIC)] != MCAP0_MAGIC:
        if MCAP0_MAGIC.startswith(data):
            raise InputError("session", name, "a recording with data; this one is empty")
        raise InputError("session", name, "an MCAP file")
    for opcode, begin, end in _frames(data, len(MCAP0_MAGIC)):
        try:
            yield from _records_of(opcode, data, begin, end)
        except CRCValidationError:
            raise _damaged(name, begin, "a checksum differs") from None
        except Exception as error:  # the library lets through whatever damaged bytes lead to
            raise _damaged(name, begin, str(error) or type(error).__name__) from None
        if opcode == Opcode.FOOTER:
            return


def _records_of(opcode: int, data: bytes, begin: int, end: int) -> Iterator[tuple[records.McapRecord, int]]:
    """The records of one piece of a file, each with the byte behind it; a chunk holds several."""
    whole = end <= len(data)
    if opcode == Opcode.CHUNK:
        inner = _chunk_content(data[begin:end]) if whole else _cut_chunk_content(data[begin:])
        pieces = _frames(inner, 0)
    else:
        inner, pieces = data, iter([(opcode, begin, end)])
    for piece_opcode, first, behind in pieces:
        if behind > len(inner):
            if whole:
                raise ValueError("a piece that reaches beyond its chunk")
            return
        record = _read(piece_opcode, inner, first, behind)
        if record is not None:
            yield record, end if whole else begin


def _frames(data: bytes, at: int) -> Iterator[tuple[int, int, int]]:
    """Opcode, begin and end of the content of each record from byte ``at`` on; the last end may lie beyond the data."""
    while at + RECORD_HEAD.size <= len(data):
        opcode, length = RECORD_HEAD.unpack_from(data, at)
        begin = at + RECORD_HEAD.size
        at = begin + length
        yield opcode, begin, at


def _read(opcode: int, data: bytes, begin: int, end: int) -> records.McapRecord | None:
    if opcode == Opcode.MESSAGE:
        # By hand: a session holds a million of them.
        channel_id, sequence, log_time, publish_time = MESSAGE_FIELDS.unpack_from(data, begin)
        return records.Message(channel_id, log_time, data[begin + MESSAGE_FIELDS.size : end], publish_time, sequence)
    reader = _READERS.get(opcode)
    return None if reader is None else reader.read(ReadDataStream(io.BytesIO(data[begin:end])))


def _chunk_content(data: bytes) -> bytes:
    chunk = records.Chunk.read(ReadDataStream(io.BytesIO(data)))
    stream, length = get_chunk_data_stream(chunk, validate_crc=True)
    return stream.read(length)


def _cut_chunk_content(data: bytes) -> bytes:
    if len(data) < _CHUNK_HEAD.size + 8:
        return b""
    *_, compression_length = _CHUNK_HEAD.unpack_from(data)
    return b"" if compression_length else data[_CHUNK_HEAD.size + 8 :]


def _damaged(name: str, at: int, reason: str) -> InputError:
    return InputError("session", name, f"an undamaged recording ({reason} in the piece at byte {at})")


def repair_mcap(data: bytes, repaired: Path, name: str) -> None:
    """Write a finished file with all that is whole in ``data``; raises InputError where that can't be."""
    schemas: dict[int, int] = {0: 0}
    channels: dict[int, int] = {}
    topics: dict[str, int] = {}
    try:
        with open(repaired, "wb") as stream:
            writer = Writer(stream, compression=CompressionType.ZSTD)
            writer.start(profile=ROS_PROFILE)
            for record, _ in whole_records(data, name):
                if isinstance(record, records.Schema) and record.id not in schemas:
                    schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
                elif isinstance(record, records.Channel) and record.id not in channels:
                    if record.topic not in topics:
                        topics[record.topic] = writer.register_channel(
                            record.topic, record.message_encoding, schemas[record.schema_id], record.metadata
                        )
                    channels[record.id] = topics[record.topic]
                elif isinstance(record, records.Message):
                    writer.add_message(
                        channels[record.channel_id], record.log_time, record.data, record.publish_time, record.sequence
                    )
                elif isinstance(record, records.Attachment):
                    writer.add_attachment(
                        record.create_time, record.log_time, record.name, record.media_type, record.data
                    )
                elif isinstance(record, records.Metadata):
                    writer.add_metadata(record.name, record.metadata)
            writer.finish()
    except KeyError:
        raise InputError("--repair", name, "a recording whose channels are declared before their messages") from None
    except OSError as error:
        raise InputError("--repair", str(repaired), f"a file that can be written ({error.strerror})") from None


def decompressed(data: bytes) -> bytes:
    """What zstd compressed; raises ValueError. The end may be missing: what lies before it comes."""
    try:
        return zstandard.ZstdDecompressor().decompressobj().decompress(data)
    except zstandard.ZstdError as error:
        raise ValueError(str(error)) from None
