# SPDX-License-Identifier: MIT
"""Mass, centre of mass and tensor from one measured throw: ours against MuJoCo's system identification, and against
SciPy's least squares over MuJoCo's rollouts.

Rules: both get the same samples (2 s of positions and attitudes at 100 Hz with noise of .5 mm and .2 degrees, one poke
of a known force) and their standard deviations. The peers integrate by MuJoCo's RK4 at 1 ms, and look for the ten
parameters in log-Cholesky coordinates and the twelve of the start by difference quotients. One is ``mujoco.sysid``
(``pip install 'mujoco[sysid]'``) with its own parameter of a body's pseudo-inertia, its residuals, its optimizer and the
poke as the control of a site's actuators. Its trajectories have given starts, so those are set in its custom rollout;
and the model that its own modifier of a pseudo-inertia makes isn't compiled by MuJoCo 4.0.0 (``mass and inertia of
moving bodies must be larger than mjMINVAL``), so a modifier here writes the moments and their axes.
The other is what one writes first, SciPy's trust region over rollouts. A peer's start is the measured pose with the
velocities of the first tenth of a second, and it begins once from a body that is near (mass and moments some 10 %
off), once from a ball of 1 kg, from which ours begins too, and once from the truth itself, which nobody has. The tools
take turns; compiling is not timed; the process's own time stands beside the wall clock's, as other programs disturb it
less. The error is that of all ten numbers in standard deviations of the Cramér-Rao bound, its root mean square: 1 is the best
that any unbiased estimate can do, above 10 the estimate has gone elsewhere, and infinity says that the tool's rollout
became unstable, which ended it.

Writes results/identification.csv beside this file.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import time
from pathlib import Path

import mujoco
import mujoco.sysid
import numpy as np
from scipy.optimize import least_squares

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent), str(HERE), str(HERE.parent / "test" / "identify")]

import calibration_study as study
import measured_flights as mf

from result_table import ResultTable
from rigid_proto_ros import __version__
from rigid_proto_ros.identify import measurements as ms
from rigid_proto_ros.identify import rotations as rot
from rigid_proto_ros.identify.identification import Known, identify
from rigid_proto_ros.identify.initial_estimate import local_start
from rigid_proto_ros.identify.shooting import moved_starts
from rigid_proto_ros.identify.unknowns import Values, second_moments
from rigid_proto_ros.mass.properties import MassProperties
from rigid_proto_ros.motion import loads as ld

COLUMNS = ("tool", "version", "body", "throw", "begins_from", "seconds", "cpu_seconds", "error", "mass_error")
STEP = 1e-3
OURS, PEER, SYSID = "rigid_proto_ros", "mujoco + scipy", "mujoco.sysid"


def departures(poses: np.ndarray, flight: ms.MeasuredFlight) -> np.ndarray:
    """Of the measured poses from MuJoCo's (m, 7), in standard deviations (6 m,); of as many as there are from the end
    on.
    """
    position, attitude = (series.values[-len(poses) :] for series in flight.series)
    with np.errstate(all="ignore"):
        turned = rot.logarithm(rot.product(rot.inverse(poses[:, [4, 5, 6, 3]]), attitude)) / mf.MOCAP[1]
        moved = (position - poses[:, :3]) / mf.MOCAP[0]
    return np.nan_to_num(np.concatenate([moved.ravel(), turned.ravel()]), nan=1e6, posinf=1e6, neginf=-1e6)


def _principal(inertia: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Moments (3,) and axes as a quaternion (4,) in MuJoCo's order."""
    moments, axes = np.linalg.eigh(inertia)
    if np.linalg.det(axes) < 0.0:
        axes[:, 0] *= -1.0
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, axes.ravel())
    return moments, quaternion


