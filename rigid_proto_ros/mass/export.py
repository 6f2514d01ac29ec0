# SPDX-License-Identifier: MIT
"""Mass properties as text to paste: URDF, SDF and MJCF inertials, every number with 17 digits.

The link's frame is that of the mesh file: its origin and axes.
"""

from __future__ import annotations

from collections.abc import Iterable

from ..base.rotation import quaternion_from_matrix
from .properties import MassProperties
from .tensor import SIX, principal_axes, six_from_tensor


def _number(value: float) -> str:
    return f"{value + 0.0:.17g}"


def _numbers(values: Iterable[float]) -> str:
    return " ".join(_number(float(value)) for value in values)


def urdf_inertial(properties: MassProperties) -> str:
    """A URDF <inertial> element; the tensor is about the COM in the link's axes."""
    six = zip(SIX, six_from_tensor(properties.inertia), strict=True)
    entries = " ".join(f'{name}="{_number(value)}"' for name, value in six)
    return (
        "<inertial>\n"
        f'  <origin xyz="{_numbers(properties.center_of_mass)}" rpy="0 0 0"/>\n'
        f'  <mass value="{_number(properties.mass)}"/>\n'
        f"  <inertia {entries}/>\n"
        "</inertial>\n"
    )


def sdf_inertial(properties: MassProperties) -> str:
    """An SDF <inertial> element; the tensor is about the COM in the link's axes."""
    six = zip(SIX, six_from_tensor(properties.inertia), strict=True)
    entries = "".join(f"    <{name}>{_number(value)}</{name}>\n" for name, value in six)
    return (
        "<inertial>\n"
        f"  <pose>{_numbers(properties.center_of_mass)} 0 0 0</pose>\n"
        f"  <mass>{_number(properties.mass)}</mass>\n"
        f"  <inertia>\n{entries}  </inertia>\n"
        "</inertial>\n"
    )


def mjcf_inertial(properties: MassProperties) -> str:
    """An MJCF <inertial> element: principal moments and their axes' quaternion.

    MuJoCo computes the eigenvalues of a full tensor itself; for a flat body their rounding may violate A + B ≥ C, which
    it refuses.
    """
    (a, b, c), axes = principal_axes(properties.inertia)
    x, y, z, w = quaternion_from_matrix(axes).tolist()
    place = f'pos="{_numbers(properties.center_of_mass)}" quat="{_numbers((w, x, y, z))}"'
    mass = f'mass="{_number(properties.mass)}"'
    return f'<inertial {place} {mass} diaginertia="{_numbers((a, b, min(c, a + b)))}"/>\n'
