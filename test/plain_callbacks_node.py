# SPDX-License-Identifier: MIT
"""``rigid_body_node`` with an rclpy that lacks what is private: commands come by ordinary callbacks."""

import sys

if __name__ == "__main__":
    from rigid_proto_ros.ros import arrivals
    from rigid_proto_ros.ros.main import main

    arrivals.why_not_direct = lambda _: "been changed for a test"
    sys.exit(main())
