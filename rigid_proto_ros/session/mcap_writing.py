# SPDX-License-Identifier: MIT
"""MCAP files written in chunks that are whole on disk after each flush.

Records that are rare go through mcap's classes; a chunk of messages is put together by numpy, because a call per
message costs more than the simulation. Format: https://mcap.dev/spec.
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import zstandard
from mcap import records
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.writer import LIBRARY_IDENTIFIER, MCAP0_MAGIC

ROS_PROFILE = "ros2"
RECORD_HEAD = struct.Struct("<BQ")
_MESSAGE_HEAD = struct.Struct("<BQHIQQ")
MESSAGE_FIELDS = struct.Struct("<HIQQ")

COMPRESSION_LEVEL = 1
"""Doubles of a motion hardly compress; the headers between them do, at any level."""


class McapFile:
    """A file being written. Raises OSError where the disk won't take it; the caller gives up then.

    Messages go in as blocks; ``flush`` makes a chunk of them.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        # Unbuffered: what was written survives a kill -9.
        self._stream = open(path, "wb", buffering=0)  # noqa: SIM115 (closed by close)
        self._inode = path.stat().st_ino
        self._at = 0
        self._schemas: list[records.Schema] = []
        self._channels: list[records.Channel] = []
        self._chunks: list[records.ChunkIndex] = []
        self._attachments: list[records.AttachmentIndex] = []
        self._metadata: list[records.MetadataIndex] = []
        self._pending: list[bytes] = []
        self._pending_size = 0
        self._index: dict[int, list[tuple[np.ndarray, np.ndarray]]] = {}
        self._counts: dict[int, int] = {}
        self._write(MCAP0_MAGIC + _bytes(records.Header(ROS_PROFILE, LIBRARY_IDENTIFIER)))

    def add_channel(self, topic: str, message_type: str, definition: str, metadata: dict[str, str]) -> int:
        """Declare a topic and return its channel's number."""
        schema_id = next((s.id for s in self._schemas if s.name == message_type), 0)
        text = b""
        if not schema_id:
            schema_id = len(self._schemas) + 1
            self._schemas.append(
                records.Schema(id=schema_id, data=definition.encode(), encoding="ros2msg", name=message_type)
            )
            text = _bytes(self._schemas[-1])
        channel_id = len(self._channels) + 1
        self._channels.append(records.Channel(channel_id, topic, "cdr", metadata, schema_id))
        self._counts[channel_id] = 0
        self._write(text + _bytes(self._channels[-1]))
        return channel_id

    def add_attachment(self, name: str, media_type: str, data: bytes, log_time: int) -> None:
        """Put a file into this one."""
        content = _bytes(records.Attachment(0, log_time, name, media_type, data))
        self._attachments.append(
            records.AttachmentIndex(self._at, len(content), log_time, 0, len(data), name, media_type)
        )
        self._write(content)

    def add_metadata(self, name: str, values: dict[str, str]) -> None:
        """Put named texts into the file."""
        content = _bytes(records.Metadata(name, values))
        self._metadata.append(records.MetadataIndex(self._at, len(content), name))
        self._write(content)

    def add_message(self, channel_id: int, log_time: int, data: bytes) -> None:
        """Add one message to the present chunk."""
        sequence = self._counts[channel_id]
        head = _MESSAGE_HEAD.pack(
            Opcode.MESSAGE, MESSAGE_FIELDS.size + len(data), channel_id, sequence, log_time, log_time
        )
        self._add(channel_id, head + data, np.array([log_time]), np.array([self._pending_size]))

    def add_rows(self, channel_id: int, log_times: np.ndarray, messages: np.ndarray) -> None:
        """Add messages of one length: log_times (n,) [ns], messages (n, length) uint8."""
        count, length = messages.shape
        block = np.empty((count, _MESSAGE_HEAD.size + length), np.uint8)
        head = _MESSAGE_HEAD.pack(Opcode.MESSAGE, MESSAGE_FIELDS.size + length, channel_id, 0, 0, 0)
        block[:, : len(head)] = np.frombuffer(head, np.uint8)
        first = self._counts[channel_id]
        block[:, 11:15] = _as_bytes(np.arange(first, first + count, dtype="<u4"))
        block[:, 15:23] = block[:, 23:31] = _as_bytes(log_times.astype("<u8"))
        block[:, len(head) :] = messages
        self._add(channel_id, block.tobytes(), log_times, self._pending_size + block.shape[1] * np.arange(count))

    def _add(self, channel_id: int, data: bytes, log_times: np.ndarray, offsets: np.ndarray) -> None:
        self._pending.append(data)
        self._pending_size += len(data)
        self._index.setdefault(channel_id, []).append((log_times, offsets))
        self._counts[channel_id] += len(log_times)

    def flush(self) -> None:
        """Write the present chunk with its index; raises OSError also where the file is no longer at its place."""
        if self.path.stat().st_ino != self._inode:
            raise OSError(None, "another file took its place")
        if not self._pending:
            return
        data = b"".join(self._pending)
        compressed = zstandard.ZstdCompressor(level=COMPRESSION_LEVEL).compress(data)
        indices, times, offsets, at = [], [], {}, 0
        for channel_id, parts in self._index.items():
            entries = np.empty((sum(len(t) for t, _ in parts), 2), "<u8")
            entries[:, 0], entries[:, 1] = (np.concatenate(part) for part in zip(*parts, strict=True))
            times.append(entries[:, 0])
            body = struct.pack("<HI", channel_id, entries.nbytes) + entries.tobytes()
            offsets[channel_id] = at
            indices.append(RECORD_HEAD.pack(Opcode.MESSAGE_INDEX, len(body)) + body)
            at += len(indices[-1])
        begin, end = int(min(t.min() for t in times)), int(max(t.max() for t in times))
        chunk = _bytes(records.Chunk("zstd", compressed, end, begin, zlib.crc32(data), len(data)))
        behind = self._at + len(chunk)
        self._chunks.append(
            records.ChunkIndex(
                chunk_length=len(chunk),
                chunk_start_offset=self._at,
                compression="zstd",
                compressed_size=len(compressed),
                message_end_time=end,
                message_index_length=at,
                message_index_offsets={channel: behind + offset for channel, offset in offsets.items()},
                message_start_time=begin,
                uncompressed_size=len(data),
            )
        )
        self._pending, self._pending_size, self._index = [], 0, {}
        self._write(chunk + b"".join(indices))

    def close(self) -> None:
        """Write the rest, and the index that makes the file whole."""
        try:
            self.flush()
            self._write(_bytes(records.DataEnd(0)))
            self._write(self._summary())
        finally:
            self._stream.close()

    def abandon(self) -> None:
        """Let go of a file that can't be written."""
        self._stream.close()

    def _summary(self) -> bytes:
        start = self._at
        statistics = records.Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts=dict(self._counts),
            chunk_count=len(self._chunks),
            message_count=sum(self._counts.values()),
            message_end_time=max((c.message_end_time for c in self._chunks), default=0),
            message_start_time=min((c.message_start_time for c in self._chunks), default=0),
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )
        groups = (
            (Opcode.SCHEMA, self._schemas),
            (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, [statistics]),
            (Opcode.CHUNK_INDEX, self._chunks),
            (Opcode.ATTACHMENT_INDEX, self._attachments),
            (Opcode.METADATA_INDEX, self._metadata),
        )
        text, offsets = b"", b""
        for opcode, group in groups:
            part = b"".join(_bytes(record) for record in group)
            if part:
                offsets += _bytes(records.SummaryOffset(opcode, start + len(text), len(part)))
            text += part
        offset_start = start + len(text)
        text += offsets
        head = struct.pack("<BQQQ", Opcode.FOOTER, 20, start, offset_start)
        return text + _bytes(records.Footer(start, offset_start, zlib.crc32(text + head))) + MCAP0_MAGIC

    def _write(self, data: bytes) -> None:
        view = memoryview(data)
        while view:
            written = self._stream.write(view)
            self._at += written
            view = view[written:]


def _bytes(record: records.McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()


def _as_bytes(values: np.ndarray) -> np.ndarray:
    return values.view(np.uint8).reshape(len(values), values.itemsize)
