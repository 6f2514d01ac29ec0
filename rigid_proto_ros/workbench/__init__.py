# SPDX-License-Identifier: MIT
"""The interactive page: pull the body on a string, poke it, change it while it moves. A ROS client like any other."""
