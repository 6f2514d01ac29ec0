# SPDX-License-Identifier: MIT
"""Every step of every lesson, carried out on the page as its sentence says; what it claims is measured on the motion.

A step is one sentence. ``STEPS[lesson]`` has one function a sentence, in order; what they need to remember is on ``user``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest

pytest.importorskip("viser", reason="viser is not installed: no interactive page")

from flown_page import FlownPage
from lesson_flights import degrees_between

from rigid_proto_ros.base.bundled import scene_names
from rigid_proto_ros.base.rotation import matrix_from_quaternion
from rigid_proto_ros.picture import style
from rigid_proto_ros.scene.lessons import SENTENCES, lesson
from rigid_proto_ros.workbench import controls, lesson_panel, readouts
from rigid_proto_ros.workbench import page as page_module
from rigid_proto_ros.workbench.lesson_course import COURSES
from rigid_proto_ros.workbench.panel import PATHS

Z = np.array([0.0, 0.0, 1.0])
GYROSCOPIC = "Gyroscopic term ω × Iω"
SPIN, MODEL, WEIGHT = "Initial spin [rad/s]", "Model", "Value"


class User(FlownPage):
    """Remembers what was seen."""

    remembered: object = None

    def widget_text(self) -> str:
        """What the lesson says."""
        return self.page.lessons._text.content

    @property
    def body(self):
        return self.scenario.setup.body

    @property
    def time(self) -> np.ndarray:
        """[s] Of the states since the last reset."""
        return np.array([time_ns for time_ns, _ in self.seen.rows]) / 1e9

    @property
    def rows(self) -> np.ndarray:
        return np.array([row for _, row in self.seen.rows])

    @property
    def rotation(self) -> np.ndarray:
        """(n, 3, 3)"""
        return np.array([matrix_from_quaternion(row[3:7]) for row in self.rows])

    @property
    def spin(self) -> np.ndarray:
        return self.rows[:, 10:13]

    @property
    def momentum(self) -> np.ndarray:
        R = self.rotation
        return np.einsum("nij,jk,nlk,nl->ni", R, self.body.inertia, R, self.spin)

    @property
    def energy(self) -> np.ndarray:
        """Kinetic [J]."""
        v = self.rows[:, 7:10]
        return 0.5 * self.body.mass * (v * v).sum(axis=1) + 0.5 * (self.momentum * self.spin).sum(axis=1)

    @property
    def velocity(self) -> np.ndarray:
        """Of the COM (3,), now."""
        return self.rows[-1, 7:10]

    def since(self, time_s: float) -> slice:
        return slice(int(np.searchsorted(self.time, time_s - 1e-9)), None)

    def flips(self, axis: int) -> np.ndarray:
        """Times at which a mesh axis turned over with respect to L."""
        cosine = (self.rotation[:, :, axis] * self.momentum).sum(axis=1)
        return self.time[1:][np.sign(cosine[1:]) != np.sign(cosine[:-1])]

    def throw(self, spin: str) -> None:
        """Another initial spin, and a reset."""
        self.set(SPIN, spin)
        self.reset()

    def rewind(self) -> None:
        """As far back as it goes."""
        available = self.time[-1] - self.time[0]
        self._update(self.widget("Seconds back"), float(min(available, self.widget("Seconds back").max)))
        self.until(lambda: not self.widget("Go on from here").disabled, "moment of the past")
        self.press("Go on from here")
        self.fly(0.0)

    def push(self, point, direction) -> None:
        """Click at a mesh point, and wait until the poke is over."""
        self.click(point, direction)
        self.fly(0.06)


def ballast_flips(user: User) -> None:
    user.fly(6.0)
    assert len(user.flips(2)) == 2


def ballast_on(user: User) -> None:
    assert user.widget("Parameter").value == "ballast.tip" and user.widget(WEIGHT).value == "0 0 0 0.07"
    user.set(WEIGHT, "0.03 0 0 0.07")
    user.fly(12.0)
    x, y, z = user.body.inertia.diagonal()
    assert z < y < x
    assert np.count_nonzero(user.flips(2) > 6.0) == 0


def ballast_off(user: User) -> None:
    user.set(WEIGHT, "0 0 0 0.07")
    since = user.time[-1]
    user.fly(10.0)
    assert np.count_nonzero(user.flips(2) > since) >= 3


def book_tumbles(user: User) -> None:
    user.fly(10.0)
    assert len(user.flips(0)) >= 2


def book_steadily(user: User) -> None:
    for spin, axis in (("0 8 0", 1), ("0 0 8", 2)):
        user.throw(spin)
        user.fly(10.0)
        assert len(user.flips(axis)) == 0
        assert degrees_between(user.spin, user.spin[0]).max() < 3.0


def book_calm(user: User) -> None:
    user.set(GYROSCOPIC, False)
    user.throw("8 0.05 0.05")
    user.fly(10.0)
    assert len(user.flips(0)) == 0 and degrees_between(user.spin, user.spin[0]).max() < 1e-6


FACE = (0.0, 0.0, -1.0)


def racket_at_com(user: User) -> None:
    # It lies in the open throat, where a click meets no body: its mark takes it.
    assert user.page._com.visible and user.page._com._impl.click_cb
    user.do(lambda: user.page.flight.do({"force": [0.0, 0.0, -user.page.tools.force]}))
    user.wait_until_still()
    user.fly(0.06)
    user.remembered = user.velocity, user.energy[-1]
    assert np.linalg.norm(user.velocity) > 0.0 and np.abs(user.spin[-1]).max() < 1e-9


def racket_at_rim(user: User) -> None:
    user.rewind()
    assert np.abs(user.velocity).max() == 0.0
    user.push((0.68, 0.0, 0.0), FACE)
    before, _ = user.remembered
    assert np.allclose(user.velocity, before, rtol=1e-9, atol=1e-12)
    assert np.linalg.norm(user.spin[-1]) > 0.5


def racket_energies(user: User) -> None:
    assert 3.0 < user.energy[-1] / user.remembered[1] < 5.0


def term_watch(user: User) -> None:
    user.fly(5.0)
    L = user.momentum
    assert degrees_between(L, L[0]).max() > 30.0
    assert np.ptp(user.energy) < 1e-9 * user.energy[0] and np.ptp(np.linalg.norm(L, axis=1)) < 1e-9 * np.linalg.norm(
        L[0]
    )


def term_on(user: User) -> None:
    user.set(GYROSCOPIC, True)
    user.fly(5.0)
    after = user.since(5.0)
    assert degrees_between(user.momentum[after], user.momentum[-1]).max() < 1e-5
    assert degrees_between(user.spin[after], user.spin[-1]).max() > 10.0


def term_off(user: User) -> None:
    user.set(GYROSCOPIC, False)
    user.fly(5.0)
    after = user.since(10.0)
    assert degrees_between(user.spin[after], user.spin[-1]).max() < 1e-6
    assert degrees_between(user.momentum[after], user.momentum[-1]).max() > 1.0


def hammer_neck(user: User) -> None:
    user.fly(2.0)
    assert np.abs(user.rows[:, 0:3]).max() == 0.0
    assert user.body.center_of_mass[2] > 0.22  # of a handle that is 0.3 m long
    user.remembered = head_path(user)


def hammer_box(user: User) -> None:
    com = user.body.center_of_mass
    user.set(MODEL, "bounding_box")
    moved = user.body.center_of_mass - com
    assert np.linalg.norm(moved) == pytest.approx(0.081, abs=5e-4) and abs(user.body.center_of_mass[2] - 0.15) < 0.02
    user.reset()
    user.fly(2.0)
    turn = round(2.0 * np.pi / 4.0 / 0.01)
    assert np.linalg.norm(head_path(user) - user.remembered, axis=1)[:turn].max() > 0.05


def head_path(user: User) -> np.ndarray:
    return user.rows[:, 0:3] + user.rotation @ user.body.point((0.0682, 0.0, 0.29))


def hammer_pushes(user: User) -> None:
    user.set(MODEL, "solid")
    found = []
    for point in ((0.06, 0.0, 0.29), (0.0, 0.0, 0.01)):
        user.throw("0 0 0")
        user.push(point, (-1.0, 0.0, 0.0))
        found.append((user.velocity, user.spin[-1]))
    (v, w), (v2, w2) = found
    assert np.allclose(v, v2, rtol=1e-9) and w[1] * w2[1] < 0.0 and abs(w2[1]) > 3.0 * abs(w[1])


CORNER, ALONG = (0.095, 0.045, 0.025), (0.0, -1.0, 0.0)


def hollow_push(user: User) -> None:
    user.push(CORNER, ALONG)
    user.remembered = np.linalg.norm(user.spin[-1] - [0.0, 0.0, 0.5])


def hollow_full(user: User) -> None:
    mass = user.body.mass
    user.rewind()
    user.set(MODEL, "bounding_box")
    user.push(CORNER, ALONG)
    assert user.body.mass == pytest.approx(mass, rel=1e-12)
    assert np.linalg.norm(user.spin[-1] - [0.0, 0.0, 0.5]) > 1.2 * user.remembered


def hollow_table(user: User) -> None:
    lines = user.page.body_tab.table.splitlines()
    rows = [line.split("|")[2:4] for line in lines if line.startswith(("| I₁", "| I₂", "| I₃"))]
    assert len(rows) == 3 and all(float(hollow) > float(full) for hollow, full in rows)


def bracket_wobbles(user: User) -> None:
    assert np.array_equal(user.spin[0], [0.0, 0.0, 6.0])
    user.fly(1.0)
    assert degrees_between(user.momentum, Z)[0] == pytest.approx(15.0, abs=0.1)
    assert degrees_between(user.spin, Z)[: round(0.3 / 0.01)].max() > 5.0


def bracket_axes(user: User) -> None:
    user.set("Principal axes", True)
    arrows = user.page.backend._nodes[style.PRINCIPAL_AXES]
    vectors = arrows.points[:, 1] - arrows.points[:, 0]
    drawn = vectors / np.linalg.norm(vectors, axis=1)[:, None]
    assert arrows.visible and np.abs(drawn).max() < np.cos(np.radians(1.0))


def bracket_calm(user: User) -> None:
    user.set(GYROSCOPIC, False)
    user.fly(2.0)
    after = user.since(1.0)
    assert degrees_between(user.spin[after], user.spin[-1]).max() < 1e-6
    assert degrees_between(user.momentum[after], user.momentum[-1]).max() > 5.0


def plumb(user: User) -> tuple[np.ndarray, np.ndarray]:
    """The string's line in mesh coordinates [m]: a point, and its direction."""
    tied, state = user.live.loop.simulation.string, user.page.state
    hand = tied.free_end(state.time_ns)
    knot = hand + tied.span(user.body, state)
    R, position = user.rotation[-1], user.rows[-1, 0:3]
    return R.T @ (knot - position) + user.body.center_of_mass, R.T @ (hand - knot) / np.linalg.norm(hand - knot)


