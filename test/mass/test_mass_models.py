# SPDX-License-Identifier: MIT
"""Inertia models, scale, density, mass and ballast: all closed form on ten numbers."""

from fractions import Fraction

import numpy as np
import pytest
from mass_solids import box, circle, moved, prism

from rigid_proto_ros.base.errors import InputError, MeshError, TensorError
from rigid_proto_ros.mass.moments import MODELS, mesh_moments
from rigid_proto_ros.mass.properties import MeshMoments
from rigid_proto_ros.scene.scenario import make_scenario

COMPUTED = ("solid", "shell", "points", "bounding_box")


@pytest.fixture(scope="module")
def lopsided():
    return moved(prism(circle(5) * [1.0, 0.6], 1.5, twist=0.8, layers=6), (0.4, -0.7, 0.2), 21)


@pytest.mark.parametrize("model", COMPUTED)
def test_all_models_carry_the_same_mass(lopsided, model):
    moments = MeshMoments(*lopsided)
    solid = moments.mass_properties("solid", density=321.0)
    assert moments.mass_properties(model, density=321.0).mass == solid.mass
    assert moments.mass_properties(model, mass=4.5, density=321.0).mass == 4.5


def test_points_are_equal_masses_at_referenced_vertices_alone(lopsided):
    vertices, triangles = lopsided
    stray = np.vstack([vertices, [[50.0, 60.0, 70.0]]])
    properties = MeshMoments(stray, triangles).mass_properties("points", mass=2.0)
    center = vertices.mean(axis=0)
    offset = vertices - center
    each = 2.0 / len(vertices)
    expected = each * (np.sum(offset**2) * np.eye(3) - offset.T @ offset)
    assert properties.center_of_mass == pytest.approx(center, rel=1e-13)
    assert properties.inertia == pytest.approx(expected, rel=1e-12, abs=1e-13)
    assert mesh_moments("points", stray, triangles).measure == len(vertices)


def test_shell_of_a_box_is_the_sum_of_its_six_plates():
    a, b, c = 1.0, 2.0, 3.0
    plates = 2 * np.array([b * c, a * c, a * b])
    mass = plates / plates.sum()
    ixx = mass[0] * (b * b + c * c) / 12 + mass[1] * (c * c / 12 + b * b / 4) + mass[2] * (b * b / 12 + c * c / 4)
    properties = MeshMoments(*box((a, b, c), 2)).mass_properties("shell", mass=1.0)
    assert properties.inertia[0, 0] == pytest.approx(ixx, rel=1e-14)


@pytest.mark.parametrize("seed", range(60))
def test_a_stretched_shell_is_about_a_vertex_and_put_back_with_one_rounding_and_its_rest(seed):
    """Both as rational arithmetic has them, to the bit: reference r + b s, and what it lacks, of sizes far apart, too."""
    random = np.random.default_rng(seed)
    size, shift = 10.0 ** random.uniform(-8, 8, 2)
    vertices = size * random.normal(size=(9, 3)) + shift * random.normal(size=3)
    triangles = random.permutation(random.integers(0, 9, (12, 3)))
    scale = random.choice([1.0, -1.0], 3) * 10.0 ** random.uniform(-9, 9, 3)
    stretch = np.abs(scale) / abs(scale[0])
    base = vertices[triangles[0, 0]]
    about = mesh_moments("shell", (vertices - base) * stretch, triangles)
    exact = [Fraction(r) + Fraction(b) * Fraction(s) for r, b, s in zip(about.reference, base, stretch, strict=True)]
    rest = [float(place - Fraction(float(place))) for place in exact]
    found = mesh_moments("shell", vertices, triangles, scale=scale)
    assert found.reference.tolist() == [float(place) for place in exact]
    assert found.center_low.tolist() == (about.center_low + rest).tolist()
    assert found.measure == about.measure
    assert found.center.tolist() == about.center.tolist() and found.second.tolist() == about.second.tolist()


