# SPDX-License-Identifier: MIT
"""``rigid_body_node`` that reports on /diagnostics ten times a second: tests wait for a report of what is so now very often."""

import sys

REPORT_S = 0.1

if __name__ == "__main__":
    from rigid_proto_ros.ros import diagnostics
    from rigid_proto_ros.ros.main import main

    diagnostics.REPORT_S = REPORT_S
    sys.exit(main())