def off_line(point: np.ndarray, line: tuple[np.ndarray, np.ndarray]) -> float:
    return float(np.linalg.norm(np.cross(point - line[0], line[1])))


def plumb_rests(user: User) -> None:
    user.fly(30.0)
    assert np.abs(user.rows[300:900, 7:10]).max() > 0.1
    assert np.linalg.norm(user.velocity) < 0.01
    user.fly(10.0)
    user.remembered = plumb(user)
    assert off_line(user.body.center_of_mass, user.remembered) < 2e-4


def plumb_again(user: User) -> None:
    user.set("Tied at x y z", "-0.08 0 0")
    user.fly(40.0)
    line = plumb(user)
    assert np.abs(line[0] - [-0.08, 0.0, 0.0]).max() < 1e-9
    for one in (line, user.remembered):
        assert off_line(user.body.center_of_mass, one) < 2e-4
    assert degrees_between(line[1][None], user.remembered[1])[0] > 20.0  # so they cross


def plumb_click(user: User) -> None:
    user.click((0.05, 0.08, 0.0), user.rotation[-1] @ np.array([0.0, 0.0, -1.0]))
    user.fly(2.0)
    assert np.abs(user.spin[user.since(user.time[-1] - 1.0)]).max() > 0.05


STEM = (0.0, 0.0, 0.07)


