# SPDX-License-Identifier: MIT
"""Parts that overlap, lie in each other, or a surface that passes through itself: by how much, and as one solid."""

import numpy as np
import pytest
from judged_meshes import body, codes, volume
from mass_solids import box, inward, moved, sphere, together

from rigid_proto_ros.base.rotation import matrix_from_quaternion
from rigid_proto_ros.mass.inspection import verify_moments
from rigid_proto_ros.mesh import solids


def message(made, code: str) -> str:
    return next(finding.message for finding in made.verdict.findings if finding.code == code)


@pytest.mark.parametrize(("shift", "over"), [((0.5, 0.0, 0.0), "33.3 %"), ((0.9, 0.03, 0.02), "4.99 %")])
def test_the_solid_of_parts_that_overlap_is_their_union_and_the_sum_is_told(shift, over):
    pytest.importorskip("manifold3d")
    made, once = body(together(box(), moved(box(), shift))), 2.0 - np.prod(1.0 - np.array(shift))
    assert volume(made) == pytest.approx(once, rel=1e-12)
    assert f"sum of 2 would overcount {over}" in message(made, "overlapping_components")
    assert len(made.triangles) == 24 and made.moments.moments("shell").measure == pytest.approx(12.0)
    assert max(verify_moments(made, np.ones(3)).values()) <= 1e-13


def test_an_overlap_of_roundings_size_is_no_warning():
    pytest.importorskip("manifold3d")
    made = body(together(box(cells=2), moved(box(cells=2), (1.0 - 1e-8, 0.013, 0.0271))))
    assert codes(made).get("overlapping_components", "info") == "info"


def test_a_part_that_stands_on_another_one_does_not_overlap_it_however_their_heights_are_rounded():
    """Rays begin within rounding of faces that the other part has in common; of these heights two gave an overlap."""
    for height in np.linspace(0.1, 0.9, 41):
        plate, (foot, triangles) = box((2.0, 2.0, height), 8), box((1.0, 1.0, 0.25), 6)
        foot = foot + (0.37, 0.37, 0.125)  # now from 0 up
        standing = foot + (0.0, 0.0, plate[0][:, 2].max())
        assert body(together(plate, (standing, triangles))).verdict.findings == []


def test_parts_that_overlap_and_have_an_edge_in_common_are_two():
    """The corner of one box fills that of the other: two faces are flush, and one edge is the same."""
    pytest.importorskip("manifold3d")
    post, foot = moved(box((1.0, 1.0, 4.0)), (0.5, 0.5, 2.0)), moved(box((3.0, 2.0, 4.0)), (1.5, 1.0, 2.0))
    made = body(together(post, foot))  # the post lies in the foot
    assert made.verdict.components == 2 and codes(made) == {"nested_components": "warning"}
    across = body(together(moved(box((1.0, 4.0, 1.0)), (0.5, 2.0, 0.5)), moved(box((4.0, 3.0, 1.0)), (2.0, 1.5, 0.5)),
                           moved(box((1.0, 2.0, 3.0)), (3.5, 1.0, 1.0))))  # fmt: skip
    assert across.verdict.components == 3 and volume(across) == pytest.approx(4.0 + 12.0 - 3.0 + 6.0 - 2.0)


def test_parts_that_overlap_one_whose_faces_lie_on_each_other_are_not_united():
    """A box with a cavity open at five sides: their faces there cancel, and manifold3d makes 56.8 of a union of 56."""

    def block(lower: tuple, upper: tuple) -> tuple[np.ndarray, np.ndarray]:
        return moved(box(tuple(np.subtract(upper, lower))), tuple(0.5 * np.add(upper, lower)))

    cavity = inward(block((0.0, 0.0, 0.0), (4.0, 5.0, 5.0)))
    low, high = block((0.0, 1.0, 0.0), (5.0, 5.0, 1.0)), block((1.0, 0.0, 1.0), (5.0, 5.0, 2.0))
    made = body(together(block((0.0, 0.0, 0.0), (5.0, 5.0, 5.0)), low, high, cavity))
    assert volume(made) == pytest.approx(65.0) and codes(made) == {"overlapping_components": "warning"}
    assert "counts twice" in message(made, "overlapping_components")


@pytest.mark.parametrize("seed", [194, 435, 613, 625, 1060])
def test_a_union_that_depends_on_the_order_of_its_parts_is_not_taken(seed):
    """A box with a slot through it, and a bar flush with its sides: turned so, manifold3d makes 75.8 to 81.2 of 76."""
    pytest.importorskip("manifold3d")
    block = [((0, 0, 0), (5, 5, 5)), ((0, 2, 0), (1, 5, 1)), ((0, 1, 0), (5, 3, 5))]
    outer, bar, slot = (solids.box_surface(np.array(corners, float)) for corners in block)
    vertices, triangles = together(outer, bar, inward(slot))
    quaternion = np.random.default_rng(seed).standard_normal(4)
    turned = vertices @ matrix_from_quaternion(quaternion / np.linalg.norm(quaternion)).T + (0.1, 0.2, 0.3)
    made = body((turned, triangles))
    assert "overlapping_components" in codes(made)
    assert not made.verdict.united or volume(made) == pytest.approx(76.0)


