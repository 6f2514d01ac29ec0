# SPDX-License-Identifier: MIT
"""Mass properties: moments of a mesh, inertia models, tensors, verdict and repair, inspection and export."""

from ..mesh import INFILL

WALL_THICKNESS = 0.001
"""[m] of the walled model's walls where none is given: two or three lines of a nozzle of 0.4 mm."""
INERTIA_MODELS = ("solid", "shell", "points", "bounding_box", "walled", "explicit")
"""How mass is distributed: models of a mesh, which ``moments`` and ``walls`` compute, and given numbers. The names are
defined here so that parameters can be read without loading any kernel; their places are the models' numbers. The last
two have records of their own.
"""
MODEL_COMS = ("model", "solid")
"""Source of a model's centre of mass: the model's own, or the solid's, so that only the tensors of two models differ.
"""

__all__ = ["INERTIA_MODELS", "INFILL", "MODEL_COMS", "WALL_THICKNESS"]
