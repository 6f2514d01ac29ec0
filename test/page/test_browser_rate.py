# SPDX-License-Identifier: MIT
"""How soon and how often the page draws, in software WebGL at 1280 x 720 on cores with nothing else to do."""

from __future__ import annotations

import statistics

import pytest
from page_browser import Opened, chromium

pytestmark = [pytest.mark.drawn, pytest.mark.bench]


def test_the_body_moves_soon_often_and_at_once_under_the_hand() -> None:
    with chromium() as browser:
        cold = Opened(browser)
        cold.page.wait_for_function("page.times.moving")
        first = cold.js("page.times.moving")
        cold.close()
        page = Opened(browser)
        page.page.wait_for_function("page.times.moving")
        warm = page.js("page.times.moving")
        page.page.wait_for_timeout(6000)
        rate = page.js(
            "() => { const n = page.pictures.slice(-100); return 1000 * (n.length - 1) / (n[n.length - 1] - n[0]); }"
        )
        page.pause()
        place = page.on_body(10)
        page.js("page.clock.setPaused(false)")
        page.page.mouse.move(place["x"], place["y"])
        page.page.mouse.down()
        for k in range(60):
            page.page.mouse.move(place["x"] + k, place["y"] - 10)
            page.page.wait_for_timeout(40)
        drags = page.js("page.drags")
        page.page.mouse.up()
        page.close()
    print(
        f"moving after {first:.0f} ms cold, {warm:.0f} warm; {rate:.1f} pictures/s; drag drawn after {statistics.median(drags):.0f} ms"
    )
    assert first <= 1500 and warm <= 1000
    assert rate >= 25
    assert statistics.median(drags) <= 40