def yielding(user: User) -> tuple[float, float]:
    """How far the stem leans along x and y on the average over a second after a push along x [sines]."""
    user.push(STEM, (1.0, 0.0, 0.0))
    since = user.time[-1]
    user.fly(1.0)
    lean = user.rotation[user.since(since), :, 2].mean(axis=0)
    return float(lean[0]), float(lean[1])


def top_yields(user: User) -> None:
    x, y = yielding(user)
    assert abs(y) > 3.0 * abs(x) and y > 0.01
    user.remembered = y


def top_faster(user: User) -> None:
    user.throw("0 0 60")
    assert yielding(user)[1] == pytest.approx(0.5 * user.remembered, rel=0.2)


def top_at_rest(user: User) -> None:
    user.throw("0 0 0")
    user.push(STEM, (1.0, 0.0, 0.0))
    user.fly(3.0)
    assert user.rotation[:, 2, 2].min() < -0.9


def handle_flips(user: User) -> None:
    user.fly(10.0)
    assert len(user.flips(2)) == 4 and np.all((np.diff(user.flips(2)) > 2.0) & (np.diff(user.flips(2)) < 3.0))
    assert degrees_between(user.momentum, user.momentum[0]).max() < 1e-5
    user.remembered = float(np.mean(np.diff(user.flips(2))))


