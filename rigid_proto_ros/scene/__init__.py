# SPDX-License-Identifier: MIT
"""Scenes, scene files and poke scripts; simulations and flights made from them, without ROS."""
