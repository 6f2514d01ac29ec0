# SPDX-License-Identifier: MIT
"""One body's state, loads, string and equations of motion; the integrators are in a folder of their own."""

INTEGRATOR_NAMES = (
    "auto",
    "euler",
    "midpoint",
    "semi_implicit_euler",
    "rk4",
    "lie_midpoint",
    "dop853",
    "taylor",
    "free_body",
    "free_body_strang",
)
"""For who chooses an integrator by its name, without loading any; the integrators: integrators/__init__.py."""
