# SPDX-License-Identifier: MIT
"""The interactive page: an observer of a simulation in its own process, and the hands of its user."""
