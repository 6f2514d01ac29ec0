# SPDX-License-Identifier: MIT
"""Mass properties from recorded motion, with what the motion can tell said before any number."""
