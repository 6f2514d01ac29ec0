# SPDX-License-Identifier: MIT
"""One picture of a flight: what is seen of a state and of what acts on it, as meshes, arrows, lines, points and labels.

A backend draws them, here none: Rerun, the page and the files for other tools have theirs.
"""
