"""``run``: a protocol on a test machine, simulated or real, from the dry run to the recording."""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import math
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .. import batch, components, identification, muscles
from ..analysis import segments
from ..assembly import build
from ..batch import run_template
from ..bench import biological_run, rig_file, software
from ..bench import hardware as hardware_package
from ..bench import prepare as preparation
from ..bench import rig as rigs
from ..bench import run as protocol_run
from ..documents import JsonValue
from ..errors import EmptyRunError, InputError
from ..experiments import read as reading
from ..quantities import parse, with_unit
from ..recordings import calibration_file
from ..report.figures import fit_figures, recording_figures, style
from ..specimens import muscle_specimen
from ._outputs import FIGURE, OBJECT, RECORDING, OutputFiles, OutputKinds, Paths, write_recording
from ._progress import INTERRUPTED, progress
from ._terminal import (
    FigureLook,
    FigureWidth,
    FromPosterior,
    Json,
    Law,
    LockStep,
    Muscle,
    NoiseSeed,
    Plumbing,
    RigName,
    caution,
    pairs,
    print_json,
    table,
    writable,
)

if TYPE_CHECKING:
    from ..batch.posterior import PredictedRun
    from ..bench.biological_run import BiologicalSubject
    from ..bench.prepare import PreparedRun
    from ..bench.rig import Rig
    from ..experiments.dry_run import Finding
    from ..experiments.protocol import Protocol
    from ..identification import Posterior
    from ..recordings.recording import Recording

DRAWS = 40  # samples of a posterior that are run
_EXAMPLE = "pressure='5 bar', rig.plumbing.direct.tube.length='1 m' or muscle.law.passive_stiffness='3 N/cm'"

ProtocolName = Annotated[str, typer.Argument(metavar="PROTOCOL", help="Name of a shipped protocol, or a .toml file.")]
Change = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="PATH=VALUE",
        help=f"Change a value of the protocol (several separated by ', ' or ';'), of rig.* or of muscle.*: {_EXAMPLE}.",
    ),
]
Fault = Annotated[
    list[str] | None,
    typer.Option(
        "--fault",
        metavar="NAME=VALUE",
        help="Fault of the simulated rig, such as leak='0.2 l/min/bar' or clamp_slack='1 mm'.",
    ),
]
On = Annotated[
    str | None,
    typer.Option(
        "--on",
        metavar="MACHINE",
        help="Run on a real machine: serial:/dev/ttyACM0, or daq (wired as the rig file says).",
    ),
]
CalibrationFile = Annotated[
    Path | None,
    typer.Option(
        "--calibration", metavar="CALIBRATION", help="Calibration file that is applied to the measured channels."
    ),
]
OUT = OutputKinds(recording=RECORDING, figure=FIGURE, result=OBJECT)


