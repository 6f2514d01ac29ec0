# SPDX-License-Identifier: MIT
"""What can be set: every parameter with its type, default, unit and bounds."""