def handle_clicked(user: User) -> None:
    R, before = user.rotation[-1], user.momentum[-1]
    user.push((0.0, 0.0, 0.068), R @ np.array([0.0, -1.0, 0.0]))
    since = user.time[-1]
    user.fly(12.0)
    flips = user.flips(2)
    flips = flips[flips > since]
    assert degrees_between(user.momentum[-1:], before)[0] > 1.0
    assert len(flips) >= 2 and abs(np.mean(np.diff(flips)) / user.remembered - 1.0) > 0.1


def handle_dragged(user: User) -> None:
    before = user.momentum[-1]
    place = user.grab((0.0, 0.045, 0.0))
    for k in range(8):
        user.pull(place + 0.25 * np.array([np.cos(0.8 * k), np.sin(0.8 * k), 0.1 * k]))
        user.fly(0.1)
    assert user.live.loop.simulation.string is not None
    user.let_go()
    since = user.time[-1]
    user.fly(3.0)
    L = user.momentum[user.since(since + 0.1)]
    assert user.live.loop.simulation.string is None
    assert degrees_between(L, L[-1]).max() < 1e-5 and degrees_between(L[-1:], before)[0] > 5.0


def pot_spout(user: User) -> None:
    user.push((0.12, 0.0, 0.095), ALONG)
    user.remembered = [(user.velocity, user.spin[-1])]


def pot_others(user: User) -> None:
    for point in ((-0.125, 0.0, 0.0745), (0.0, 0.0, 0.138)):
        user.rewind()
        user.push(point, ALONG)
        user.remembered.append((user.velocity, user.spin[-1]))
    velocities, spins = zip(*user.remembered, strict=True)
    assert np.ptp(velocities, axis=0).max() < 1e-12
    assert min(np.linalg.norm(spins[i] - spins[j]) for i, j in ((0, 1), (0, 2), (1, 2))) > 1.0


def pot_through_com(user: User) -> None:
    user.rewind()
    user.push(user.body.center_of_mass, ALONG)
    assert np.linalg.norm(user.velocity) > 0.0 and np.abs(user.spin[-1]).max() < 1e-9


def racket_twists(user: User) -> None:
    user.fly(10.0)
    assert len(user.flips(1)) >= 1


