# SPDX-License-Identifier: MIT
"""Robots: their files read, links judged by their shapes, inertials rewritten, a robot with held joints as one body."""