def test_a_face_that_two_overlapping_parts_have_in_common_is_a_warning():
    long, short = moved(box((3.0, 1.0, 1.0)), (1.5, 0.0, 0.0)), moved(box(), (0.5, 0.0, 0.0))
    made = body(together(long, short))
    assert volume(made) == 4.0 and codes(made)["duplicate_faces"] == "warning"
    assert "counts twice" in message(made, "duplicate_faces")
    beside = body(together(long, moved(box(), (-0.5, 0.0, 0.0))))  # its face there looks the other way
    assert beside.verdict.findings == []


def test_a_cavity_that_reaches_out_of_its_part_is_not_just_told_to_be_turned():
    out = body(assembly((1, CUBE, (0, 0, 0)), (-1, UNIT, (2.0, 0.1, 0.2))))
    assert not out.verdict.closed and "cut that out" in message(out, "component_inward")
    apart = body(assembly((1, CUBE, (0, 0, 0)), (-1, UNIT, (4.0, 0.1, 0.2))))
    assert message(apart, "component_inward").endswith("turns them")


def test_the_union_keeps_a_cavity_and_what_lies_in_it():
    pytest.importorskip("manifold3d")
    cavity, inside = inward(moved(box((2.0, 2.0, 2.0)), (0.5, 0.5, 0.5))), moved(box(), (0.9, 0.9, 0.9))
    crossing = together(box((4.0, 4.0, 4.0)), cavity, inside, moved(box(), (2.0, 1.0, 1.0)))
    assert volume(body(crossing)) == pytest.approx(64.0 - 8.0 + 1.0 + 0.5, rel=1e-12)


CUBE, HOLE, UNIT = (4.0, 4.0, 4.0), (2.0, 2.0, 2.0), (1.0, 1.0, 1.0)


def assembly(*parts) -> tuple[np.ndarray, np.ndarray]:
    """Boxes of (sign, sides, centre), those of sign -1 wound inward, as one mesh."""
    return together(*(at if sign > 0 else inward(at) for sign, sides, c in parts for at in [moved(box(sides), c)]))


def boxes_moments(*boxes) -> tuple[float, np.ndarray, np.ndarray]:
    """Volume, centroid and tensor at unit density about it of boxes of (sign, sides, centre), added with that sign."""
    volumes = np.array([sign * np.prod(sides) for sign, sides, _ in boxes])
    sides, centres = (np.array([part[k] for part in boxes]) for k in (1, 2))
    centroid = volumes @ centres / volumes.sum()
    arms = centres - centroid
    second = (arms.T * volumes) @ arms + np.diag(volumes @ sides**2 / 12.0)
    return float(volumes.sum()), centroid, np.trace(second) * np.eye(3) - second


