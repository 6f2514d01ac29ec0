# SPDX-License-Identifier: MIT
"""One body's state, loads, string and equations of motion; the integrators are in a folder of their own."""

INTEGRATOR_FILES = {
    "auto": "auto",
    "euler": "gram_schmidt",
    "midpoint": "gram_schmidt",
    "semi_implicit_euler": "runge_kutta",
    "rk4": "runge_kutta",
    "lie_midpoint": "lie_midpoint",
    "dop853": "runge_kutta",
    "taylor": "series",
    "free_body": "free_body",
    "free_body_strang": "free_body",
}
"""Integrators by name, and the file of ``integrators/`` in which each stands under its name in capitals: for who
chooses one by its name, without loading any.
"""
