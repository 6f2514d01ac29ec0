# SPDX-License-Identifier: MIT
"""What a file's reader may not expect is said, without effect on the numbers."""

from dataclasses import replace
from pathlib import Path

import pytest
from mesh_files import collada

from rigid_proto_ros.mass.from_mesh import mesh_body
from rigid_proto_ros.mass.inspection import inspect_mesh
from rigid_proto_ros.mesh.reading import load_mesh, read_mesh

MADE = "/rigid_proto_upload_/made.obj"


@pytest.mark.parametrize(("axis", "said"), [("", False), ("Z", False), ("Y", True), ("X", True)])
def test_an_up_axis_that_is_not_applied_is_told(axis, said):
    body = mesh_body(replace(load_mesh("hammer"), up_axis=axis, path=MADE))
    told = [one.message for one in inspect_mesh(body).findings if one.code == "unexpected"]
    assert told == (
        [f"the file says that {axis} is up, which isn't applied: axes are those of its numbers"] if said else []
    )


@pytest.mark.parametrize(("scale", "said"), [(1e-9, True), (1e-6, True), (1e-3, False), (1.0, False)])
def test_a_body_of_which_millimetres_were_scaled_twice_is_told(scale, said):
    findings = inspect_mesh(mesh_body("hammer"), scale=scale).findings
    assert any("scaled to metres twice" in one.message for one in findings) == said
    assert all(one.severity == "info" for one in findings if one.code == "unexpected")


@pytest.mark.parametrize(("said", "axis"), [("", ""), ("Y_UP", "Y"), ("Z_UP", "Z")])
def test_the_up_axis_of_a_dae_is_read(said, axis):
    pytest.importorskip("collada")
    data = collada('<node><instance_geometry url="#cube"/></node>')
    data = data.replace(b"</asset>", f"<up_axis>{said}</up_axis></asset>".encode() if said else b"</asset>")
    assert read_mesh(data, Path("/cube.dae")).up_axis == axis
