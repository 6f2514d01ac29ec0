# SPDX-License-Identifier: MIT
"""The picture of a flight: its states and loads as meshes, arrows, lines, points and labels, independent of a renderer.

Backends that draw it are elsewhere: for Rerun and for files of other tools. The page draws the same parts itself.
"""
