# SPDX-License-Identifier: MIT
"""Messages of a .db3 file, the sqlite3 storage of rosbag2: its tables ``topics`` and ``messages``."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

from ..base.errors import InputError
from .mcap_reading import McapContent

_MAGIC = b"SQLite format 3\0"


def is_sqlite(file: Path) -> bool:
    """Whether a file begins as an SQLite database does."""
    try:
        with open(file, "rb") as stream:
            return stream.read(len(_MAGIC)) == _MAGIC
    except OSError:
        return False


def read_sqlite(file: Path, wanted: Callable[[str], bool]) -> McapContent:
    """Messages in the order of their times, of the topics that are ``wanted(topic)``; raises InputError.

    A journal that lies beside the file is read with it; what a killed recorder hadn't committed is lost.
    """
    size = file.stat().st_size
    content = McapContent(complete=True, readable_bytes=size, file_bytes=size)
    try:
        # Read only: a journal beside it is read, and nothing is written.
        with closing(sqlite3.connect(f"{file.absolute().as_uri()}?mode=ro", uri=True)) as bag:
            topics = bag.execute("SELECT id, name, type, serialization_format FROM topics").fetchall()
            for number, name, message_type, serialization in topics:
                if serialization != "cdr":
                    raise InputError(str(file), f"messages of {name} as {serialization}; only cdr is supported")
                content.types[name] = message_type
                if wanted(name):
                    query = "SELECT timestamp, data FROM messages WHERE topic_id = ? ORDER BY timestamp, id"
                    messages = [(int(time_ns), bytes(data)) for time_ns, data in bag.execute(query, (number,))]
                    if messages:
                        content.messages[name] = messages
    except (sqlite3.Error, TypeError) as error:
        raise InputError("session", str(file), f"a bag of rosbag2's sqlite3 storage ({error})") from None
    return content