def run_protocol(
    protocol: ProtocolName,
    muscle: Muscle,
    rig: RigName = "paper",
    law: Law = None,
    change: Change = None,
    fault: Fault = None,
    plumbing: Plumbing = None,
    seed: NoiseSeed = 0,
    step: Annotated[
        str, typer.Option(metavar="TIME", help="Largest time step of the physics, such as '20 us'.")
    ] = "50 us",
    accept_saturation: Annotated[
        bool, typer.Option("--accept-saturation", help="Run although the load cell's range will be exceeded.")
    ] = False,
    dry: Annotated[bool, typer.Option("--dry-run", help="Report violations without moving anything.")] = False,
    real_time: Annotated[bool, typer.Option("--real-time", help="Run the simulation in real time.")] = False,
    machine: On = None,
    lock_step: LockStep = False,
    log: Annotated[
        Path | None,
        typer.Option(
            metavar="OUT.mcap",
            help="Crash-safe log; runs in real time write one beside --out by default.",
        ),
    ] = None,
    calibration: CalibrationFile = None,
    from_posterior: FromPosterior = None,
    draws: Annotated[
        int, typer.Option("--draws", metavar="N", help="Number of samples of the posterior that are run.")
    ] = DRAWS,
    width: FigureWidth = None,
    look: FigureLook = "screen",
    out: Annotated[Paths, OUT.option()] = None,
    as_json: Json = False,
) -> None:
    """Run a protocol on a test machine; nothing moves until the dry run passes.

    Biological muscles need no machine: twitch, tetanus, force-frequency and stimulated-work-loop stimulate them.

    $ mckibben run work-loop --muscle nylon --set cycles=2 --out loop.nc --out loop.svg
    """
    _check_machine(machine, log, lock_step=lock_step)
    biological = biological_run.biological_subject(muscle, law=law)
    if biological is not None:
        _check_biological(
            muscle,
            rig=rig != "paper",
            step=step != "50 us",
            from_posterior=from_posterior,
            plumbing=plumbing,
            on=machine,
            calibration=calibration,
            log=log,
            real_time=real_time,
            accept_saturation=accept_saturation,
            fault=fault,
        )
        _run_biological(protocol, biological, change, out, dry=dry, as_json=as_json)
        return
    posterior = None if from_posterior is None else _posterior(from_posterior, muscle, law, draws)
    changes = [*(change or []), *_faults(fault, machine)]
    with OUT.files(out) as files:
        bench = prepared(
            protocol,
            muscle,
            rig,
            changes,
            calibration,
            law=law,
            plumbing=plumbing,
            seed=seed,
            step=_step(step),
            accept_saturation=accept_saturation,
        )
        if bench.findings or dry:
            _tell(bench, dry, as_json)
            return
        log = log or _log_beside(files, clocked=real_time or machine is not None)
        recording = _recorded(bench, machine, lock_step=lock_step, real_time=real_time, log=log)
        _write_run(files, recording, log)
        predicted = None
        if posterior is not None:
            predicted = _predicted(posterior, draws, protocol, muscle, rig, law, change, plumbing, seed, step)
        _say(files, recording, predicted, draws=draws, log=log, as_json=as_json)
    if recording.meta["result"] != "done":
        raise typer.Exit(INTERRUPTED if recording.meta["result"] == "interrupted" else 1)


# ---- arguments


def _check_machine(machine: str | None, log: Path | None, *, lock_step: bool) -> None:
    """Refuse a log or a machine that cannot be used, before anything is loaded."""
    writable("--log", log, ".mcap")
    if log is not None and log.exists():
        raise InputError("--log", str(log), "it is there already; a log is never written over")
    if lock_step and machine is None:
        raise InputError("--lock-step", None, "is allowed only with --on, for a simulated device")
    hardware_package.backends.check_connection(machine)


def _check_biological(muscle: str, **options: object) -> None:
    """Refuse options of a test machine, which a biological muscle runs without."""
    for name, value in options.items():
        if value:
            option = f"--{name.replace('_', '-')}"
            raise InputError(option, None, f"is of a test machine; {muscle} is biological and runs without one")


def _log_beside(files: OutputFiles, *, clocked: bool) -> Path | None:
    """Path of the log beside the recording, for a run in real time."""
    place = files.first("recording")
    return _unused(place.with_suffix(".mcap")) if clocked and place is not None else None


# ---- output


def _write_run(files: OutputFiles, recording: Recording, log: Path | None) -> None:
    """Write the recording; of a run that cannot be made again, a copy where there is room, and say how it ended."""
    elsewhere = None if log is None else Path(tempfile.gettempdir())
    try:
        files.write("recording", lambda path: write_recording(recording, path), elsewhere=elsewhere)
    except InputError:
        if recording.meta["result"] != "done":
            typer.echo(f"mckibben: {recording.meta['message']}", err=True)
        if log is not None and log.exists():
            typer.echo(f"mckibben: the log {log} has what was written until then", err=True)
        raise


def _say(
    files: OutputFiles,
    recording: Recording,
    predicted: PredictedRun | None,
    *,
    draws: int,
    log: Path | None,
    as_json: bool,
) -> None:
    """Print what became of a run before it is drawn, so that no drawing can hide it."""
    result = _result(recording, files.first("recording"), log)
    if predicted is not None:
        result["posterior"] = {"draws": draws, "bands": predicted.summary(), "failed": list(predicted.failed)}
    files.write_result(result)
    if as_json:
        print_json(result)
    else:
        _print(recording)
        if predicted is not None:
            _print_bands(predicted, draws)
    files.write("figure", lambda path: style.save(_figure(recording, predicted), path))
    if not as_json:
        if log is not None:
            typer.echo(f"Written: {log}")
        files.say()


def _figure(recording: Recording, predicted: PredictedRun | None) -> Any:
    """Channels of a recording over time, or the bands of the same run by the samples of a posterior."""
    if predicted is None:
        return recording_figures.time_figure(recording)
    return fit_figures.run_bands(predicted, title=recording.meta["title"])


