# SPDX-License-Identifier: MIT
"""Messages as bytes, both ways, without ROS."""