class Rollouts:
    """MuJoCo's flight of the throw for any body and start, compared with what was measured, in standard deviations."""

    def __init__(self, flight: ms.MeasuredFlight) -> None:
        gravity = " ".join(repr(float(g)) for g in flight.gravity)
        self.model = mujoco.MjModel.from_xml_string(
            f'<mujoco><option timestep="{STEP}" integrator="RK4" gravity="{gravity}"/><worldbody><body simple="false"><freejoint/>'
            '<inertial pos=".1 .2 .3" quat=".5 .5 .5 .5" mass="1" diaginertia="1 1.2 1.4"/></body></worldbody></mujoco>'
        )
        self.data = mujoco.MjData(self.model)
        self.flight = flight
        self.steps = np.round(1e-9 * flight.series[0].times_ns / STEP).astype(int)
        self.loads = [
            (round(1e-9 * begin / STEP), round(1e-9 * end / STEP), load)
            for begin, end, load in zip(
                flight.load_history.begin_ns.tolist(),
                flight.load_history.end_ns.tolist(),
                flight.load_history.loads,
                strict=True,
            )
        ]

    def departures(self, theta: np.ndarray, start: np.ndarray) -> np.ndarray:
        """Of all samples (6 m,)."""
        body = _body_of_pseudo_inertia(theta)
        moments, quaternion = _principal(body.inertia)
        model, data = self.model, self.data
        model.body_mass[1], model.body_inertia[1] = body.mass, moments
        model.body_ipos[1], model.body_iquat[1] = body.center_of_mass, quaternion
        mujoco.mj_setConst(model, data)
        mujoco.mj_resetData(model, data)
        x, y, z, w = start[3:7]
        data.qpos[:] = [*start[:3], w, x, y, z]
        data.qvel[:] = start[7:13]
        poses, done = np.empty((len(self.steps), 7)), 0
        edges = sorted({edge for begin, end, _ in self.loads for edge in (begin, end)})
        for k, step in enumerate(self.steps):
            while done < step:
                until = min([step, *(edge for edge in edges if edge > done)])
                self._step(done, until)
                done = until
            poses[k] = data.qpos
        return departures(poses, self.flight)

    def _step(self, first: int, last: int) -> None:
        acting = [load for begin, end, load in self.loads if begin <= first < end]
        if not acting:
            mujoco.mj_step(self.model, self.data, last - first)
            return
        for _ in range(last - first):
            # Applied forces are held in each step, so they are those of the attitude in its middle.
            now = self.data.qpos.copy()
            mujoco.mj_integratePos(self.model, self.data.qpos, self.data.qvel, 0.5 * STEP)
            mujoco.mj_kinematics(self.model, self.data)
            mujoco.mj_comPos(self.model, self.data)
            self.data.qfrc_applied[:] = 0.0
            for load in acting:
                # The throws are poked by forces along world axes at a point of the body.
                point = self.data.xpos[1] + self.data.xmat[1].reshape(3, 3) @ load[ld.POINT : ld.POINT + 3]
                force, torque = load[ld.FORCE : ld.FORCE + 3], load[ld.TORQUE : ld.TORQUE + 3]
                mujoco.mj_applyFT(self.model, self.data, force, torque, point, 1, self.data.qfrc_applied)
            self.data.qpos[:] = now
            mujoco.mj_step(self.model, self.data)
        self.data.qfrc_applied[:] = 0.0


def fit_by_mujoco(flight: ms.MeasuredFlight, theta: np.ndarray, start: np.ndarray) -> np.ndarray:
    """θ (10,) by SciPy's least squares over MuJoCo's rollouts."""
    rollouts = Rollouts(flight)

    def residuals(numbers: np.ndarray) -> np.ndarray:
        return rollouts.departures(theta + numbers[:10], moved_starts(start[None], numbers[None, 10:])[0])

    return theta + least_squares(residuals, np.zeros(22), x_scale="jac", max_nfev=200).x[:10]


def _body_of_pseudo_inertia(numbers: np.ndarray) -> MassProperties:
    """Of the peers' ten numbers, log-Cholesky coordinates (Rucker and Wensing, IEEE RA-L 7, 2022)."""
    alpha, a, b, c, s12, s23, s13 = numbers[:7].tolist()
    V = np.array([[np.exp(a), s12, s13], [0.0, np.exp(b), s23], [0.0, 0.0, np.exp(c)]])
    mass = float(np.exp(2.0 * alpha))
    second = mass * (V @ V.T)
    return MassProperties(mass, numbers[7:10].copy(), np.trace(second) * np.eye(3) - second)


def _pseudo_inertia(mass: float, com: np.ndarray, inertia: np.ndarray) -> np.ndarray:
    """The ten numbers of a body."""
    # Upper triangular: Cholesky of the matrix turned end for end.
    V = np.linalg.cholesky((second_moments(inertia) / mass)[::-1, ::-1])[::-1, ::-1]
    return np.array([0.5 * np.log(mass), *np.log(np.diag(V)), V[0, 1], V[1, 2], V[0, 2], *com])


def _with_body(truth: Values, theta: np.ndarray) -> Values:
    body = _body_of_pseudo_inertia(theta)
    return dataclasses.replace(truth, mass=body.mass, center_of_mass=body.center_of_mass, inertia=body.inertia)


