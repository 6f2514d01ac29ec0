# SPDX-License-Identifier: MIT
"""Mass properties: moments of a mesh, inertia models, tensors, verdict and repair, inspection and export."""

INERTIA_MODELS = ("solid", "shell", "points", "bounding_box", "explicit")
"""How mass is spread: those of a mesh, which ``moments`` computes, and given numbers. The names stand here for who
reads parameters without loading any kernel.
"""
MODEL_COMS = ("model", "solid")
"""Where a model's centre of mass is taken from: the model's own, or the solid's, so that two tensors can be compared
alone.
"""
