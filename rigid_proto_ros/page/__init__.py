# SPDX-License-Identifier: MIT
"""The page: its data from Python's declarations, its build to one HTML file, files with a scene, and its server."""
