# SPDX-License-Identifier: MIT
"""The page's data as a file."""

from pathlib import Path

import pytest

from rigid_proto_ros.page.data import page_data


@pytest.fixture(scope="session")
def page_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What rigid_proto_ros/page/data.py writes."""
    file = tmp_path_factory.mktemp("page") / "data"
    file.write_bytes(page_data())
    return file
