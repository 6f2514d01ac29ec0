# SPDX-License-Identifier: MIT
"""Motion for other tools: tables, glTF and USD."""
