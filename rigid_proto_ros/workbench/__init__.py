# SPDX-License-Identifier: MIT
"""The interactive page: a ROS client like any other, and what it keeps of a flight."""
