# SPDX-License-Identifier: MIT
"""What commands and changes of parameters do to a flight, at its present time.

Each function here is one instant's law; callers bring them in their order, and end with a new segment (CUT). flight,
loads, events: see simulation/flight.py; scene, mesh: see simulation/record.py. Where something is refused it returns
False, with the reason, and the flight goes on as it was.
"""

from __future__ import annotations

import numpy as np

from ..base.compilation import copy_numbers, exported, local_numbers, njit
from ..base.rotation import matrix_elements
from ..base.vectors import FloatArray, Points, Records, Triangles, Vector
from ..motion.body import BODY, COM, MASS, BodyRow
from ..motion.loads import (
    AT_COM,
    LOAD,
    LOAD_AXES,
    NEED_STRING,
    NO_MESH,
    ON_RAY,
    PLACE,
    POINT,
    RESOLVED,
    magnitudes,
    needs_of_load,
    resolve_load,
)
from ..motion.problem import begin_body
from ..motion.state import fill_initial_row, shift_com
from . import flight as fl
from . import refusals as rf
from .commands import CLEAR, MOVE_STRING, RELEASE_STRING, SET_STATE, TIE_STRING
from .flight import EVENT, FLIGHT, LOAD_ROW
from .record import MESH, SCENE, make_body, meets, needs_of, set_rules, takes_rotor
from .refusals import REFUSAL, refuse
from .string_control import begins_clear, change_string, follows_rates, move_knot, move_string, same_vector

FLY, BEGIN, APPLY, CUT, FINISH, END_DUE, END_ALL = range(7)
"""Operations of a call, at the flight's current time. APPLY: apply the commands put last. CUT: end the segment,
counting the shorter step taken to that time, and begin another. FINISH: add its counts to the totals and begin another
one now. END_DUE: end what is due. END_ALL: end all active loads.
"""


@exported(FLIGHT, [LOAD_ROW], [EVENT], "f8[:]", "i8", "i8", returns="i8")
def operate(flight: np.record, loads: Records, events: Records, room: FloatArray, what: int, until_ns: int) -> int:
    """Perform an operation on the flight; returns its result."""
    if what == BEGIN or flight.method == fl.NOT_BEGUN:
        fl.begin_segment(flight, loads, room)
    if what == FLY:
        return fl.fly(flight, loads, events, room, until_ns)
    if what == BEGIN:
        return 0
    if what == CUT:
        fl.cut_segment(flight, loads, room)
        return 0
    if what == FINISH:
        fl.finish_segment(flight, loads, room)
        return 0
    flight.events, flight.noteworthy = 0, 0
    if what == APPLY:
        while flight.due < flight.due_end:
            fl.apply(flight, loads, events, flight.due)
            flight.due += 1
    elif what == END_ALL:
        fl.end_all(flight, loads, events)
    elif fl.end_due(flight, loads, events):
        return 1
    return 0


# Commands


@njit(error_model="numpy", allocates=False)
def _is_taken(flight: np.record, kind: int, load: FloatArray, refusal: np.record) -> bool:
    """Whether body and integrator can take a resolved load."""
    taken = fl.takes(flight, kind, load)
    if taken == fl.TOO_LARGE:
        linear, angular = magnitudes(load, flight.body)
        return refuse(refusal, rf.MAGNITUDE, 0, linear, angular, flight.body[MASS])
    if taken == fl.UNSUPPORTED:
        return refuse(refusal, rf.INTEGRATOR, flight.integrator, float(needs_of_load(load)), 0.0, 0.0)
    return True


@exported(FLIGHT, MESH, "f8[:,:]", "i8[:,:]", "i8", "f8[:]", REFUSAL, returns="b1")
def check_load(
    flight: np.record,
    mesh: np.record,
    vertices: Points,
    triangles: Triangles,
    kind: int,
    load: FloatArray,
    refusal: np.record,
) -> bool:
    """Whether a flight can take the load (LOAD,) of a command of this kind, before it acts; resolves the load, except
    for a ray, whose point is known only then.
    """
    if load[PLACE] == ON_RAY:
        if triangles.shape[0] == 0:
            return refuse(refusal, rf.UNRESOLVED, NO_MESH, 0.0, 0.0, 0.0)
        at_com = local_numbers(LOAD)
        copy_numbers(load, at_com)
        at_com[PLACE] = AT_COM
        return _is_taken(flight, kind, at_com, refusal)
    found = resolve_load(load, flight.body, flight.row, vertices, triangles, mesh.extent)
    if found != RESOLVED:
        return refuse(refusal, rf.UNRESOLVED, found, 0.0, 0.0, 0.0)
    return _is_taken(flight, kind, load, refusal)


@njit(error_model="numpy", allocates=False)
def _set_state(row: FloatArray, given: FloatArray) -> None:
    """Set the state to given numbers (LOAD,): which of the four there are, as bits, then position, attitude xyzw,
    velocity and angular velocity, all in world axes; the others, including ω in world axes, stay unchanged.
    """
    new, old, bits = local_numbers(13), local_numbers(13), int(given[0])
    copy_numbers(row, old)
    R = matrix_elements(row[3], row[4], row[5], row[6])
    x, y, z = row[10], row[11], row[12]
    copy_numbers(row, new)
    for k in range(3):
        new[10 + k] = R[3 * k] * x + R[3 * k + 1] * y + R[3 * k + 2] * z
    for k in range(13):
        part = 0 if k < 3 else 1 if k < 7 else 2 if k < 10 else 3
        if bits >> part & 1:
            new[k] = given[1 + k]
    fill_initial_row(new[0:3], new[3:7], new[7:10], new[10:13], row)
    if not bits & 2:
        copy_numbers(old[3:7], row[3:7])
        if not bits & 8:
            copy_numbers(old[10:13], row[10:13])


