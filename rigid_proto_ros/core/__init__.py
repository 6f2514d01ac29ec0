# SPDX-License-Identifier: MIT
"""Mass properties, loads, integrators and stepping: numpy and numba alone, no files, no ROS, no viewer."""
