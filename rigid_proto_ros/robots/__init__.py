# SPDX-License-Identifier: MIT
"""Robots: read their files, judge links by their shapes, rewrite inertials, merge a robot with fixed joints into one
body.
"""
