# SPDX-License-Identifier: MIT
"""The page's own pictures, drawn anew in headless Chromium: ``PYTHONPATH=test:test/page python tools/page_pictures.py
docs`` writes workbench.png and true_against_box.png there.

Simulated time goes on by as much as a picture shows, however long the browser takes for it.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from live_rig import beside
from page_browser import Opened, chromium

from rigid_proto_ros.scene.scene_file import scene_file, scene_values

SIZE = (1400, 800)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    args = parser.parse_args()
    args.folder.mkdir(parents=True, exist_ok=True)
    with chromium() as browser:
        page = Opened(browser, SIZE)
        page.pause()
        assert page.js("page.motion.openScene('true_or_box_tensor')") is None
        page.js("page.motion.setGhost({ inertia_model: 'bounding_box' })")
        page.js("page.picture.restart(page.motion.snapshot())")
        page.fly(1.0)
        page.drawn(40)
        page.look(args.folder / "true_against_box.png")
        page.close()
        with beside(scene_values(scene_file("t_handle"))) as flown:
            page = Opened(browser, SIZE, address=flown.page.address, bypass_csp=True)
            page.drawn(20)
            flown.live.pause(True)  # what is aimed at stays there
            page.drawn(4)
            place = page.on_body(40)
            page.page.mouse.move(place["x"], place["y"])
            page.page.mouse.down()
            for k in range(1, 13):
                page.page.mouse.move(place["x"] - 14 * k, place["y"] - 9 * k)
                page.drawn(1)
            page.page.wait_for_function("page.motion.snapshot().body.string?.tension > 0")
            page.look(args.folder / "workbench.png")
            page.page.mouse.up()
            time.sleep(0.2)
            page.close()


if __name__ == "__main__":
    main()
