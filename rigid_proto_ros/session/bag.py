# SPDX-License-Identifier: MIT
"""Bags: MCAP files read as far as they are whole, what is whole of a damaged one written anew, and what ``ros2 bag
record`` writes: a folder with metadata.yaml, or a bare .mcap, whole or split, compressed or not.
"""

from __future__ import annotations

import io
import re
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import zstandard
from mcap import records
from mcap.opcode import Opcode
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC, Writer

from ..base.errors import InputError
from ..scene.yaml_text import load_plain_yaml, read_text

ROS_PROFILE = "ros2"

METADATA = "metadata.yaml"

_PART = re.compile(r"_(\d+)\.mcap(\.zstd)?\Z")
"""How rosbag2 ends the names of a bag's files."""

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"

_RECORD_HEAD = struct.Struct("<BQ")
_CHUNK_HEAD = struct.Struct("<QQQII")
"""Before the compression's name and the content's length: times, size, checksum, and the length of that name."""


@dataclass
class BagContent:
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


def read_mcap(data: bytes, name: str, wanted: Callable[[str], bool] = lambda _: True) -> BagContent:
    """Everything whole in an MCAP file's bytes, of the topics that are ``wanted(topic)``; ``name`` stands in errors.

    A file cut anywhere, or never finished, is read up to the cut. Raises InputError for bytes that are no MCAP file,
    hold nothing whole, or were damaged inside.
    """
    content = BagContent(file_bytes=len(data))
    schemas: dict[int, str] = {}
    topics: dict[int, str] = {}
    for record, end in whole_records(data, name):
        content.readable_bytes = end
        if isinstance(record, records.Message):
            if record.channel_id not in topics:
                raise InputError(name, f"the message at byte {end} is of an unknown channel; the file is damaged")
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
        elif isinstance(record, records.Footer):
            content.complete = data.endswith(MCAP0_MAGIC) and end == len(data) - len(MCAP0_MAGIC)
    if content.complete:
        content.readable_bytes = len(data)
    elif not (content.types or content.attachments or content.metadata):
        raise InputError("session", name, "a recording with data; this one ends before its first chunk")
    return content


def whole_records(data: bytes, name: str) -> Iterator[tuple[records.McapRecord, int]]:
    """The records that lie whole in ``data``, chunks opened, each with the byte behind its piece. A chunk that was cut
    gives the messages before the cut, unless it is compressed. Raises InputError as ``read_mcap`` does.
    """
    if data[: len(MCAP0_MAGIC)] != MCAP0_MAGIC:
        if MCAP0_MAGIC.startswith(data):
            raise InputError("session", name, "a recording with data; this one is empty")
        raise InputError("session", name, "an MCAP file; ros2 bag convert makes one of a .db3")
    stream, end = io.BytesIO(data), len(MCAP0_MAGIC)
    try:
        for record in StreamReader(stream, validate_crcs=True).records:
            end = stream.tell()
            yield record, end
    except Exception as error:  # the library lets through whatever cut or damaged bytes lead to
        # Cut is what isn't as long as it says.
        if end + _RECORD_HEAD.size <= len(data) and end + _record_size(data, end) <= len(data):
            reason = str(error) or type(error).__name__
            raise InputError("session", name, f"an undamaged recording ({reason} behind byte {end})") from None
        for record in _records_of_cut_chunk(data[end:]):
            yield record, end


def _record_size(data: bytes, at: int) -> int:
    """Bytes of the record that begins at byte ``at``, its head included."""
    return _RECORD_HEAD.size + int(_RECORD_HEAD.unpack_from(data, at)[1])


def _records_of_cut_chunk(data: bytes) -> Iterator[records.McapRecord]:
    """The whole records of the chunk that ``data`` begins with, where it does and that isn't compressed."""
    content_at = _RECORD_HEAD.size + _CHUNK_HEAD.size + 8
    if len(data) < content_at or data[0] != Opcode.CHUNK or _CHUNK_HEAD.unpack_from(data, _RECORD_HEAD.size)[-1]:
        return
    inner, at = data[content_at:], 0
    while at + _RECORD_HEAD.size <= len(inner):
        end = at + _record_size(inner, at)
        if end > len(inner):
            return
        yield next(StreamReader(io.BytesIO(inner[at:end]), skip_magic=True).records)
        at = end