@exported(SCENE, MESH, "f8[:,:]", "i8[:,:]", FLIGHT, [LOAD_ROW], [EVENT], REFUSAL, returns="b1")
def command(
    scene: np.record,
    mesh: np.record,
    vertices: Points,
    triangles: Triangles,
    flight: np.record,
    loads: Records,
    events: Records,
    refusal: np.record,
) -> bool:
    """Apply the command put last, of any kind."""
    number = flight.due
    flight.due += 1
    flight.events, flight.noteworthy = 0, 0
    kind, load = loads[number].kind, loads[number].load
    refusal.code = rf.ACCEPTED
    if kind <= CLEAR:
        if kind < CLEAR:
            found = resolve_load(load, flight.body, flight.row, vertices, triangles, mesh.extent)
            if found != RESOLVED:
                return refuse(refusal, rf.UNRESOLVED, found, 0.0, 0.0, 0.0)
            if not _is_taken(flight, kind, load, refusal):
                return False
        return fl.apply(flight, loads, events, number)
    point = load[POINT : POINT + 3]
    if kind == MOVE_STRING:
        return meets(scene, NEED_STRING, refusal) and move_string(scene, flight, point, refusal)
    if kind == TIE_STRING:
        return move_knot(scene, flight, load[LOAD_AXES], point, vertices, triangles, refusal)
    if kind == RELEASE_STRING:
        flight.tied = False
    elif kind == SET_STATE:
        _set_state(flight.row, load)
    return True


# Changes of parameters


@njit(error_model="numpy", allocates=False)
def _rotor_after(old: np.record, new: np.record, flight: np.record) -> Vector:
    """The flywheel's momentum after a change: what it is, unless the change says another one."""
    if same_vector(old.rotor_momentum, new.rotor_momentum):
        return fl.rotor_momentum(flight, flight.now_ns)
    return new.rotor_momentum[0], new.rotor_momentum[1], new.rotor_momentum[2]


@njit(error_model="numpy", allocates=False)
def _may_follow(
    old: np.record, new: np.record, body: BodyRow, flight: np.record, loads: Records, refusal: np.record
) -> bool:
    """Whether a scene with this body can follow the present one in flight: its integrator must be able to handle the
    current loads and the string.
    """
    # A string that is attached at time 0 will be tied at the next reset, even if it has been released since.
    tied = new.string_attached or (flight.tied and not old.string_attached)
    needs = needs_of(new, tied)
    for row in range(flight.acting):
        needs |= needs_of_load(loads[row].load)
    if not meets(new, needs, refusal) or not takes_rotor(new, body, _rotor_after(old, new, flight), refusal):
        return False
    moved = False
    for k in range(3):
        moved = moved or new.string_attach[k] != old.string_attach[k]
    if not follows_rates(new, body, tied, new.string_attach if moved else flight.string_attach, refusal):
        return False
    ties = new.string_attached and not old.string_attached
    if ties and not begins_clear(new, body, flight.row, new.string_attach, new.string_target, refusal):
        return False
    # Where the next reset ties it.
    return not new.string_attached or follows_rates(new, body, True, new.string_attach, refusal)


@exported(SCENE, SCENE, MESH, FLIGHT, [LOAD_ROW], REFUSAL, returns="b1")
def check_change(
    old: np.record, new: np.record, mesh: np.record, flight: np.record, loads: Records, refusal: np.record
) -> bool:
    """Whether a flight of the old scene can go on as one of the new scene, which has this mesh."""
    body = local_numbers(BODY)
    return make_body(new, mesh, body, refusal) and _may_follow(old, new, body, flight, loads, refusal)


@exported(SCENE, SCENE, MESH, "b1", FLIGHT, [LOAD_ROW], "f8[:]", REFUSAL, returns="b1")
def change(
    old: np.record,
    new: np.record,
    mesh: np.record,
    same_mesh: bool,
    flight: np.record,
    loads: Records,
    room: FloatArray,
    refusal: np.record,
) -> bool:
    """Go on as a flight of another scene. The same mesh at the same size stays in place: if the COM moves within it,
    position and velocity become those of the new COM. Another mesh or size keeps the COM and its motion.
    """
    body, before = flight.body, local_numbers(BODY)
    made = local_numbers(BODY)
    if not (make_body(new, mesh, made, refusal) and _may_follow(old, new, made, flight, loads, refusal)):
        return False
    copy_numbers(body, before)
    stays, moved = same_mesh, False
    for k in range(3):
        stays = stays and old.scale[k] == new.scale[k]
        moved = moved or made[COM + k] != before[COM + k]
    if stays and moved:
        x, y, z = made[COM] - before[COM], made[COM + 1] - before[COM + 1], made[COM + 2] - before[COM + 2]
        shift_com(flight.row, x, y, z)
    # The segment counts by its own method and settings.
    fl.cut_segment(flight, loads, room)
    flight.method = 0
    copy_numbers(made, body)
    begin_body(flight.common, body, new, 1.0 if new.gyroscopic else 0.0)
    set_rules(new, flight)
    fl.take_body(flight, loads)
    if not (same_vector(old.rotor_momentum, new.rotor_momentum) and same_vector(old.rotor_torque, new.rotor_torque)):
        fl.take_rotor(flight, _rotor_after(old, new, flight), new.rotor_torque)
    change_string(old, new, flight, before)
    return True
