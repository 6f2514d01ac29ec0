# SPDX-License-Identifier: MIT
"""From parameters, scene files and poke scripts to a simulation, and flights without ROS."""
