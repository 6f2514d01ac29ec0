# SPDX-License-Identifier: MIT
"""The page where there is no WebGL."""

from __future__ import annotations

import numpy as np
import pytest
from page_browser import NO_WEBGL, Opened, chromium

pytestmark = pytest.mark.drawn


def test_without_webgl_it_says_so_and_draws_on_a_plain_canvas() -> None:
    with chromium(NO_WEBGL) as browser:
        page = Opened(browser)
        page.faults.clear()  # three.js says on the console that there is no WebGL
        assert "no WebGL" in page.page.locator("#say").inner_text()
        page.pause()
        page.fly(0.4)
        before = page.look()
        page.fly(0.3)
        assert (np.abs(page.look() - before).max(axis=2) > 40).sum() > 1000
        page.close()
