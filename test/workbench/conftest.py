# SPDX-License-Identifier: MIT
"""A page without a browser, which the tests of a file share."""

from __future__ import annotations

from collections.abc import Iterator

import pytest


@pytest.fixture(scope="module")
def shared_page() -> Iterator:
    """The page that the file's tests have in common; they use ``flown``."""
    from flown_page import FlownPage, without_waiting

    with without_waiting():
        page = FlownPage()
        yield page
        page.end()


@pytest.fixture
def flown(shared_page):
    """The file's page at the beginning of its first lesson."""
    shared_page.start_over()
    return shared_page