REASONS = {
    "there are no faces": (np.eye(3), np.empty((0, 3))),
    "a face uses a vertex outside 0 to 2": (np.eye(3), [[0, 1, 3]]),
    "a vertex coordinate is not finite": (np.diag([1.0, np.nan, 1.0]), [[0, 1, 2]]),
    "all vertices lie in one point": (np.ones((3, 3)), [[0, 1, 2]]),
    "the surface encloses no volume": (np.eye(3), [[0, 1, 2], [0, 2, 1]]),
    "the surface has no area": (np.diag([1.0, 0.0, 0.0]), [[0, 1, 2]]),
}


@pytest.mark.parametrize("reason", REASONS)
def test_a_mesh_without_the_moments_of_a_model_says_why(reason):
    vertices, triangles = REASONS[reason]
    models = {"all vertices lie in one point": MODELS[:3], "the surface encloses no volume": MODELS[:1]}
    models["the surface has no area"] = MODELS[1:2]
    for model in models.get(reason, MODELS):
        with pytest.raises(MeshError, match=reason):
            mesh_moments(model, vertices, np.array(triangles, dtype=np.int64))


def test_a_stretched_shell_far_from_the_origin_keeps_its_digits(lopsided):
    """Its tensor was off by 5e-11 here, and by 3e-6 for a thinner one."""
    vertices, triangles = np.round(lopsided[0] * 2**20) / 2**20, lopsided[1]
    shift, scale = np.array([1e6, -3e5, 2e6]), np.array([0.13, -0.0037, 7.1])
    near, far = (
        MeshMoments(vertices + moved, triangles).mass_properties("shell", mass=2.0, scale=scale)
        for moved in (np.zeros(3), shift)
    )
    assert far.inertia == pytest.approx(near.inertia, rel=1e-13, abs=1e-13 * np.abs(near.inertia).max())
    error = np.abs(far.center_of_mass - (near.center_of_mass + shift * scale))
    assert np.all(
        error <= 1e-13 * np.linalg.norm(np.ptp(vertices * scale, axis=0)) + 2 * np.spacing(np.abs(shift * scale))
    )


def test_ballast_is_point_masses_added_by_the_parallel_axis_theorem(lopsided):
    moments = MeshMoments(*lopsided)
    scale = np.array([2.0, -1.0, 0.5])
    bare = moments.mass_properties(scale=scale, density=500.0)
    weights = ((0.7, 0.1, 0.2, 0.3), (1.4, -1.0, 0.0, 2.0))
    loaded = moments.mass_properties(scale=scale, density=500.0, ballast=weights)
    masses = np.array([bare.mass, 0.7, 1.4])
    places = np.array([bare.center_of_mass, scale * [0.1, 0.2, 0.3], scale * [-1.0, 0.0, 2.0]])
    center = masses @ places / masses.sum()
    inertia = bare.inertia.copy()
    for m, p in zip(masses, places - center, strict=True):
        inertia += m * (p @ p * np.eye(3) - np.outer(p, p))
    assert loaded.mass == pytest.approx(masses.sum(), rel=1e-15)
    assert loaded.center_of_mass == pytest.approx(center, rel=1e-13)
    assert loaded.inertia == pytest.approx(inertia, rel=1e-13, abs=1e-13)


def test_ballast_far_from_the_origin_keeps_its_digits(lopsided):
    vertices, triangles = np.round(lopsided[0] * 2**20) / 2**20, lopsided[1]
    near, far = (
        MeshMoments(vertices + shift, triangles).mass_properties(
            density=1.0, ballast=((1.0, shift + 0.5, shift + 0.25, shift),)
        )
        for shift in (0.0, 2.0**20)
    )
    assert far.inertia == pytest.approx(near.inertia, rel=1e-14, abs=1e-14)