def _posterior(path: Path, muscle: str, law: str | None, draws: int) -> Posterior:
    """The posterior in a file, of the law with which a muscle runs."""
    spec = muscle_specimen(muscle)
    samples = identification.read_posterior(path, law=law or spec.law)
    try:
        samples.rows(draws)
    except InputError as error:
        raise error.changed(field="--draws") from None
    samples.check_muscle(muscles.build.law_from_specimen(spec, samples.law), muscle)
    return samples


def _predicted(
    posterior: Posterior,
    draws: int,
    protocol: str,
    muscle: str,
    rig: str,
    law: str | None,
    change: list[str] | None,
    plumbing: str | None,
    seed: int,
    step: str,
) -> PredictedRun:
    """The run with the parameters of some samples of a posterior, simulated."""
    spec = muscle_specimen(muscle)
    template = run_template.make_template(
        reading.named_protocol(protocol, {}),
        muscle,
        rig,
        specimens={muscle: spec if law is None else dataclasses.replace(spec, law=law)},
        given=pairs(change, "--set", _EXAMPLE),
        plumbing=plumbing or "",
        noise_seed=seed,
        step=parse(step, "s", field="--step"),
        accept_saturation=True,
    )
    with progress("running the samples of the posterior", 1.0) as bar:
        return batch.posterior.predict_run(template, posterior, draws, progress=lambda done: bar.at(done, 1.0))


def _print_bands(predicted: PredictedRun, draws: int) -> None:
    """Print the 95 % intervals of each channel's lowest, mean and highest value."""
    rows = []
    for channel, reduced in predicted.summary().items():
        unit = reduced["unit"]
        intervals = [
            " to ".join(with_unit(reduced[k][end], unit) for end in ("low", "high")) for k in ("min", "mean", "max")
        ]
        rows.append([channel, *intervals])
    typer.echo("")
    table(f"95 % of {draws} samples of the posterior", ["", "lowest", "mean", "highest"], rows)
    for sentence in predicted.failed:
        typer.echo(f"note: a sample was left out: {sentence}")


def _faults(words: list[str] | None, machine: str | None) -> list[str]:
    """Convert values of ``--fault`` to those of ``--set``; a real machine takes none."""
    if words and machine is not None:
        raise InputError("--fault", None, "is of a simulated rig; a real machine has its own")
    named = pairs(words, "--fault", "leak='0.2 l/min/bar'")
    for name in named:
        if name not in rigs.FAULTS:
            raise InputError("--fault", name, known=rigs.FAULTS)
    return [f"rig.faults.{name}={value}" for name, value in named.items()]


def _run_biological(
    protocol: str, subject: BiologicalSubject, change: list[str] | None, out: Paths, *, dry: bool, as_json: bool
) -> None:
    """Run a protocol on a biological muscle, with the changes of ``--set``."""
    changes = pairs(change, "--set", _EXAMPLE)
    values = {}
    for key, words in changes.items():
        if key.startswith("rig."):
            raise InputError(f"--set {key}", words, "is of a test machine; a biological muscle runs without one")
        if key.startswith("muscle."):
            path = key.removeprefix("muscle.").removeprefix("law.")
            declared = components.paths.declaration(subject.muscle, path)
            values[path] = parse(words, declared.unit, field=f"--set {key}")
            declared.check(f"--set {key}", values[path])
    subject = subject._replace(muscle=components.paths.put(subject.muscle, values))
    wanted = _protocol(protocol, changes)
    if dry:
        biological_run.check_protocol(subject.muscle, wanted)
        duration = wanted.expand(rest_length=float(subject.muscle.rest_length)).duration
        if as_json:
            print_json({"result": "ready", "sentence": wanted.sentence(), "duration": duration, "findings": []})
        else:
            typer.echo(f"{wanted.sentence()}\n\nAt most {duration:.4g} s.")
        return
    with OUT.files(out) as files:
        recording = biological_run.run_biological(wanted, subject)
        files.write("recording", lambda path: write_recording(recording, path))
        result: dict[str, JsonValue] = {
            "result": recording.meta["result"],
            "file": None if not files["recording"] else str(files.first("recording")),
            "summary": recording.summary(),
            "samples": len(recording),
            **{name: [one._asdict() for one in each] for name, each in _stimulated(recording).items()},
            **{key: recording.meta[key] for key in ("message", "steps", "maximum_tension")},
        }
        files.write_result(result)
        files.write("figure", lambda path: style.save(recording_figures.time_figure(recording), path))
        if as_json:
            print_json(result)
        else:
            _print_biological(recording)
            files.say()


