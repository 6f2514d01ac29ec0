# SPDX-License-Identifier: MIT
"""Parts on the command line: one body of several materials, printed parts, and a payload on a robot's link."""

import json
from pathlib import Path

import numpy as np
import pytest
from mass_solids import box, moved
from mesh_files import obj

from rigid_proto_ros.cli.main import main
from rigid_proto_ros.mass.properties import MassProperties, MeshMoments
from rigid_proto_ros.robots.link_shapes import combined

LINK = (
    '<robot name="arm"><link name="base"/><link name="tool"><inertial><origin xyz="0 0 0.05"/><mass value="1.5"/>'
    '<inertia ixx="0.01" ixy="0.001" ixz="0" iyy="0.012" iyz="0" izz="0.005"/></inertial></link>'
    '<joint name="j" type="fixed"><parent link="base"/><child link="tool"/></joint></robot>'
)
OF_LINK = MassProperties(
    1.5, np.array([0.0, 0.0, 0.05]), np.array([[0.01, 0.001, 0.0], [0.001, 0.012, 0.0], [0.0, 0.0, 0.005]])
)
BODY, COVER = box((100.0, 40.0, 20.0)), moved(box((100.0, 40.0, 4.0)), (0.0, 0.0, 12.0))


@pytest.fixture(autouse=True)
def files(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("body.obj").write_bytes(obj(*BODY))
    Path("cover.obj").write_bytes(obj(*COVER))
    Path("arm.urdf").write_text(LINK)
    Path("whole.yaml").write_text(
        "scale: 0.001\nparts:\n  body: {mesh: body.obj, density: 2700}\n  cover: {mesh: cover.obj, mass: 0.12}\n"
    )


def inspect(capsys, *arguments: str) -> dict:
    assert main(["inspect", *arguments, "--json"]) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    return json.loads(captured.out)


def refused(capsys, *arguments: str) -> str:
    assert main(["inspect", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err.count("\n") == 1
    return captured.err


PARTS = ("body.obj=2700", "cover.obj=mass:0.12", "--scale", "0.001")


def test_parts_on_the_command_line_are_those_of_a_file(capsys) -> None:
    of_file, of_line = inspect(capsys, "whole.yaml"), inspect(capsys, *PARTS)
    for key in ("mass", "center_of_mass", "inertia", "principal_moments", "volume", "area", "parts", "bounding_box"):
        assert of_line[key] == of_file[key], key
    assert of_file["mass"] == pytest.approx(2700 * 8e-5 + 0.12, rel=1e-14)
    assert of_file["density"] == pytest.approx(0.336 / 9.6e-5, rel=1e-14)
    assert [part["name"] for part in of_file["parts"]] == ["body", "cover"]
    assert [part["density"] for part in of_file["parts"]] == pytest.approx([2700.0, 7500.0])
    assert (of_file["components"], of_file["watertight"], of_file["verdict"]) == (2, True, [])


def test_parts_that_say_nothing_have_the_density_of_all(capsys) -> None:
    found = inspect(capsys, "body.obj=2700", "cover.obj", "--scale", "0.001", "--density", "1200")
    assert [part["density"] for part in found["parts"]] == pytest.approx([2700.0, 1200.0])
    assert inspect(capsys, "body.obj", "cover.obj", "--scale", "0.001")["density"] == pytest.approx(1000.0)


def test_a_mass_of_all_scales_the_parts(capsys) -> None:
    own, heavy = inspect(capsys, "whole.yaml"), inspect(capsys, "whole.yaml", "--mass", "0.672")
    assert np.array(heavy["inertia"]) == pytest.approx(2.0 * np.array(own["inertia"]), rel=1e-14)
    assert [part["mass"] for part in heavy["parts"]] == pytest.approx([0.432, 0.24])


def test_the_same_mesh_twice_is_two_parts(capsys) -> None:
    found = inspect(capsys, "body.obj=1000", "body.obj=2000")
    assert [part["name"] for part in found["parts"]] == ["body", "body'"]
    assert found["mass"] == pytest.approx(3000.0 * 80000.0)


@pytest.mark.parametrize("output", ["--urdf", "--sdf", "--mjcf"])
def test_an_inertial_of_parts_has_their_mass(capsys, output) -> None:
    assert main(["inspect", *PARTS, output]) == 0
    captured = capsys.readouterr()
    assert "0.336" in captured.out and captured.err == ""


def test_an_engine_gets_the_sum(capsys) -> None:
    assert main(["inspect", *PARTS, "--for", "unity"]) == 0
    assert "body.mass = 0.336f;" in capsys.readouterr().out


def test_the_report_lists_parts_and_overlaps(capsys) -> None:
    Path("pin.obj").write_bytes(obj(*moved(box((10.0, 10.0, 20.0)), (0.0, 0.0, 10.0))))
    assert main(["inspect", *PARTS[:2], "pin.obj=7800", *PARTS[2:], "--verify"]) == 0
    out = capsys.readouterr().out
    assert "warning: parts body and pin overlap, by 50 % of pin" in out and "cover and pin overlap, by 20 %" in out
    assert [line.split()[0] for line in out.splitlines() if " 7800 " in line] == ["pin"]
    assert "errors against exact rational arithmetic" in out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("body.obj=heavy", "cover.obj"), "body.obj: got '=heavy'; accepted: =DENSITY in kg/m³ or =mass:KG"),
        (("body.obj=weight:1", "cover.obj"), "got '=weight:1'"),
        (("body.obj=mass:0", "cover.obj"), "got '=mass:0'"),
        (("body.obj=-5",), "got '=-5'"),
        (("body.obj=inf",), "got '=inf'"),
        (("none.obj=5", "cover.obj"), "no file and no bundled mesh 'none.obj'"),
        (("body.obj", "whole.yaml"), "a mesh; a file of parts has no others within"),
        (("body.obj", "cover.obj", "--scale", "0"), "scale"),
        (("body.obj", "cover.obj", "--model", "walled"), "wall_thickness of each part"),
        (("whole.yaml", "--density", "5"), "none: the file gives the densities of its parts"),
        (("body.obj", "cover.obj", "--compare", "arm.urdf"), "at most one with --compare"),
        (("arm.urdf#tool",), "one ROBOT#LINK, and the parts of its payload"),
        (("arm.urdf#tool", "arm.urdf#base", "body.obj"), "one ROBOT#LINK"),
        (("arm.urdf#tol", "body.obj"), "a link of arm.urdf: tool"),
        (("arm.urdf#tool", "body.obj", "--mass", "1"), "--mass: has no meaning beside ROBOT#LINK"),
        (("body.obj", "--wall-thickness", "0.001", "--model", "shell"), "walled, with --wall-thickness"),
        (("body.obj", "--wall-thickness", "0"), "wall_thickness: got 0.0; accepted: a finite number > 0"),
        (("body.obj", "--infill", "1.5"), "infill: got 1.5; accepted: a number from 0 to 1"),
    ],
)
def test_what_no_part_can_be_is_refused_in_one_line(capsys, arguments, said) -> None:
    assert said in refused(capsys, *arguments)


