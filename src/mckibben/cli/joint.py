"""``joint``: two muscles on a joint, driven by commands of their valves or by set-points of angle and stiffness."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from ..errors import InputError
from ..quantities import parse, with_unit
from ..recordings.memory import STEPPED, check_memory
from ..report.figures import recording_figures, run_figures, style
from ._outputs import FIGURE, OBJECT, RECORDING, OutputKinds, Paths, write_recording
from ._progress import Progress, progress
from ._terminal import FigureLook, FigureWidth, Json, NoiseSeed, caution, pairs, print_json, table

if TYPE_CHECKING:
    from collections.abc import Callable

    from ..recordings.recording import Recording
    from ..simulation.simulation import Simulation

OUT = OutputKinds(recording=RECORDING, figure=FIGURE, result=OBJECT)
REPORTED = 1000  # steps between two reports of the progress
SHOWN = (
    "joint.angle",
    "joint.velocity",
    "joint.moment",
    "flexor.pressure",
    "extensor.pressure",
)


def run_joint(
    flexor: Annotated[
        str, typer.Argument(metavar="SPECIMEN", help="Flexor, the muscle that turns the joint to positive angles.")
    ] = "nylon",
    extensor: Annotated[
        str | None, typer.Argument(metavar="SPECIMEN", help="Extensor, its antagonist; of the same kind by default.")
    ] = None,
    play: Annotated[
        Path | None,
        typer.Option(metavar="RECORD", help="Table of valve commands over time, or a recording with its commands."),
    ] = None,
    command: Annotated[
        list[str] | None,
        typer.Option("--command", metavar="NAME=COURSE", help="Command over time, such as flexor='0, 0.3 @ 0.2 s'."),
    ] = None,
    angle: Annotated[
        str | None, typer.Option(metavar="COURSE", help="Set-points of the angle, such as '0 deg, 17 deg @ 0.3 s'.")
    ] = None,
    stiffness: Annotated[
        str, typer.Option(metavar="COURSE", help="Set-points of the stiffness, with --angle.")
    ] = "1 N*m/rad",
    duration: Annotated[
        str | None,
        typer.Option(
            metavar="TIME", help="Duration of the run, such as '2 s'; that of the table, else 1 s, by default."
        ),
    ] = None,
    arm: Annotated[str, typer.Option(metavar="SIZE", help="Moment arm of both muscles.")] = "2 cm",
    inertia: Annotated[str, typer.Option(metavar="INERTIA", help="Moment of inertia about the axis.")] = "2e-3 kg*m^2",
    supply: Annotated[
        str, typer.Option(metavar="PRESSURE", help="Gauge pressure of the supply, without --angle.")
    ] = "6 bar",
    valve: Annotated[
        str, typer.Option(metavar="VALVE", help="Valve of each muscle, without --angle.")
    ] = "MPYE-5-1-8-LF",
    start: Annotated[
        str,
        typer.Option(
            "--start-pressure", metavar="PRESSURE", help="Gauge pressure of both muscles at the start, without --angle."
        ),
    ] = "2 bar",
    period: Annotated[str, typer.Option(metavar="TIME", help="Period of the commands, without --angle.")] = "2 ms",
    seed: NoiseSeed = 0,
    width: FigureWidth = None,
    look: FigureLook = "screen",
    out: Annotated[Paths, OUT.option()] = None,
    as_json: Json = False,
) -> None:
    """Run two muscles on a joint, by valve commands over time or by set-points of angle and stiffness.

    Without --angle the commands drive the valves directly: of a spool valve -1 vents and 1 fills. With --angle the
    controller of the rig 'modern' holds angle and stiffness.

    $ mckibben joint nylon --command 'flexor=0, 0.3 @ 50 ms' --duration '0.3 s' --out joint.nc
    """
    with OUT.files(out) as files:
        with progress("running", None if angle is not None else 1.0) as bar:
            if angle is not None:
                if play is not None or command:
                    raise InputError(
                        "--angle", angle, "must stand without --play and --command, which drive the valves directly"
                    )
                recording = _held(flexor, extensor, angle, stiffness, duration, arm, inertia, seed)
            else:
                from ..simulation import Air, Joint, Simulation

                system = Joint(flexor, flexor if extensor is None else extensor, arm=arm, inertia=inertia)
                simulation = Simulation(system, Air(supply=supply, valve=valve), period=period)
                recording = _played(simulation, play, command, duration, start, bar)
        warnings = caution(*recording.meta.get("warnings", ()))
        files.write("recording", lambda path: write_recording(recording, path))
        draw = recording_figures.time_figure if angle is None else run_figures.joint_figure
        files.write("figure", lambda path: style.save(draw(recording), path))
        content = _content(recording) | {"warnings": warnings}
        files.write_result(content)
        if as_json:
            print_json(content)
        else:
            _show(recording)
            files.say()


def _held(
    flexor: str,
    extensor: str | None,
    angle: str,
    stiffness: str,
    duration: str | None,
    arm: str,
    inertia: str,
    seed: int,
) -> Recording:
    """Run the controller of a rig on set-points."""
    from ..assembly.loads import MomentArm
    from ..bench.joint_run import SPAN, joint_stand
    from ..bench.joint_run import run_joint as run

    bends = MomentArm(coefficients=np.array([parse(arm, "m", field="--arm")]), span=SPAN)
    stand = joint_stand(flexor, extensor, flexor_arm=bends, inertia=parse(inertia, "kg*m^2", field="--inertia"))
    seconds = 1.0 if duration is None else parse(duration, "s", field="--duration")
    angles, stiffnesses = _course(angle, "rad", "--angle"), _course(stiffness, "N*m/rad", "--stiffness")
    try:
        return run(stand, duration=seconds, angle=angles, stiffness=stiffnesses, seed=seed)
    except InputError as error:
        raise error.changed(field="--duration" if error.field == "duration" else error.field) from None


def _played(
    simulation: Simulation,
    play: Path | None,
    command: list[str] | None,
    duration: str | None,
    start: str,
    bar: Progress,
) -> Recording:
    """Step a simulation by commands over time."""
    courses: dict[str, Callable[[np.ndarray], np.ndarray]] = {}
    seconds = 1.0
    if play is not None:
        courses, seconds = _table(play, simulation.commands)
    for name, values in pairs(command, "--command", "flexor='0, 0.3 @ 0.2 s'").items():
        if name not in simulation.commands:
            known = simulation.commands
            raise InputError("--command", name, known=known)
        unit = next(d.unit for d in simulation.drives if d.command == name)
        courses[name] = _course(values, unit, f"--command {name}")
    if duration is not None:
        seconds = parse(duration, "s", field="--duration")
    count = round(seconds / simulation.period)
    if count < 1:
        raise InputError("--duration", with_unit(seconds, "s"), f"must be {simulation.period:g} s or more, one period")
    check_memory(seconds, simulation.period, bytes_per_sample=STEPPED, field="--duration")
    times = simulation.period * np.arange(count)
    rows = {name: course(times).tolist() for name, course in courses.items()}
    simulation.reset(pressure=start)
    for k in range(count):
        if k % REPORTED == 0:
            bar.at(k * simulation.period, seconds)
        simulation.step(**{name: values[k] for name, values in rows.items()})
    return simulation.recording()


def _table(path: Path, known: tuple[str, ...]) -> tuple[dict[str, Any], float]:
    """Commands over time from the columns of a table or a recording, and how long it is [s]."""
    from ..recordings import read_record, read_recording

    record = read_recording(path) if path.suffix.lower() == ".nc" else read_record(path)
    courses: dict[str, Any] = {}
    for name in known:
        column = next((c for c in (name, f"{name}.command") if c in record), None)
        if column is not None:
            courses[name] = _Held(record.time - record.time[0], record[column])
    if not courses:
        has = ", ".join(record.names())
        raise InputError("--play", str(path), f"must have a column named {' or '.join(known)}; it has {has}")
    return courses, float(record.time[-1] - record.time[0])


class _Held:
    """Values that hold from their times on."""

    def __init__(self, times: np.ndarray, values: np.ndarray) -> None:
        self.times, self.values = times, values

    def __call__(self, at: np.ndarray) -> np.ndarray:
        # a sample a rounding before its time belongs to it
        places = np.searchsorted(self.times, at + 1e-9, side="right") - 1
        return np.asarray(self.values[np.maximum(places, 0)], float)


def _course(text: str, unit: str, field: str) -> _Held:
    """Values over time from ``0 deg, 17 deg @ 0.3 s``: each holds from its time on, the first from the start."""
    times, values = [], []
    for k, part in enumerate(text.split(",")):
        value, at, time = part.partition("@")
        if bool(at) != (k > 0):
            raise InputError(
                field, text, "must be a value, and further ones with their times, such as '0, 0.3 @ 0.2 s'"
            )
        values.append(parse(value.strip(), unit, field=field))
        times.append(parse(time.strip(), "s", field=field) if at else 0.0)
    if any(b <= a for a, b in zip(times, times[1:], strict=False)):
        raise InputError(field, text, "must have rising times")
    return _Held(np.array(times), np.array(values))


def _content(recording: Recording) -> dict[str, Any]:
    balance = dict(recording.meta["balance"])
    return {
        "law_error": recording.meta.get("law_error"),
        "channels": recording.summary(),
        "duration": recording.duration,
        "balance": balance,
    }


def _show(recording: Recording) -> None:
    rows = []
    for name in SHOWN:
        values, unit = recording[name], recording.unit(name)
        rows.append([name, *(with_unit(float(v), unit) for v in (values[0], values.min(), values.max(), values[-1]))])
    table(recording.meta["title"], ["channel", "start", "least", "largest", "end"], rows, right=(1, 2, 3, 4))
    closed = ", ".join(f"{name} {share:.0e}" for name, share in dict(recording.meta["balance"]).items())
    typer.echo(f"\n{len(recording)} samples in {recording.duration:g} s. Missing in the balances: {closed}.")
