# SPDX-License-Identifier: MIT
"""What everything stands on: errors, how kernels are compiled, rotations, exact arithmetic, and where
bundled files lie.
"""