def racket_stays(user: User) -> None:
    for spin, axis in (("6 0.03 0.03", 0), ("0.03 0.03 6", 2)):
        user.throw(spin)
        user.fly(10.0)
        assert len(user.flips(axis)) == 0 and degrees_between(user.rotation[:, :, axis], user.momentum[0]).max() < 10.0


def racket_wrong(user: User) -> None:
    user.set(GYROSCOPIC, False)
    user.throw("0.03 6 0.03")
    user.fly(10.0)
    assert len(user.flips(1)) == 0


def path_of(user: User, name: str) -> np.ndarray:
    return np.array(user.page.backend._paths[name])


def parabola_miss(path: np.ndarray) -> float:
    """How far a path (n, 3) is from the best parabola of the height over x [m]."""
    x, _, z = path.T
    return float(np.abs(np.polyval(np.polyfit(x, z, 2), x) - z).max())


def hammer_paths(user: User) -> None:
    assert user.widget(PATHS).value
    user.fly(1.0)
    com, grip = (path_of(user, name) for name in (style.COM_TRAIL, style.TRAIL))
    assert min(len(com), len(grip)) > 50
    # Points of the drawn path lie on chords between states 0.01 s apart: g dt²/8 is 1.2e-4 m.
    assert parabola_miss(com) < 2e-4 and parabola_miss(grip) > 0.1
    places, t = user.rows[:, 0:3], user.time
    assert max(np.abs(np.polyval(np.polyfit(t, x, 2), t) - x).max() for x in places.T) < 1e-9


def hammer_other_spin(user: User) -> None:
    user.throw("3 -5 20")
    user.fly(1.02)
    assert user.rows[-1, 2] == pytest.approx(1.5, abs=5e-3)


def hammer_weightless(user: User) -> None:
    spin = user.spin[-1]
    user.press("off", of="Gravity is")
    user.fly(1.0)
    after = user.since(1.03)
    assert np.ptp(user.rows[after, 7:10], axis=0).max() == 0.0
    assert degrees_between(user.momentum[after], user.momentum[0]).max() < 1e-5
    assert np.allclose(user.spin[user.since(1.02)][0], spin)


def azimuth_rate(user: User, seconds: float) -> float:
    user.fly(seconds)
    stem = user.rotation[:, :, 2]
    azimuth = np.unwrap(np.arctan2(stem[:, 1], stem[:, 0]))
    return float(abs(azimuth[-1] - azimuth[0]) / seconds)


def level(user: User) -> float:
    return float(np.abs(np.degrees(np.arcsin(user.rotation[:, 2, 2]))).max())


def top_walks(user: User) -> None:
    user.remembered = azimuth_rate(user, 5.0)
    assert user.remembered == pytest.approx(1.6, abs=0.1) and level(user) < 5.0


def top_walks_faster(user: User) -> None:
    user.throw("0 -300 0")
    assert azimuth_rate(user, 5.0) == pytest.approx(2.0 * user.remembered, rel=0.1)


def top_falls(user: User) -> None:
    user.throw("0 0 0")
    user.fly(2.0)
    assert level(user) > 70.0


def ghost_row(user: User) -> np.ndarray:
    return user.until(lambda: user.page._ghost_row is not None and [user.page._ghost_row], "a ghost")[0]


def ghost_spin(user: User) -> np.ndarray:
    row = ghost_row(user)
    return matrix_from_quaternion(row[3:7]) @ row[10:13]


def bracket_and_ghost(user: User) -> None:
    most = 0.0
    for _ in range(10):
        user.fly(1.0)
        assert degrees_between(ghost_spin(user)[None], Z)[0] < 1e-6  # as on an axle
        most = max(most, float(user.page.readings.values[readouts.GHOST_ANGLE].rstrip("°")))
    assert degrees_between(user.spin, Z).max() > 30.0 and degrees_between(user.rotation[:, :, 2], Z).max() > 150.0
    assert most > 90.0


def bracket_as_box(user: User) -> None:
    user.set(MODEL, "bounding_box")
    user.reset()
    user.fly(5.0)
    assert degrees_between(user.spin, Z).max() < 1e-9
    ghost = ghost_row(user)
    assert np.abs(ghost[:10] - user.rows[-1, :10]).max() < 1e-9


