# SPDX-License-Identifier: MIT
"""``rigid_proto simulate``: simulate a scene and a poke script without ROS."""

from __future__ import annotations

import argparse
import json
import shlex
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..base.command_line import Parser, number_from
from ..base.errors import InputError
from ..base.files import check_writable
from .exports import add_exports, asked, check_exports, write_exports

if TYPE_CHECKING:
    from ..export.flight_record import FlightRecord
    from ..scene.scenario import Scenario
    from ..simulation.commands import Command

DURATION_NS = 10_000_000_000
AFTER_SCRIPT_NS = 1_000_000_000
"""Duration without --duration, and least time after a script's last command [ns]."""

EXAMPLES = (
    ("rigid_proto simulate t_handle", "the bundled T-handle, 10 s"),
    (
        "rigid_proto simulate config/t_handle.yaml --script msg_examples/flip_and_poke.yaml --json",
        "a scene with scripted pokes; prints one JSON object",
    ),
    (
        'rigid_proto simulate hammer --set gravity="[0, 0, -9.81]" --record out/hammer.mcap,out/hammer.rrd',
        "with gravity; a recording, and a view of it for Rerun",
    ),
)


def add_arguments(parser: Parser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("scene", metavar="SCENE", help="a ROS parameter file, a mesh, or the name of a bundled one")
    parser.add_argument("--script", metavar="POKES.yaml", help="poke script; its times are simulated time")
    parser.add_argument(
        "--duration",
        type=number_from(0.0, 1e9),
        metavar="S",
        help="simulated seconds (default 10, or until 1 s after the script's last command if that is later)",
    )
    parser.add_argument(
        "--set", action="append", default=[], metavar="NAME=VALUE", help="change a parameter; may be repeated"
    )
    parser.add_argument(
        "--record",
        metavar="FILE",
        help="an .mcap: the recording, as a bag of the node's topics; an .rrd: a view for Rerun; or both with a comma",
    )
    parser.add_argument("--bag", metavar="FILE.mcap", help="the same as --record FILE.mcap, beside a --record FILE.rrd")
    parser.add_argument(
        "--sensitivity",
        action="store_true",
        help="simulate again, ten times as accurate, and print how far the end moves; errors of a chaotic motion grow "
        "exponentially",
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    add_exports(parser)
    parser.instead_of = _hint_for


def _hint_for(option: str) -> str:
    """Hint for a parameter that was given as an option."""
    from ..parameters.declarations import PARAMETERS

    name = option.removeprefix("--").replace("-", "_")
    return f"a parameter is set by --set {name}=VALUE" if name in PARAMETERS else ""


def run(args: argparse.Namespace) -> int:
    """Run the scene and print its final state."""
    from ..rerun_view.recorders import make_recorders
    from ..scene.scenario import read_scene
    from ..scene.scenario_run import OfflineRun, run_with_progress, summary
    from ..scene.script import read_script
    from ..scene.sensitivity import sensitivity_of
    from ..simulation.commands import nanoseconds
    from ..simulation.observer import Observers

    settings = dict(map(_parse_setting, args.set))
    scenario = read_scene(args.scene, settings, _warn)
    for warning in scenario.warnings:
        _warn(warning)
    script = read_script(args.script) if args.script else []
    last_ns = script[-1].stamp_ns if script else 0
    duration_ns = max(DURATION_NS, last_ns + AFTER_SCRIPT_NS) if args.duration is None else nanoseconds(args.duration)
    if beyond := sum(command.stamp_ns >= duration_ns for command in script):
        _warn(f"{beyond} of the script's {len(script)} commands act at or after the end, {duration_ns / 1e9:.9g} s")
    files = _recordings(scenario, args, "record" in settings)
    _check(scenario, script, args, files)
    record: FlightRecord | None = None
    if asked(args):
        from ..export.flight_record import FlightRecord

        record = FlightRecord()
    with ExitStack() as closing:
        recorders = make_recorders(",".join(files), parameters=scenario.parameters, on_error=_warn, simulated_log=True)
        for recorder in recorders:
            closing.callback(recorder.close)
        watching = [*recorders, *filter(None, [record])]
        # The ghost is simulated only for a recording.
        flight = OfflineRun(scenario, script, Observers(*watching) if watching else None)
        wall_time = run_with_progress(flight, duration_ns)
        result = summary(flight, wall_time)
    recorded = [file for file, recorder in zip(files, recorders, strict=True) if not recorder.error]
    for reason, count in flight.simulation.refused.items():
        _warn(f"commands refused: {count}, {reason}: {flight.simulation.refusals[reason]}")
    if flight.ghost is not None and flight.ghost.refusal:
        _warn(flight.ghost.refusal)
    if args.sensitivity:
        result["sensitivity"] = sensitivity_of(flight.simulation, scenario, script)
    if args.json:
        print(json.dumps(result))
    else:
        _print_summary(result, recorded)
    if record is not None:
        from ..export.flight_record import source_of_scene

        record.end_ns = flight.simulation.time_ns
        write_exports(args, record, source_of_scene(scenario, script), _warn if args.json else print)
    if floor := flight.simulation.accuracy_floor:
        _warn(f"accuracy {flight.simulation.setup.scene.accuracy:g} is not held throughout: {floor}")
    if flight.simulation.failure:
        _warn(f"stopped in the last good state: {flight.simulation.failure}")
        return 1
    # A recording that stopped has already printed why.
    return 2 if recorded != files else 1 if flight.simulation.refused else 0


def _check(scenario: Scenario, script: list[Command], args: argparse.Namespace, files: list[str]) -> None:
    """Check all that can be refused now, before the recording of an earlier run is overwritten."""
    from ..scene.scenario_run import OfflineRun
    from ..scene.sensitivity import finer

    if files:
        OfflineRun(scenario, script)
    check_exports(args)
    if args.sensitivity:
        finer(scenario)


def _sensitivity_line(attitude: float | None, position: float, wall_time: float, **finer: float) -> str:
    """One line on the sensitivity of the final state."""
    (name, value), *_ = ((name, value) for name, value in finer.items() if name in ("accuracy", "step"))
    with_it = f"with {name} {value:g} ({wall_time:.3g} s of wall time)"
    if attitude is None:
        return f" unknown: the motion stops {with_it}"
    return f" {attitude:.3g} rad and {position:.3g} m {with_it}"


def _parse_setting(text: str) -> tuple[str, object]:
    """Parse ``name=value``, with the value typed as on a ROS command line."""
    from ..base.yaml_text import scalar

    name, equals, value = text.partition("=")
    if not equals or not name:
        raise InputError("--set", text, "name=value")
    return name.strip(), scalar(value.strip())


def _recordings(scenario: Scenario, args: argparse.Namespace, set_by_option: bool) -> list[str]:
    """The files to record to, checked to be writable. Raises InputError."""
    from ..rerun_view.recorders import recording_names
    from ..scene.scene_file import check_record

    if args.bag and Path(args.bag).suffix.lower() != ".mcap":
        raise InputError("--bag", args.bag, "a file that ends in .mcap")
    if not args.record and not set_by_option:
        check_record(scenario.parameters.record)
    files = recording_names(",".join(filter(None, (args.record or scenario.parameters.record, args.bag))))
    for file in files:
        check_writable("--bag" if file == args.bag else "--record" if args.record else "record", file)
    return files


def _warn(message: str) -> None:
    print(f"rigid_proto simulate: {message}", file=sys.stderr)


def _print_summary(result: dict[str, Any], recordings: list[str]) -> None:
    def vector(name: str, unit: str = "") -> str:
        return f"{' '.join(f'{x: .9g}'.ljust(16) for x in result[name])} {unit}".rstrip()

    rows = {
        "simulated": f" {result['time_ns'] / 1e9:.9g} s in {result['wall_time']:.3g} s of wall time",
        "position": vector("position", "m"),
        "attitude xyzw": vector("orientation_xyzw"),
        "velocity": vector("linear_velocity", "m/s"),
        "ω (world)": vector("angular_velocity", "rad/s"),
        "kinetic energy": f" {result['kinetic_energy']:.9g} J",
        "potential energy": f" {result['potential_energy']:.9g} J",
        "L (world)": vector("angular_momentum", "kg m²/s"),
        "integrator": f" {result['integrator']}, {result['steps']} steps",
        "state hash": f" {result['state_hash']}",
    }
    if any(result["rotor_momentum"]):
        rows["flywheel (body)"] = vector("rotor_momentum", "N m s")
    if "sensitivity" in result:
        rows["sensitivity"] = _sensitivity_line(**result["sensitivity"])
    for name, value in rows.items():
        print(f"{name:16s} {value}")
    for file in recordings:
        view = str(Path(file).with_suffix(".rrd"))
        show, check = ["rerun", file], ["rigid_proto", "replay", file, "--verify"]
        if file != view:
            show = check if view in recordings else ["rigid_proto", "replay", file, "--record", view]
        print(f"recorded {file}; {'check' if show is check else 'show'} it with: {shlex.join(show)}")
