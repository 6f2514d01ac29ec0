# SPDX-License-Identifier: MIT
"""``python -m rigid_proto_ros.page``: build the page into the user's cache and print its path. With ``wheel``, also
copy it into the package, for a wheel.
"""

from __future__ import annotations

import argparse
import shutil
import sys

from ..base.errors import tell
from .bundle import CARRIED, built_page


def main() -> int:
    """Build the page; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m rigid_proto_ros.page", description="Build the page ahead.")
    parser.add_argument("target", nargs="?", choices=["wheel"])
    args = parser.parse_args()
    try:
        page = built_page()
        if args.target == "wheel":
            CARRIED.parent.mkdir(exist_ok=True)
            page = shutil.copyfile(page, CARRIED)
        print(page)
    except Exception as error:
        return tell(parser.prog, error)
    return 0


if __name__ == "__main__":
    sys.exit(main())