def explicit(mass, center, tensor, scale, **changes):
    """The body of given numbers."""
    given = {"explicit_inertia.mass": mass, "explicit_inertia.center_of_mass": center}
    values = {"inertia_model": "explicit", "explicit_inertia.tensor": tensor, "scale": scale, **given, **changes}
    return make_scenario(values).setup.body


def test_explicit_numbers_are_final_and_move_with_the_picture():
    given = [0.2, 0.01, -0.02, 0.3, 0.03, 0.25]
    plain = explicit(3.0, [1.0, 2.0, 3.0], given, [2.0, -1.0, 1.0])
    assert plain.mass == 3.0
    assert plain.center_of_mass.tolist() == [2.0, -2.0, 3.0]
    assert plain.inertia.tolist() == [[0.2, 0.01, -0.02], [0.01, 0.3, 0.03], [-0.02, 0.03, 0.25]]
    loaded = explicit(3.0, [0.0, 0.0, 0.0], given, [1.0], **{"ballast.a": [1.0, 0.0, 0.0, 4.0]})
    assert loaded.mass == 4.0
    assert loaded.center_of_mass.tolist() == [0.0, 0.0, 1.0]
    assert loaded.inertia[0, 0] == pytest.approx(0.2 + 3.0 * 1.0 + 1.0 * 9.0)


def test_a_rescale_never_passes_over_the_mesh_again(monkeypatch, lopsided):
    moments = MeshMoments(*lopsided)
    for model in COMPUTED:
        moments.mass_properties(model)
    moments.vertices = moments.triangles = None
    for model in COMPUTED:
        for scale in (2.0, -0.5, (3.0, 3.0, -3.0)):
            assert moments.mass_properties(model, scale=scale, ballast=((1.0, 0.0, 0.0, 0.0),)).mass > 1.0


def test_refusals_name_the_field_and_what_is_accepted():
    moments = MeshMoments(*box())
    nan, inf = float("nan"), float("inf")
    wrong = {
        "scale": (0.0, (1.0, 2.0), (1.0, nan, 1.0), 1e10),
        "mass": (-1.0, nan),
        "density": (0.0, inf),
        "ballast": (((-1.0, 0.0, 0.0, 0.0),), ((1.0, nan, 0.0, 0.0),)),
    }
    for field, arguments in ((field, {field: value}) for field, values in wrong.items() for value in values):
        with pytest.raises(InputError) as refused:
            moments.mass_properties(**arguments)
        assert refused.value.field == field
    with pytest.raises(InputError, match=", ".join(MODELS)):
        moments.mass_properties("cuboid")


def test_an_open_surface_is_refused_where_a_volume_is_needed_and_only_there():
    vertices, triangles = box()
    opened = MeshMoments(vertices, triangles[:-1], no_solid="open surface: 3 boundary edges; use --repair")
    for model in COMPUTED:
        with pytest.raises(MeshError, match="--repair"):
            opened.mass_properties(model, density=1000.0)
    with pytest.raises(MeshError, match="3 boundary edges"):
        opened.mass_properties("solid", mass=1.0)
    for model in COMPUTED[1:]:
        assert opened.mass_properties(model, mass=1.0).mass == 1.0


def test_a_flat_surface_has_its_other_models():
    square = np.array([[0.0, 0, 0], [1.0, 0, 0], [1.0, 1.0, 0], [0.0, 1.0, 0]])
    flat = MeshMoments(square, np.array([[0, 1, 2], [0, 2, 3]]), no_solid="open")
    for model in COMPUTED[1:]:
        a, b, c = np.diag(flat.mass_properties(model, mass=1.0).inertia)
        assert a == pytest.approx(b, rel=1e-14) and a + b == pytest.approx(c, rel=1e-14)


def test_points_on_a_line_are_refused_by_the_models_name():
    line = np.array([[0.0, 0, 0], [1.0, 0, 0], [2.0, 0, 0]])
    with pytest.raises(TensorError, match="points"):
        MeshMoments(line, np.array([[0, 1, 2]]), no_solid="open").mass_properties("points", mass=1.0)
