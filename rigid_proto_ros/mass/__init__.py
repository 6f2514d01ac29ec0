# SPDX-License-Identifier: MIT
"""Mass properties: moments of a mesh, inertia models, tensors, verdict and repair, inspection, robot
files and export.
"""
