# SPDX-License-Identifier: MIT
"""Bags of ``ros2 bag record``: a folder with metadata.yaml, or a bare .mcap, whole or split, compressed or not."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import zstandard

from ..base.errors import InputError
from ..scene.yaml_text import load_plain_yaml, read_text
from .mcap_reading import BagContent, read_mcap, repair_mcap

__all__ = ["bag_bytes", "bag_files", "read_bag", "repair_mcap"]

METADATA = "metadata.yaml"

_PART = re.compile(r"_(\d+)\.mcap(\.zstd)?\Z")
"""How rosbag2 ends the names of a bag's files."""

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"


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
