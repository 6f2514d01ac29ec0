# SPDX-License-Identifier: MIT
"""Studies that the tests of sweeps share: small, and between them with everything that can vary."""

from rigid_proto_ros.sweep.study import Study, make_study

POKES = {
    "scene": "t_handle",
    "script": [
        {"t": 0.5, "at": "tip", "force": [1.0, 0.0, 0.5], "duration": 0.05},
        {"t": 1.0, "at": "com", "impulse": [0.1, 0.0, 0.2], "angular_impulse": [0.001, 0.0, 0.0]},
        {"t": 1.2, "at": "left", "push": 2.0},
        {"t": 1.6, "axes": "body", "force": [0.1, 0.3, 0.0], "torque": [0.001, 0.0, 0.002], "duration": 0.3},
        {"t": 1.7, "wrench": {"at": "right", "force": [0.0, 0.0, 0.1], "duration": 0.8, "slot": "right"}},
        {"t": 1.7, "wrench": {"at": "left", "force": [0.0, 0.1, 0.0], "duration": 0.1, "slot": "left"}},
        {"t": 1.9, "wrench": {"force": [0.0, 0.0, 0.2], "slot": "right"}},
    ],
    "duration": 2.0,
    "seed": 3,
    "samples": 24,
    "watch": 10,
    "vary": {
        "mass": {"log_uniform": [0.1, 1.0]},
        "scale": {"uniform": [0.5, 2.0]},
        "initial.orientation_xyzw": "random_rotation",
        "initial.angular_velocity.x": {"normal": [0, 1]},
        "script.1.force": {"direction": 2.0},
        "script.1.t": {"uniform": [0.1, 1.5]},
        "script.3.push": {"uniform": [0, 3]},
        "script.4.duration": {"uniform": [0.05, 0.3]},
    },
    "measure": {
        "final": ["position", "orientation", "velocity", "spin", "energy"],
        "flips": {"axis": [0, 0, 1]},
        "max": ["spin", "energy_drift"],
    },
}
"""Numbers alone vary, of parameters and of the script."""

STRUCTURE = {
    "scene": "t_handle",
    "script": [
        {"t": 0.1, "at": "tip", "force": [1.0, 0.0, 0.5], "duration": 0.05},
        {"t": 0.1, "at": "tip", "force": [1.0, 0.0, 0.5], "duration": 0.05},
        {"t": 0.2, "at": {"vertex": 3}, "impulse": [0.1, 0.0, 0.2]},
        {"t": 0.3, "wrench": {"at": "right", "push": 0.1, "duration": 0.25}},
        {"t": 0.5, "service": "clear_wrench"},
    ],
    "duration": 0.7,
    "seed": 1 << 70,
    "samples": 2,
    "watch": 20,
    "set": {
        "ballast.tip": [0.01, 0, 0, 0.07],
        "angular_damping": 1e-6,
        "linear_damping": 0.02,
        "gravity": [0, 0, -9.81],
        "initial": {"angular_velocity": [0, 0, 3]},
    },
    "vary": {
        "inertia_model": {"grid": ["solid", "points", "bounding_box"]},
        "inertia_model_com": {"list": ["model", "solid", "solid"]},
        "mesh": {"list": ["t_handle", "hammer", "book"]},
        "integrator": {"list": ["auto", "rk4", "dop853"]},
        "density": {"uniform": [100, 5000]},
        "scale.z": {"uniform": [-2, -1]},
        "ballast.tip.mass": {"uniform": [-0.01, 0.05]},
        "script.3.at": "random_vertex",
        "script.4.wrench.push": {"normal": [0, 1]},
        "script.2.force.x": {"grid": [1.0, 2.0]},
        "gravity.z": {"uniform": [-10, 0]},
        "step": {"log_uniform": [1e-3, 1e-2]},
        "accuracy": {"log_uniform": [1e-12, 1e-5]},
    },
    "reference": {"inertia_model": "solid", "integrator": "auto"},
    "measure": {
        "final": ["position", "orientation"],
        "difference": ["attitude", "position", "velocity", "spin"],
        "first": {"turned": {"quantity": "turned", "above": 1.0}},
        "min": ["potential_energy", "momentum_turned"],
    },
}
"""Mesh, model and integrator vary, and where a poke acts; some rows fail. The simulation flies them."""

PULLED = {
    "scene": "t_handle",
    "script": [{"t": 0.05, "string": {"target": [0.1, 0.0, 0.2]}}, {"t": 0.1, "set": {"mass": 0.5}}],
    "duration": 0.2,
    "samples": 3,
    "vary": {"string.stiffness": {"uniform": [1, 20]}, "script.2.set.mass": {"uniform": [0.2, 0.8]}},
    "measure": {"final": ["position", "energy"]},
}
"""A string and a parameter change: the simulation's."""


def study(spec: dict, **changes) -> Study:
    """A study with some keys changed."""
    return make_study({**spec, **changes})


HUNG = {
    "scene": "t_handle",
    "script": [{"t": 0.1, "at": "tip", "force": [0.02, 0.0, 0.05], "duration": 0.2}],
    "duration": 1.0,
    "samples": 12,
    "watch": 20,
    "set": {
        "gravity": [0, 0, -9.81],
        "string": {"attached": True, "attach": [0.0, 0.0, 0.07], "target": [0.0, 0.0, 0.4], "rest_length": 0.3},
    },
    "vary": {
        "mass": {"uniform": [0.1, 0.3]},
        "string.frequency": {"uniform": [5.0, 60.0]},
        "string.damping_ratio": {"uniform": [0.0, 0.3]},
        "string.target.x": {"uniform": [-0.2, 0.2]},
        "initial.angular_velocity": {"direction": 4.0},
        "angular_damping": {"log_uniform": [1e-8, 1e-5]},
        "linear_damping": {"log_uniform": [1e-4, 1.0]},
    },
    "measure": {"final": ["position", "orientation", "energy"], "max": ["potential_energy"], "min": ["energy"]},
}
"""A string from the start, slack and taut, and damping."""