def repair_mcap(data: bytes, repaired: Path, name: str) -> None:
    """Write a finished file with all that is whole in ``data``; raises InputError where that can't be."""
    schemas: dict[int, int] = {0: 0}
    channels: dict[int, int] = {}
    topics: dict[str, int] = {}
    try:
        with open(repaired, "wb") as stream:
            writer = Writer(stream)
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


def read_bag(path: Path, wanted: Callable[[str], bool]) -> BagContent:
    """All that is whole in a bag, of the topics that are ``wanted``; raises InputError."""
    whole = BagContent(complete=True)
    for file in bag_files(path):
        part = read_mcap(bag_bytes(file), str(file), wanted)
        for topic, messages in part.messages.items():
            plain = [(log_time, _plain(data, topic)) for log_time, data in messages]
            whole.messages.setdefault(topic, []).extend(plain)
        whole.types |= part.types
        whole.attachments += part.attachments
        whole.metadata |= part.metadata
        whole.complete &= part.complete
        whole.readable_bytes += part.readable_bytes
        whole.file_bytes += part.file_bytes
    return whole


def bag_files(path: Path) -> list[Path]:
    """The files of a bag in their order; raises InputError."""
    if not path.is_dir():
        return [path]
    names = _listed(path / METADATA)
    if names:
        # Compressing a file renames it, and a crash comes between.
        found = [next((f for f in (path / n, path / f"{n}.zstd") if f.is_file()), path / n) for n in names]
    else:
        # metadata.yaml is written at the end: a bag whose recorder was killed has none.
        found = [f for f in path.iterdir() if ".mcap" in f.suffixes]
        numbers = {f: _PART.search(f.name) for f in found}
        if len({f.name[: number.start()] if number else f.name for f, number in numbers.items()}) > 1:
            names = ", ".join(sorted(f.name for f in found))
            raise InputError("session", f"{path} has several recordings, {names}; name one of them")
        found.sort(key=lambda f: int(number[1]) if (number := numbers[f]) else 0)
    if not found:
        raise InputError("session", str(path), "a folder that ros2 bag record wrote, with .mcap files in it")
    return found


def bag_bytes(file: Path) -> bytes:
    """A file's bytes, decompressed where the whole file was compressed; raises InputError."""
    try:
        data = file.read_bytes()
    except OSError as error:
        raise InputError("session", str(file), f"a recording that can be read ({error.strerror})") from None
    if not data.startswith(ZSTD_MAGIC):
        return data
    try:
        return _decompressed(data)
    except ValueError as error:
        raise InputError("session", str(file), f"a file that zstd can decompress ({error})") from None


def _listed(metadata: Path) -> list[str]:
    if not metadata.is_file():
        return []
    try:
        bag = load_plain_yaml(read_text(metadata, "a YAML file"), str(metadata))["rosbag2_bagfile_information"]
        storage, names, compression = bag["storage_identifier"], bag["relative_file_paths"], bag["compression_format"]
        names = [str(name) for name in names]
    except (KeyError, TypeError):
        raise InputError(str(metadata), "not readable as the metadata that rosbag2 writes") from None
    if storage != "mcap":
        raise InputError("storage", storage, "mcap; ros2 bag convert makes one of another")
    if compression not in ("", "zstd", None):
        raise InputError("compression_format", compression, "zstd, or none")
    return names


def _plain(data: bytes, topic: str) -> bytes:
    """A message as CDR. One that was compressed begins with zstd's magic, which no CDR header has."""
    if not data.startswith(ZSTD_MAGIC):
        return data
    try:
        return _decompressed(data)
    except ValueError as error:
        raise InputError(topic, f"a message can't be decompressed by zstd ({error}); the bag is damaged") from None


def _decompressed(data: bytes) -> bytes:
    """What zstd compressed; raises ValueError. The end may be missing: what lies before it comes."""
    try:
        return zstandard.ZstdDecompressor().decompressobj().decompress(data)
    except zstandard.ZstdError as error:
        raise ValueError(str(error)) from None
