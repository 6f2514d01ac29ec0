# SPDX-License-Identifier: MIT
"""Parts that overlap, lie in each other, or a surface that passes through itself: by how much, and as one solid."""

import numpy as np
import pytest
from judged_meshes import body, codes, volume
from mass_solids import box, inward, moved, sphere, together

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


def test_the_union_keeps_a_cavity_and_what_lies_in_it():
    pytest.importorskip("manifold3d")
    cavity, inside = inward(moved(box((2.0, 2.0, 2.0)), (0.5, 0.5, 0.5))), moved(box(), (0.9, 0.9, 0.9))
    crossing = together(box((4.0, 4.0, 4.0)), cavity, inside, moved(box(), (2.0, 1.0, 1.0)))
    assert volume(body(crossing)) == pytest.approx(64.0 - 8.0 + 1.0 + 0.5, rel=1e-12)


def test_without_manifold3d_the_overlap_is_told_and_the_sum_is_taken(monkeypatch):
    monkeypatch.setattr(solids, "can_unite", lambda: False)
    monkeypatch.setattr("rigid_proto_ros.mass.verdict.can_unite", lambda: False)
    two = body(together(box(), moved(box(), (0.5, 0.1, 0.2))))
    assert "[meshes]" in message(two, "overlapping_components")
    assert volume(two) == pytest.approx(2.0)


def test_a_surface_that_passes_through_itself_is_told():
    """A sphere one of whose poles is pulled through the other side, or nearly."""
    for height, crosses in ((-1.3, True), (-0.9, False)):
        vertices, triangles = sphere(20)
        vertices[-2] = 0.03, 0.02, height
        assert ("self_crossing" in codes(body((vertices, triangles)))) == crosses
    assert not body(sphere(20)).verdict.findings
