# SPDX-License-Identifier: MIT
"""Mass properties: moments of a mesh, inertia models, tensors, verdict and repair, inspection and export."""