def fit_by_sysid(flight: ms.MeasuredFlight, theta: np.ndarray, start: np.ndarray) -> np.ndarray:
    """θ (10,) by MuJoCo's system identification, its least squares over its rollouts."""
    [load], body = flight.load_history.loads, _body_of_pseudo_inertia(theta)
    point, force = load[ld.POINT : ld.POINT + 3], load[ld.FORCE : ld.FORCE + 3]
    moments, axes = _principal(body.inertia)
    given = (flight.gravity, point, body.center_of_mass, moments, axes)
    text = [" ".join(repr(float(x)) for x in numbers) for numbers in given]
    motors = "".join(
        f'<general site="poked" refsite="world" gear="{" ".join(str(int(k == axis)) for k in range(6))}"/>'
        for axis in range(3)
    )
    spec = mujoco.MjSpec.from_string(
        f'<mujoco><option timestep="{STEP}" integrator="RK4" gravity="{text[0]}"/><worldbody><site name="world"/>'
        f'<body name="body"><freejoint/><site name="poked" pos="{text[1]}"/>'
        f'<inertial pos="{text[2]}" mass="{body.mass!r}" diaginertia="{text[3]}" quat="{text[4]}"/></body></worldbody>'
        f'<actuator>{motors}</actuator><sensor><framepos objtype="xbody" objname="body"/>'
        '<framequat objtype="xbody" objname="body"/></sensor></mujoco>'
    )
    model = spec.compile()
    position, attitude = flight.series
    times = 1e-9 * position.times_ns
    steps = np.arange(0.0, times[-1] + 1.5 * STEP, STEP)
    begin, end = 1e-9 * flight.load_history.begin_ns[0], 1e-9 * flight.load_history.end_ns[0]
    acts = (steps > begin - 0.5 * STEP) & (steps < end - 0.5 * STEP)
    measured = mujoco.sysid.TimeSeries.from_names(
        times, np.hstack([position.values, attitude.values[:, [3, 0, 1, 2]]]), model
    )
    controls = mujoco.sysid.TimeSeries.from_control_names(steps, np.where(acts[:, None], force, 0.0), model)

    def state(change: np.ndarray) -> np.ndarray:
        moved = moved_starts(start[None], change[None])[0]
        pose = np.array([*moved[:3], moved[6], *moved[3:6]])
        return mujoco.sysid.create_initial_state(model, pose, moved[7:13])

    def rollout(initial_states: object, param_dicts: list, **others: object) -> object:
        del initial_states
        return mujoco.sysid.sysid_rollout(initial_states=[state(p["start"].value) for p in param_dicts], **others)

    def residual(params: object, predicted: object, sensed: object, model: object, every: bool, state: np.ndarray):
        del params, model, every
        rows = np.round(times[1:] / STEP).astype(int) - 1
        return departures(state[rows, 1:8], flight), predicted, predicted

    def write(spec: mujoco.MjSpec, parameter: object) -> None:
        own = _body_of_pseudo_inertia(parameter.value)
        body, (moments, axes) = spec.body("body"), _principal(own.inertia)
        body.mass, body.ipos, body.inertia, body.iquat = own.mass, own.center_of_mass, moments, axes

    many = np.array([1e-3, 1e3])
    params = mujoco.sysid.ParameterDict()
    params.add(
        mujoco.sysid.body_inertia_param(
            *(spec, model, "body", mujoco.sysid.InertiaType.Pseudo),
            mass_bound_mult=many,
            stretch_bound_mult=many,
            param_name="pseudo-inertia",
            modifier=write,
        )
    )
    widths = np.repeat([0.1, 0.5, 2.0, 5.0], 3)
    params.add(mujoco.sysid.Parameter("start", np.zeros(12), -widths, widths))
    sequences = [mujoco.sysid.ModelSequences("throw", spec, "throw", state(np.zeros(12)), controls, measured)]
    residuals = mujoco.sysid.build_residual_fn(
        models_sequences=sequences, custom_rollout=rollout, modify_residual=residual
    )
    found, _ = mujoco.sysid.optimize(params, residuals, verbose=False)
    return found["pseudo-inertia"].value


FITS = {PEER: fit_by_mujoco, SYSID: fit_by_sysid}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--throws", type=int, default=1, help="of eight bodies; the peers take minutes for each")
    args = parser.parse_args()
    table = ResultTable(HERE / "results" / "identification.csv", COLUMNS)
    ball = _pseudo_inertia(1.0, np.zeros(3), 0.004 * np.eye(3))
    for number in range(args.throws):
        made = study.measured_throw(2 * number, poked=True)
        widths = np.array([1.0] * 7 + [made.size] * 3)
        truth = made.truth
        true = _pseudo_inertia(truth.mass, truth.center_of_mass, truth.inertia)
        # Lengths in the triangle are relative to the body's size, as its logarithms are.
        widths[4:7] = truth.size
        near = true + 0.05 * widths * np.random.default_rng(number).standard_normal(10)
        begun = (("truth", true), ("near", near), ("ball", ball))
        for tool, begins, theta in ((OURS, *begun[2]), *((tool, *one) for one in begun for tool in FITS)):
            start = made.start if begins == "truth" else local_start(made.flight, made.flight.begin_ns)
            found = None
            clock, cpu = time.perf_counter(), time.process_time()
            if tool == OURS:
                found = identify([made.flight], known=Known(length=made.size)).estimate.values
            else:
                try:
                    found = _with_body(truth, FITS[tool](made.flight, theta, start))
                except ValueError as error:  # its clock has gone back: MuJoCo resets a state that isn't finite
                    print(f"{tool} from {begins}: {error}")
            seconds, cpu_seconds = time.perf_counter() - clock, time.process_time() - cpu
            row = {
                "tool": tool,
                "version": __version__ if tool == OURS else mujoco.__version__,
                "body": made.body,
                "throw": made.number,
                "begins_from": begins,
                "seconds": seconds,
                "cpu_seconds": cpu_seconds,
                "error": np.inf if found is None else made.error(found),
                "mass_error": np.inf if found is None else abs(found.mass - truth.mass) / truth.mass,
            }
            table.add(row)
            print(*(f"{row[name]:.4g}" if isinstance(row[name], float) else row[name] for name in COLUMNS), flush=True)
    table.write()


if __name__ == "__main__":
    main()
