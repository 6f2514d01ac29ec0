# SPDX-License-Identifier: MIT
"""The page as one HTML file: what it holds of Python's declarations, how it is built, and files made of it."""