def test_a_file_whose_name_has_an_equals_sign_is_that_file(capsys) -> None:
    Path("a=5.obj").write_bytes(obj(*BODY))
    assert "parts" not in inspect(capsys, "a=5.obj")
    assert inspect(capsys, "a=5.obj=7")["density"] == pytest.approx(7.0)


# A payload on a link


@pytest.mark.parametrize("payload", [PARTS, ("whole.yaml",)], ids=["parts", "file"])
def test_a_link_with_a_payload_is_their_sum_in_the_links_frame(capsys, payload) -> None:
    found = inspect(capsys, "arm.urdf#tool", *payload)
    parts = [
        MeshMoments(1e-3 * BODY[0], BODY[1]).mass_properties(density=2700.0),
        MeshMoments(1e-3 * COVER[0], COVER[1]).mass_properties(mass=0.12),
    ]
    expected = combined([OF_LINK, *parts], "whole")
    assert (found["link"], found["link_mass"]) == ("arm.urdf#tool", 1.5)
    assert found["payload_mass"] == pytest.approx(0.336)
    assert found["mass"] == pytest.approx(expected.mass, rel=1e-14)
    assert found["center_of_mass"] == pytest.approx(expected.center_of_mass, abs=1e-15)
    assert np.array(found["inertia"]) == pytest.approx(expected.inertia, abs=1e-15)


def test_a_payload_as_an_inertial_goes_into_the_robots_file(capsys, tmp_path) -> None:
    assert main(["inspect", "arm.urdf#tool", "whole.yaml", "--urdf"]) == 0
    inertial = capsys.readouterr().out
    before, _, rest = LINK.partition("<inertial>")
    Path("loaded.urdf").write_text(before + inertial + rest.partition("</inertial>")[2])
    assert main(["inspect", "--lump", "loaded.urdf", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["mass"] == pytest.approx(1.836)


# A printed part


def test_a_printed_part_has_its_mass_in_every_model_and_its_error_told(capsys) -> None:
    found = inspect(capsys, "body.obj", "--scale", "0.001", "--density", "1240", "--wall-thickness", "0.0008")
    mass = 1240.0 * (0.2 * 8e-5 + 0.8 * 0.0008 * 2.0 * (4e-3 + 2e-3 + 8e-4))
    assert found["mass"] == pytest.approx(mass, rel=1e-13)
    assert found["models"]["solid"]["mass"] == found["models"]["walled"]["mass"] == found["mass"]
    (finding,) = found["verdict"]
    assert finding["code"] == "walled" and finding["message"].endswith("whose error is 2.7 %")
    assert inspect(capsys, "body.obj", "--scale", "0.001", "--model", "walled")["mass"] > 0.0


def test_walls_too_thick_are_refused_with_the_verdict(capsys) -> None:
    assert main(["inspect", "body.obj", "--scale", "0.001", "--wall-thickness", "0.004", "--json"]) == 2
    captured = capsys.readouterr()
    assert json.loads(captured.out)["mass"] is None
    assert "wall_thickness: got 0.004; accepted: at most 0.00194 m" in captured.err