def _stimulated(recording: Recording) -> dict[str, Any]:
    """Contractions and work loops of a recording, none where it shows none."""
    each: dict[str, Any] = {"contractions": (), "loops": ()}
    for name, read in (("contractions", recording.stimulated_contractions), ("loops", recording.stimulated_loops)):
        with contextlib.suppress(InputError):
            each[name] = read()
    return each


def _print_biological(recording: Recording) -> None:
    _print(recording)
    each, full = _stimulated(recording), recording.meta["maximum_tension"]
    varied = segments.varied(recording)

    def case(one: Any) -> str:
        return ", ".join(one.case[name] for name in varied) or one.label

    if each["contractions"]:
        rows = []
        for c in each["contractions"]:
            times = _number(1e3 * c.time_to_peak), _number(1e3 * c.half_relaxation_time)
            rows.append(
                [case(c), f"{c.peak:.4g}", f"{c.peak / full:.3f}", *times, _number(c.mean), _number(1e2 * c.ripple)]
            )
        heads = ["contraction", "peak, N", "of Fmax", "to peak, ms", "half relaxation, ms", "mean, N", "ripple, %"]
        typer.echo("")
        table("", heads, rows, right=range(1, 7))
    if each["loops"]:
        loops = [[case(o), str(o.cycles), f"{1e3 * o.work:.4g}", f"{1e3 * o.power:.4g}"] for o in each["loops"]]
        typer.echo("")
        table("", ["work loop", "cycles", "net work per cycle, mJ", "power, mW"], loops, right=range(1, 4))


def _number(value: float) -> str:
    return f"{round(value, 4):.4g}" if math.isfinite(value) else "\N{EN DASH}"


def _recorded(
    bench: PreparedRun, machine: str | None, *, lock_step: bool, real_time: bool, log: Path | None
) -> Recording:
    """Run a prepared protocol with a progress bar; Ctrl-C vents and keeps the samples so far."""
    caution(*bench.cautions)
    button, period = software.interlocks.EmergencyStop(), 1.0 / bench.plan.sample_rate
    with (
        progress("running", bench.plan.duration, guarded=False) as bar,
        hardware_package.backends.connected(machine, bench.rig, period, lock_step=lock_step) as hardware,
        button.on_signals(),
    ):
        try:
            return protocol_run.run(
                bench, progress=bar.at, stop=button, real_time=real_time, hardware=hardware, log=log, ask=ask_person
            )
        except EmptyRunError as error:
            if not button():
                raise
            typer.echo(f"mckibben: {error}", err=True)
            raise typer.Exit(INTERRUPTED) from None


def prepared(
    protocol: str,
    muscle: str,
    rig: str,
    change: list[str] | None,
    calibration: Path | None,
    *,
    law: str | None = None,
    **options: JsonValue,
) -> PreparedRun:
    """Prepare a run from the options of the command line."""
    changes = pairs(change, "--set", _EXAMPLE)
    spec = muscle_specimen(muscle)
    unit = build.rig_unit(spec, law=law)
    values = {}
    for key, words in changes.items():
        if key.startswith("muscle."):
            path = key.removeprefix("muscle.")
            declared = build.unit_parameter(unit, path)
            values[path] = parse(words, declared.unit, field=f"--set {key}")
            declared.check(f"--set {key}", values[path])
    spec, unit = build.with_parameters(spec, unit, values, law=law)
    on = chosen_rig(rig, changes, calibration)
    return preparation.prepare(_protocol(protocol, changes), muscle=spec, unit=unit, rig=on, **options)


def _protocol(name: str, changes: Mapping[str, str]) -> Protocol:
    """The protocol with its own values of ``--set``."""
    try:
        return reading.changed_protocol(
            name, {k: v for k, v in changes.items() if not k.startswith(("rig.", "muscle."))}
        )
    except InputError as error:
        raise error.changed(field=error.field.replace("changes.", "--set ")) from None


