# SPDX-License-Identifier: MIT
"""The browser that the tests of a module share, and the page in it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from page_browser import Opened, chromium


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as found:
        yield found


@pytest.fixture
def opened(browser: Any) -> Iterator[Opened]:
    """The first screen, paused a third of a second after it began."""
    page = Opened(browser)
    page.pause()
    page.fly(0.33)
    yield page
    page.close()
