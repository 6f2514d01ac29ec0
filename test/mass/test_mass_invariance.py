# SPDX-License-Identifier: MIT
"""What mass properties must keep under motion, scaling, mirroring, joining, cutting up and renumbering."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from mass_solids import circle, moved, prism, sphere

from rigid_proto_ros.mass.properties import MeshMoments
from rigid_proto_ros.mass.tensor import principal_axes

TURNED_WITH_THE_BODY = ("solid", "shell", "points")
MODELS = st.sampled_from([*TURNED_WITH_THE_BODY, "bounding_box"])
SEEDS = st.integers(0, 2**31)
lengths = st.floats(-3, 3).map(lambda e: 10.0**e)
settings.register_profile("mass", deadline=None, max_examples=12)
PROFILE = settings.get_profile("mass")


@st.composite
def bodies(draw):
    """A body at random attitude and place: twisted star prism or ellipsoid, of sides from 1e-3 to 1e3."""
    if draw(st.booleans()):
        k = draw(st.integers(3, 9))
        radii = draw(st.lists(st.floats(0.2, 2.0), min_size=k, max_size=k))
        mesh = prism(circle(k) * np.array(radii)[:, None], draw(st.floats(0.1, 4.0)), draw(st.floats(-1, 1)), 3)
    else:
        mesh = sphere(draw(st.integers(3, 9)), [draw(st.floats(0.1, 3.0)) for _ in range(3)])
    place = [draw(st.floats(-100, 100)) for _ in range(3)]
    size = draw(lengths)
    vertices, triangles = moved(mesh, place, draw(SEEDS))
    return vertices * size, triangles


def properties(mesh, model="solid", **options):
    return MeshMoments(*mesh).mass_properties(model, mass=1.0, **options)


def off(a, b):
    """(COM difference over the gyration radius, inertia difference) of two mass properties."""
    size = np.max(np.abs(b.inertia))
    return np.max(np.abs(a.center_of_mass - b.center_of_mass)) / np.sqrt(size / b.mass), np.max(
        np.abs(a.inertia - b.inertia)
    ) / size


def slack(mesh):
    """Rounding of the vertices themselves by a motion: a few ulp of the coordinates against the thinnest extent."""
    vertices = mesh[0]
    thin = np.sqrt(np.linalg.eigvalsh(np.cov(vertices.T))[0])
    return 200 * np.spacing(np.max(np.abs(vertices))) / thin + 1e-13


@given(bodies(), st.tuples(lengths, lengths, lengths), st.tuples(*[st.sampled_from([-1.0, 1.0])] * 3), MODELS)
@settings(PROFILE)
def test_scale_and_mirror_in_closed_form_equal_scaled_vertices(mesh, size, signs, model):
    scale = np.array(size) * np.array(signs)
    vertices, triangles = mesh
    turned = triangles[:, ::-1].copy() if np.prod(signs) < 0 else triangles
    scaled = (vertices * scale, turned)
    center, inertia = off(properties(mesh, model, scale=scale), properties(scaled, model))
    assert max(center, inertia) <= slack(mesh) + slack(scaled)


@given(bodies(), st.tuples(st.floats(-9, 9), st.floats(-9, 9), st.floats(-9, 9)), st.sampled_from(["solid", "shell", "points", "bounding_box"]))  # fmt: skip
@settings(PROFILE)
def test_every_computed_tensor_meets_the_triangle_inequality(mesh, exponents, model):
    scale = 10.0 ** np.array(exponents) / np.max(10.0 ** np.array(exponents))
    # C/A beyond 1e12 is refused as a line, and the body itself may be thirty times as long as it is wide.
    scale = np.maximum(scale, 1e-4)
    a, b, c = principal_axes(properties(mesh, model, scale=scale).inertia)[0]
    assert a > 0.0
    assert a + b >= c * (1.0 - 1e-14)


@given(bodies(), SEEDS, st.sampled_from(TURNED_WITH_THE_BODY))
@settings(PROFILE)
def test_the_order_of_vertices_faces_and_corners_is_of_no_matter(mesh, seed, model):
    vertices, triangles = mesh
    random = np.random.default_rng(seed)
    order = random.permutation(len(vertices))
    shuffled = np.argsort(order)[random.permutation(triangles)]
    shuffled = np.array([np.roll(corners, random.integers(3)) for corners in shuffled])
    center, inertia = off(properties((vertices[order], shuffled), model), properties(mesh, model))
    assert max(center, inertia) <= 1e-13 + 2 * np.spacing(np.max(np.abs(vertices))) / np.ptp(vertices)


@given(bodies(), st.sampled_from(["solid", "shell"]))
@settings(PROFILE)
def test_triangles_cut_in_four_change_neither_solid_nor_shell(mesh, model):
    vertices, triangles = mesh
    # Rounded, so that halves of sums are exact.
    unit = 2.0 ** np.ceil(np.log2(np.max(np.abs(vertices))) - 30)
    vertices = np.round(vertices / unit) * unit
    following = triangles[:, [1, 2, 0]]
    middles = 0.5 * (vertices[triangles] + vertices[following])
    a, b, c = triangles.T
    ab, bc, ca = len(vertices) + np.arange(triangles.size).reshape(-1, 3).T
    cut = np.concatenate([np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    fine = np.concatenate([vertices, middles.reshape(-1, 3)]), cut
    center, inertia = off(properties(fine, model), properties((vertices, triangles), model))
    assert max(center, inertia) <= 1e-13 + 4 * np.spacing(np.max(np.abs(vertices))) / np.ptp(vertices)