def chosen_rig(name: str, changes: Mapping[str, str], calibration: Path | None = None) -> Rig:
    """Load a rig with the values of ``--set rig.*``, and its calibration."""
    on = rig_file.rig(name, {k.removeprefix("rig."): v for k, v in changes.items() if k.startswith("rig.")})
    if calibration is None:
        return on

    return on.calibrated(calibration_file.read_calibration(calibration))


def _unused(path: Path) -> Path:
    """Path of a file that does not exist yet, so that the log of an earlier run is never overwritten."""
    names = (path.with_stem(f"{path.stem}-{i}") if i > 1 else path for i in itertools.count(1))
    return next(p for p in names if not p.exists())


def ask_person(task: str) -> None:
    """Wait until the operator has done something."""
    if not sys.stdin.isatty():
        raise InputError("person", None, f"is needed at the keyboard: the protocol asks the operator to {task}")
    typer.prompt(f"Please {task}, then press Enter", default="", show_default=False, err=True)


def _step(words: str) -> float:
    value = parse(words, "s", field="--step")
    if not 1e-7 <= value <= 1e-3:
        raise InputError("--step", None, f"must be between 0.1 us and 1 ms, got {value:g} s")
    return value


def _tell(bench: PreparedRun, dry: bool, as_json: bool) -> None:
    """Print the result of the dry run; the exit code is 2 if it has findings."""
    findings: list[Finding] = list(bench.findings)
    said = caution(*bench.cautions) if dry else []
    if as_json and dry:
        keys = ("step", "path", "case", "field", "value", "allowed", "sentence")
        print_json(
            {
                "result": "refused" if findings else "ready",
                "sentence": bench.protocol.sentence(),
                "duration": bench.plan.duration,
                "plumbing": bench.layout,
                "rig": bench.rig.name,
                "findings": [{k: getattr(f, k) for k in keys} for f in findings],
                "warnings": [*(f.sentence for f in bench.accepted), *said],
            }
        )
    elif dry:
        typer.echo(bench.protocol.sentence())
        typer.echo(f"\nAt most {bench.plan.duration:.4g} s on the rig {bench.rig.name}, plumbing {bench.layout}.")
    for warning in bench.accepted:
        typer.echo(f"mckibben: accepted: {warning.sentence}", err=True)
    for finding in findings:
        typer.echo(f"mckibben: {finding.sentence}", err=True)
    if findings:
        raise typer.Exit(2)


def _result(recording: Recording, out: Path | None, log: Path | None) -> dict[str, JsonValue]:
    meta = recording.meta
    keys = ("message", "events", "steps", "saturation", "friction", "timing", "seed", "rig", "plumbing", "law_error")
    result = {k: meta[k] for k in (*keys, "deadlines", "hardware", "calibration") if k in meta}
    return {
        "result": meta["result"],
        "file": None if out is None else str(out),
        "summary": recording.summary(),
        "log": None if log is None else str(log),
        "balance": {k: meta["balance"].get(k) for k in ("mass", "energy")},
        "accounts": meta["balance"],
        "samples": len(recording),
        "warnings": [c.text for c in recording.cautions],
        **result,
    }


def _print(recording: Recording) -> None:

    meta = recording.meta
    rows = [
        [name, *(with_unit(s[k], s["unit"]) for k in ("min", "mean", "max"))]
        for name, s in recording.summary().items()
        if s["kind"] == "measured"
    ]
    title = f"{meta['title']}: {meta['specimen']}" + (f" on the rig {meta['rig']}" if "rig" in meta else "")
    table(title, ["measured", "lowest", "mean", "highest"], rows)
    closed = meta.get("balance")
    typer.echo(f"\n{len(recording)} samples. {meta['message']}")
    if closed:
        typer.echo(f"Balances: mass {closed['mass']:.1e}, energy {closed['energy']:.1e} of what went through.")
    if "deadlines" in meta:
        late = meta["deadlines"]
        half, most, nearly, largest = (1e3 * x for x in late["percentiles"])
        typer.echo(
            f"By the clock: {late['samples']} samples, {late['late']} late by a tenth of a period or more; lateness "
            f"{half:.3g} ms (median), {most:.3g} (99 %), {nearly:.3g} (99.9 %), {largest:.3g} (largest)."
        )
    caution(*(c.text for c in recording.cautions if c.parameter != "warnings"))  # which were said before it began
    for event in meta["events"]:
        typer.echo(f"{event['time']:.4g} s: {event['text']}")