HOLLOW = (1, CUBE, (0, 0, 0)), (-1, HOLE, (0, 0, 0))
TWO_HOLES = (1, CUBE, (0, 0, 0)), (-1, UNIT, (0, 0, 0)), (-1, UNIT, (0.5, 0, 0))
SHARED = (1, (0.5, 1.0, 1.0), (0.25, 0, 0))
KNOB, KNOB_OUTSIDE = (1, (2.0, 1.0, 1.0), (2.5, 0, 0)), (1, (1.5, 1.0, 1.0), (2.75, 0, 0))
PIN, PIN_HOLE = (1, (3.0, 1.0, 1.0), (0, 0, 0)), (-1, (2.5, 0.5, 0.5), (0, 0, 0))
LIDDED = (1, HOLE, (0, 0, 0)), (-1, UNIT, (0.2, 0.1, 0.0)), (1, HOLE, (1.5, 0, 0))
ISLAND = (1, HOLE, (0, 0, 0)), (-1, UNIT, (0.3, 0, 0))
UNIONS = {
    "cavities that overlap": (TWO_HOLES, (*TWO_HOLES, SHARED), "would undercount 0.8 %"),
    "cavities and parts that overlap by the same": (
        (*TWO_HOLES, KNOB),
        (*TWO_HOLES, SHARED, KNOB_OUTSIDE),
        "sum of 64 would overcount 0.781 % and undercount 0.781 %",
    ),
    "a rod that ends in a cavity": (
        (*HOLLOW, (1, (4.0, 0.5, 0.5), (2, 0, 0))),
        (*HOLLOW, (1, (1.0, 0.5, 0.5), (0.5, 0, 0)), (1, (2.0, 0.5, 0.5), (3, 0, 0))),
        "would overcount 0.441 %",
    ),
    "a part that fills some of another one's cavity": (
        LIDDED,
        (LIDDED[0], (-1, (0.8, 1.0, 1.0), (0.1, 0.1, 0)), (1, (1.5, 2.0, 2.0), (1.75, 0, 0))),
        "would overcount 13.6 %",
    ),
    "a pin from wall to wall of a cavity": ((*HOLLOW, PIN), (*HOLLOW, (1, (2.0, 1.0, 1.0), (0, 0, 0))), "1.72 %"),
    "a hollow pin from wall to wall": (
        (*HOLLOW, PIN, PIN_HOLE),
        (*HOLLOW, (1, (2.0, 1.0, 1.0), (0, 0, 0)), (-1, (2.0, 0.5, 0.5), (0, 0, 0))),
        "1.52 %",
    ),
    "a part in another one that a third one enters": (
        (HOLLOW[0], (1, UNIT, (0, 0, 0)), KNOB),
        (HOLLOW[0], KNOB_OUTSIDE),
        "sum of 67 would overcount 2.29 %",
    ),
    "a hollow island in a cavity, and a knob": (
        (HOLLOW[0], (-1, (3.0, 3.0, 3.0), (0, 0, 0)), *ISLAND, KNOB),
        (HOLLOW[0], (-1, (3.0, 3.0, 3.0), (0, 0, 0)), *ISLAND, KNOB_OUTSIDE),
        "1.1 %",
    ),
}


@pytest.mark.parametrize("name", UNIONS)
def test_each_cavity_is_cut_out_of_its_own_part_and_what_enters_it_stays(name):
    pytest.importorskip("manifold3d")
    parts, union, told = UNIONS[name]
    expected, surface = boxes_moments(*union), assembly(*parts)
    for made in (body(surface), body(surface, repair=True)):
        assert told in message(made, "overlapping_components")
        assert set(codes(made)) <= {"overlapping_components", "cavities"}  # nothing counts twice, nothing was turned
        unit = made.moments.mass_properties(density=1.0)
        assert unit.mass == pytest.approx(expected[0], rel=1e-13)
        assert unit.center_of_mass == pytest.approx(expected[1], abs=1e-13)
        assert unit.inertia == pytest.approx(expected[2], rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("parts", [(KNOB, HOLLOW[0]), (*HOLLOW, PIN)])
def test_parts_that_overlap_have_the_same_union_if_all_are_wound_inward(parts):
    pytest.importorskip("manifold3d")
    made = body(inward(assembly(*parts)))
    assert codes(made)["inward"] == "warning"
    assert volume(made) == pytest.approx(volume(body(assembly(*parts))), rel=1e-13)


def test_repair_makes_no_cavity_of_a_part_that_crosses_others():
    """A lid's missing face is capped; the pin in the cavity stays a part, with manifold3d or without."""
    vertices, triangles = assembly(*HOLLOW, PIN)
    for broken in (triangles[:-1], np.vstack([triangles, triangles[:1]])):
        repaired = body((vertices, broken), repair=True)
        assert "turned" not in message(repaired, "repaired")
        assert np.array_equal(np.sort(repaired.triangles, axis=None), np.sort(triangles, axis=None))


def test_without_manifold3d_sums_are_taken_and_told_and_only_parts_that_cross_none_may_be_turned(monkeypatch):
    monkeypatch.setattr(solids, "can_unite", lambda: False)
    monkeypatch.setattr("rigid_proto_ros.mass.verdict.can_unite", lambda: False)
    two = body(together(box(), moved(box(), (0.5, 0.1, 0.2))))
    assert "[meshes]" in message(two, "overlapping_components") and volume(two) == pytest.approx(2.0)
    inner = body(assembly(HOLLOW[0], (1, UNIT, (0, 0, 0)), KNOB))
    assert "--repair" in message(inner, "nested_components") and volume(inner) == pytest.approx(67.0)
    for made in (body(assembly(*HOLLOW, PIN)), body(assembly(*HOLLOW, PIN), repair=True)):
        assert message(made, "nested_components").endswith("what they share counts twice")
        assert volume(made) == pytest.approx(59.0)


def test_a_surface_that_passes_through_itself_is_told():
    """A sphere one of whose poles is pulled through the other side, or nearly."""
    for height, crosses in ((-1.3, True), (-0.9, False)):
        vertices, triangles = sphere(20)
        vertices[-2] = 0.03, 0.02, height
        assert ("self_crossing" in codes(body((vertices, triangles)))) == crosses
    assert not body(sphere(20)).verdict.findings
