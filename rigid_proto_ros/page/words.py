# SPDX-License-Identifier: MIT
"""What the page says where something is refused: the texts that Python makes, with places for names and numbers.

Each is made from numbers that stand in no other text; where one appears as a format writes it, ``{k:format}`` is put
instead. Formats are Python's, and ``down3``: three digits, rounded down.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from ..base.compilation import new_record
from ..base.errors import InputError, TensorError
from ..mass.properties import scale_vector
from ..mass.tensor import check_tensor
from ..mass.verdict import check_surface
from ..mass.walls import refused_walls, walls_of_parts
from ..motion.frames import Frame
from ..motion.integrators import INTEGRATORS, check_supported
from ..motion.loads import MISSED, NEEDS, NO_MESH, NO_MESH_NORMAL, NO_NORMAL, NO_VERTEX, unresolved
from ..scene.scenario import make_scenario
from ..simulation import refusals as rf
from ..simulation.simulation import Simulation

_NUMBERS = (1.2345678912345e22, 2.3456789123456e22, 3.4567891234567e22)
_FRAME = Frame("world", ("contact", "frameframe"))


def words() -> dict[str, Any]:
    """Texts by what they are about."""
    numbers = [np.float64(x) for x in _NUMBERS]
    return {
        "accepted": _form(InputError("{0}", "{1}", "{2}")).replace("'{1}'", "{1}"),
        "scale": _raised(lambda: scale_vector([0.0])).replace("[0.0]", "{0}"),
        "mass": _form(InputError("mass", _NUMBERS[0], "density * volume within 1e-300 .. 1e300 kg")),
        "walls": _form(refused_walls(*_NUMBERS)).replace("2.34e+22", "{1:down3}"),
        "parts": str(walls_of_parts()),
        "orientation": _form(
            InputError("initial.orientation_xyzw", "{0}", "four finite numbers x, y, z, w, not all zero")
        ).replace("'{0}'", "{0}"),
        "rate": [_refused(rf.RATE, k, numbers) for k in range(len(rf.RATES))],
        "magnitude": [_refused(rf.MAGNITUDE, k, numbers) for k in range(len(rf.MAGNITUDES))],
        "pull": _refused(rf.PULL, 0, numbers),
        "freeEnd": _refused(rf.AT_FREE_END, 0, numbers),
        "integrator": _integrator(),
        "needs": NEEDS,
        "unresolved": {
            str(code): str(unresolved(code, _FRAME, 1235)).replace(_FRAME.text, "{0}").replace("1234", "{1}")
            for code in (NO_MESH, NO_VERTEX, NO_MESH_NORMAL, NO_NORMAL, MISSED)
        },
        "tensor": _tensors(),
        "failure": _failures(),
        "surface": _surfaces(),
        "atStart": _raised(lambda: make_scenario({}).with_changes({"contacts.a": [0.0, 0.0, 0.0]})).partition(
            "accepted: "
        )[2],
    }


def _form(error: Exception | str) -> str:
    """The text with places for the numbers."""
    text = str(error)
    for k, number in enumerate(_NUMBERS):
        for spelled, how in (
            (repr(number), "r"),
            (f"{number:.9g}", ".9g"),
            (f"{number:g}", "g"),
            (f"{number:.3g}", ".3g"),
        ):
            text = text.replace(spelled, f"{{{k}:{how}}}")
    return text


def _raised(refuses: Any) -> str:
    try:
        refuses()
    except InputError as error:
        return str(error)
    raise AssertionError(refuses)


def _refused(code: int, detail: int, numbers: list[np.float64]) -> str:
    refusal = new_record(rf.REFUSAL)
    refusal.code, refusal.detail, refusal.numbers[:] = code, detail, numbers
    return _form(rf.refused_command(refusal)).replace("2.34e+22", "{1:down3}")


def _integrator() -> str:
    """Of an integrator {0} that lacks what is needed, {1}, and those that have it, {2}."""
    name, lacking = next(
        (one, other) for one in INTEGRATORS.values() for other in NEEDS if one.lacks(frozenset({other}))
    )
    able = ", ".join(other for other, of in INTEGRATORS.items() if not of.lacks(frozenset({lacking})))
    text = _raised(lambda: check_supported(name, frozenset({lacking})))
    return text.replace(repr(name.name), "{0}").replace(lacking, "{1}").replace(able, "{2}")


def _tensors() -> dict[str, str]:
    """By the rule that a tensor breaks (mass/tensor.py): {source} is what has it, {0} to {2} its moments, {3} A + B."""
    a, b, c = _NUMBERS

    def said(matrix: Any) -> str:
        return _raised(lambda: check_tensor(np.array(matrix), source="{source}"))

    unequal = _form(said(np.diag([a, b, 9.87654321e22]))).replace("9.87654321e+22", "{2:r}")
    return {
        "2": said(np.zeros((3, 3))).replace(str(np.zeros((3, 3)).tolist()), "{matrix}"),
        "3": re.sub(r"\(.*?\)", "({0:r}, {1:r}, {2:r})", said(np.diag([a, b, 1e-30 * c])), count=1),
        "4": unequal.replace(f"{a + b:.9g}", "{3:.9g}"),
        "explicit": "explicit_inertia.tensor",
        "ballast": " with ballast",
        "model": _form(TensorError("inertia_model {0}", "{1}: {2}", "{3}")),
    }


def _failures() -> list[str]:
    """Why a motion stopped {0} s after its start, and what is added for a string that pushes."""
    values = {
        "inertia_model": "explicit",
        "mesh": "",
        "integrator": "euler",
        "initial.angular_velocity": [1e99, 1e99, 0.0],
    }
    values |= {"explicit_inertia.tensor": [1.0, 0.0, 0.0, 2.0, 0.0, 3.0]}
    string = {
        "string.attached": True,
        "string.bilateral": True,
        "string.rest_length": 1.0,
        "string.target": [1.0, 0.0, 0.0],
    }
    found = []
    for added in ({}, string):
        simulation = Simulation(make_scenario({**values, **added}).setup)
        simulation.advance(10**10)
        assert simulation.failure, added
        found.append(simulation.failure)
    plain, with_string = found
    assert "after 0 s" in plain, plain
    return [plain.replace("after 0 s", "after {0:.9g} s"), with_string.removeprefix(plain)]


def _surfaces() -> dict[str, str]:
    """What is said of surfaces that bound no solid, by what is wrong with them; {0}: how many edges."""
    tetrahedron = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    turned = faces[:, [0, 2, 1]]
    mixed = np.concatenate([faces[:3], turned[3:]])

    def said(points: Any, triangles: Any, code: str) -> str:
        findings = check_surface(points, triangles).findings
        message = next(finding.message for finding in findings if finding.code == code)
        return message.partition(";")[0]

    return {
        "open": said(tetrahedron, faces[:3], "open").replace("3 boundary", "{0} boundary"),
        "inconsistent_winding": said(tetrahedron, mixed, "inconsistent_winding").replace("3 edges", "{0} edges"),
        "inward": said(tetrahedron, turned, "inward"),
        "nonfinite": said(np.where(tetrahedron == 1.0, np.inf, tetrahedron), faces, "nonfinite").replace(
            "3 of 4", "{0} of {1}"
        ),
        "no_faces": said(tetrahedron, faces[:0], "no_faces"),
        "zero_volume": said(tetrahedron, np.concatenate([faces[:1], turned[:1]]), "zero_volume"),
        "remedy": "it flies as shell, points or box with a mass; "
        "or weld and cap it: rigid_proto inspect FILE --repair says what that gives",
        "duplicate_faces": "{0} duplicate faces, which would count twice",
        "joined_corners": "{0} corners at open edges joined to others up to {1} away; volume and tensor depend on it "
        "by at most {2} %",
        "joined_corners_of_open": "{0} corners at open edges joined to others up to {1} away",
        "unchecked": "whether it passes through itself isn't judged here; rigid_proto inspect does",
        "size": said(1e70 * tetrahedron, faces, "size").replace("1e+70", "{0:.3g}"),
    }
