# SPDX-License-Identifier: MIT
"""One body's state, loads, string and equations of motion; the integrators are in a folder of their own."""
