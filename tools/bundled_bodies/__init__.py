# SPDX-License-Identifier: MIT
"""The generator of the bundled bodies; needs manifold3d: ``PYTHONPATH=tools python -m bundled_bodies [NAME ...]``."""