def bracket_numbers(user: User) -> None:
    text = user.page.body_tab.table
    errors = text.split("moments off by **")[1].split(" %")[0].split(", ")
    assert [f"{abs(float(e)):.0f}" for e in errors] == ["38", "23", "13"]
    assert "0.0244 m off" in text


DENSITY = "Density [kg/m³]"


def book_as_heavy(user: User) -> None:
    user.fly(2.0)
    tumbled = user.rotation[:200]
    user.set(DENSITY, "7000")
    user.reset()
    user.fly(2.0)
    assert user.body.mass == pytest.approx(6.339, abs=1e-3)
    assert np.abs(user.rotation[:200] - tumbled).max() < 1e-9


def book_pushed(user: User) -> None:
    user.push((0.07, 0.1, 0.0138), user.rotation[-1] @ np.array([0.0, 0.0, -1.0]))
    user.remembered = float(np.linalg.norm(user.velocity))
    assert user.remembered > 0.0
    user.fly(1.0)


def book_lighter(user: User) -> None:
    user.set(DENSITY, "700")
    user.reset()
    user.push((0.07, 0.1, 0.0138), user.rotation[-1] @ np.array([0.0, 0.0, -1.0]))
    assert float(np.linalg.norm(user.velocity)) == pytest.approx(10.0 * user.remembered, rel=0.05)


STEPS: dict[str, tuple[Callable[[User], None], ...]] = {
    "ballast_stops_flip": (ballast_flips, ballast_on, ballast_off),
    "book": (book_tumbles, book_steadily, book_calm),
    "com_or_rim": (racket_at_com, racket_at_rim, racket_energies),
    "dropped_term": (term_watch, term_on, term_off),
    "hammer": (hammer_neck, hammer_box, hammer_pushes),
    "hollow_box": (hollow_push, hollow_full, hollow_table),
    "l_bracket": (bracket_wobbles, bracket_axes, bracket_calm),
    "plumb_line": (plumb_rests, plumb_again, plumb_click),
    "spinning_top": (top_yields, top_faster, top_at_rest),
    "t_handle": (handle_flips, handle_clicked, handle_dragged),
    "teapot": (pot_spout, pot_others, pot_through_com),
    "tennis_racket": (racket_twists, racket_stays, racket_wrong),
    "thrown_hammer": (hammer_paths, hammer_other_spin, hammer_weightless),
    "top_on_string": (top_walks, top_walks_faster, top_falls),
    "true_or_box_tensor": (bracket_and_ghost, bracket_as_box, bracket_numbers),
    "weigh_by_throwing": (book_as_heavy, book_pushed, book_lighter),
}
"""One function for each sentence."""


@pytest.fixture(scope="module")
def user() -> Iterator[User]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(page_module, "GRACE_S", 0.0)
        patch.setattr(controls, "TYPING_S", 0.0)
        patch.setattr(controls, "TOUCHED_S", 0.0)
        user = User()
        yield user
        user.end()


def test_every_sentence_of_every_lesson_has_a_step() -> None:
    assert sorted(STEPS) == scene_names() == sorted(COURSES)
    assert {len(course.steps) for course in COURSES.values()} == {SENTENCES}
    assert {len(steps) for steps in STEPS.values()} == {SENTENCES}


@pytest.mark.parametrize("name", sorted(STEPS))
def test_every_step_of_the_lesson_can_be_done_on_the_page_and_shows_what_it_says(user: User, name: str) -> None:
    user.set("Lesson", lesson_panel.FREE)
    user.said.clear()
    user.pick(lesson(name).title)
    assert user.widget_text().count("✓") == 0
    for number, step in enumerate(STEPS[name]):
        step(user)
        user.until(lambda before=number: user.widget_text().count("✓") >= before, "mark at a step before")
    user.fly(1.0)
    user.until(lambda: user.widget_text().count("✓") == SENTENCES, "mark at the last step")
    assert not user.said
