# SPDX-License-Identifier: MIT
"""Motion as other tools read it: tables, glTF, USD.

The libraries that write them are imported where they are used.
"""
