# SPDX-License-Identifier: MIT
"""Build exported kernels ahead of time: a shared library for this machine, and a module for WebAssembly. No other
package imports this one; ``python -m rigid_proto_ros.kernels`` runs it.
"""
