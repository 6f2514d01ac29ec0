# SPDX-License-Identifier: MIT
"""Mass properties from recorded motion, and which of them the motion determines, which is printed before any number."""
