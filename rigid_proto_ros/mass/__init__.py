# SPDX-License-Identifier: MIT
"""Mass properties: moments of a mesh, inertia models, tensors, verdict and repair, inspection and export."""

INERTIA_MODELS = ("solid", "shell", "points", "bounding_box", "explicit")
"""How mass is distributed: models of a mesh, which ``moments`` computes, and given numbers. The names are defined here
so that parameters can be read without loading any kernel; their places are the models' numbers, and the explicit one is
the last.
"""
MODEL_COMS = ("model", "solid")
"""Source of a model's centre of mass: the model's own, or the solid's, so that only the tensors of two models differ.
"""
