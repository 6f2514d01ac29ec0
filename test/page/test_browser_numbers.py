# SPDX-License-Identifier: MIT
"""The page's small functions, in Node."""

from page_tools import TESTS, kernels, run_node


def test_numbers_are_read_with_comma_or_point_and_as_they_are_shown() -> None:
    kernels()  # skips where no Node reads TypeScript
    assert "as they are written" in run_node(TESTS / "browser_numbers.ts")
