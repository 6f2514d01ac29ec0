# SPDX-License-Identifier: MIT
"""Builds the exported kernels ahead: a shared library for this machine, a module for WebAssembly. Nothing imports this
folder; ``python -m rigid_proto_ros.kernels`` runs it.
"""
