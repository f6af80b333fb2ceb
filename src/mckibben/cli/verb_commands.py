"""Commands of verbs: what the command line adds to a public function, nearly all of it words."""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import math
import re
import tempfile
import warnings
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from .. import documents, specimens
from .._version import __version__
from ..errors import EmptyRunError, InputError, PlausibilityWarning, StageError
from ..quantities import from_si, shown_unit
from ..report.figures import (
    analysis_figures,
    circuit_diagram,
    comparison_figures,
    control_figures,
    energy_figures,
    fit_figures,
    muscle_figures,
    recording_figures,
    run_figures,
    study_figures,
)
from ..studies import comparison, sizing, tube_study
from . import _outputs, _progress
from ._outputs import FIGURE, OBJECT, RECORDING, REPORT, SPECIMEN, TABLE, OutputFiles, OutputKinds, write_recording
from ._terminal import CHANGE, ask_person, caution, print_json
from ._verb import Alternative, Shorthand, VerbCommand, VerbsCommand, Written
from ._verb import show as show_answer

if TYPE_CHECKING:
    from ..analysis.frequency import ChannelResponse
    from ..analysis.repeatability import CourseRepeatability
    from ..bench.prepare import PreparedRun
    from ..report.figures.page_charts import Figure
    from ..studies.characterisation.verb import CharacterisationPlan
    from ..studies.circuits import CircuitDescription, CircuitResponse
    from ..studies.comparison import MuscleTable
    from ..studies.description import BraidDescription, MuscleDescription
    from ..studies.fitting import FittedTables
    from ..studies.joint_run import JointRecording
    from ..studies.next_measurement import NextMeasurement, NextReadings
    from ..studies.rig_run import RunPlan, RunRecording, StimulatedRecording
    from ..studies.sizing import Sizing

ANSWERED = OutputKinds(table=TABLE, result=OBJECT)
STUDY = OutputKinds(figure=FIGURE, result=OBJECT)
RECORDED = OutputKinds(recording=RECORDING, figure=FIGURE, result=OBJECT)
DRAWN = OutputKinds(figure=FIGURE, table=TABLE, result=OBJECT)


muscles = VerbCommand("studies.description:list_muscles", ANSWERED, ("muscles --out muscles.csv",))


def _draw_law(answer: MuscleDescription) -> Figure:
    if answer.specimen.kind != "mckibben":
        raise InputError("--out", answer.specimen.id, "curves are drawn for McKibben muscles only")
    return muscle_figures.law_curves(answer.law, title=answer.specimen.title)


show = VerbCommand(
    "studies.description:describe_muscle",
    OutputKinds(figure=FIGURE, table=TABLE, result=OBJECT, specimen=SPECIMEN),
    ("show nylon --out nylon.svg", "show nylon --data-sheet nylon.html"),
    draw=_draw_law,
    writes={"specimen": lambda answer, path: specimens.save_specimen(answer.specimen, path)},
    written={
        "data-sheet": Written(
            REPORT, "Write a data sheet on one page, in the terms of makers' sheets, into this .html or .pdf file.",
            lambda answer, path: answer.data_sheet(path),
        )
    },
)  # fmt: skip


def _save_braid(answer: BraidDescription, path: Path) -> None:
    heading = f"computed by mckibben {__version__} from the dimensions of a braid; not measured"
    specimens.save_specimen(answer.specimen, path, heading=heading)


def _name_of_braid(given: Mapping[str, Any], files: OutputFiles) -> dict[str, str]:
    path = files.first("specimen")
    return {} if path is None else {"name": re.sub(r"[^A-Za-z0-9._-]+", "-", path.stem).strip("-.") or "braid"}


braid = VerbCommand(
    "studies.description:describe_braid",
    OutputKinds(specimen=SPECIMEN, result=OBJECT),
    (
        "braid --length '300 mm' --angle '25 deg' --diameter '12 mm' --thread '0.25 mm' --bladder '1 mm' --out my.toml",
    ),
    options={
        "rest_length": "length", "braid_angle": "angle", "thread_diameter": "thread", "bladder_thickness": "bladder",
    },
    writes={"specimen": _save_braid},
    from_files=_name_of_braid,
    note="Every other command takes the specimen.",
)  # fmt: skip
parts = VerbCommand(
    "studies.parts:find_parts",
    ANSWERED,
    ("parts valves --min-flow '300 l/min' --out valves.csv",),
    note="A table has one row per number, in SI units.",
)


def _check_described(given: Mapping[str, Any], files: OutputFiles) -> None:
    if given["protocol"] is None and any(files[kind] for kind in files):
        raise InputError("--out", None, "is allowed only after the name of one")


protocols = VerbCommand(
    "experiments.description:describe_protocol",
    OutputKinds(protocol=SPECIMEN, result=OBJECT),
    ("protocols work-loop --set cycles=3 --out my.toml",),
    options={"changes": "set"},
    writes={"protocol": lambda answer, path: documents.write_text(path, answer.toml.rstrip("\n") + "\n")},
    pairs={"changes": "pressure='1 bar, 3 bar'"},
    check=_check_described,
)


tension = VerbCommand(
    "studies.tension:tension",
    OutputKinds(table=TABLE, result=OBJECT),
    (
        "tension nylon --length '12 cm' --pressure '5 bar'",
        "tension nylon --contraction '0:20:5 %' --pressure '1:5 bar' --out map.csv",
    ),
    options={"target_tension": "for", "parameters": "set", "posterior": "from_posterior"},
)


energy = VerbCommand(
    "analysis.energy.working_cycles:energy",
    OutputKinds(figure=FIGURE, table=TABLE, result=OBJECT),
    ("energy nylon --pressure '5 bar' --cycle maximal --curve --out efficiency.svg",),
    options={"cycles": "cycle", "stretched_length": "stretched", "curves": "curve", "parameters": "set"},
    shorthands={"no_friction": Shorthand("friction", "0 N", "Compute the cycles without friction.")},
    draw=lambda answer: answer.plot().figure,
)


def _save_sized(answer: Sizing, path: Path) -> None:
    specimens.save_specimen(answer.to_specimen(), path, heading=f"sized by mckibben {__version__}; not measured")


size = VerbCommand(
    "studies.sizing.size:size",
    OutputKinds(figure=FIGURE, specimen=SPECIMEN, table=TABLE, result=OBJECT),
    ("size --force '50 N' --stroke '3 cm' --pressure '5 bar' --cycles '1 Hz' --working-time '8 h' --out map.svg",),
    options={"rate": "cycles", "tube_length": "tube", "posterior": "from_posterior"},
    required=("stroke", "pressure"),
    draw=lambda answer: answer.plot().figure,
    writes={"specimen": _save_sized},
    written={
        "circuit": Written(
            (".toml",), "Write the chosen muscle, valve and tube as a circuit into this .toml file.",
            lambda answer, path: documents.write_text(path, sizing.toml_of(answer.to_circuit())),
        )
    },
    top=5,
    doing=("sizing", lambda given: sizing.stages(lines=bool(given["lines"]), speed="speed" in given)),
    failed=2,
)  # fmt: skip


diagnose = VerbCommand(
    "studies.diagnosis.fault_fit:diagnose", OutputKinds(table=TABLE, result=OBJECT), ("diagnose work-loop.nc",)
)


def _draw_compared(answer: MuscleTable) -> Figure:
    if not answer.muscles:
        raise InputError("--out", None, "needs a specimen: a recording alone has no law to draw")
    return comparison_figures.table_figure(answer)


def _compare_stages(given: Mapping[str, Any]) -> int | None:
    named = [specimens.muscle_specimen(name) for name in given.get("muscles", ())]
    return comparison.stages(named, protocols=given["protocols"], match=given.get("match")) or None


compare = VerbCommand(
    "studies.comparison.side_by_side:compare",
    OutputKinds(report=REPORT, figure=FIGURE, table=TABLE, result=OBJECT),
    ("compare nylon fast-fibre --out compared.csv --out compared.svg",),
    options={"recordings": "recording"},
    draw=_draw_compared,
    writes={"report": lambda answer, path: answer.report(path)},
    doing=("comparing", _compare_stages),
    pairs={"stimulation": "phase='60 deg' or duty=0.3"},
)


# ---- test machines


def _log_beside(given: Mapping[str, Any], files: OutputFiles) -> dict[str, str]:
    """The log beside the recording, for a run in real time; that of an earlier run is never written over."""
    path = files.first("recording")
    if given["log"] is not None or path is None or not (given["real_time"] or given["machine"] is not None):
        return {}
    names = (path.with_stem(f"{path.stem}-{i}") if i > 1 else path for i in itertools.count(1))
    return {"log": str(next(one for one in (name.with_suffix(".mcap") for name in names) if not one.exists()))}


@contextlib.contextmanager
def _running(given: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    from ..bench.software.interlocks import EmergencyStop
    from ..studies.rig_run import RUNNING

    button = EmergencyStop()

    @contextlib.contextmanager
    def telling(title: str, run: PreparedRun) -> Iterator[Callable[[float, float], None]]:
        if title != RUNNING:
            with _progress.progress(title, 1.0) as bar:
                yield bar.at
            return
        caution(*run.cautions)
        with _progress.progress(title, run.plan.duration, guarded=False) as bar, button.on_signals():
            yield bar.at

    try:
        yield {"stop": button, "ask": ask_person, "telling": telling}
    except EmptyRunError as error:
        if not button():
            raise
        typer.echo(f"mckibben: {error}", err=True)
        raise typer.Exit(_progress.INTERRUPTED) from None


def _keep_run(answer: RunPlan | RunRecording | StimulatedRecording, files: OutputFiles) -> bool:
    """Write the recording; of a run that cannot be made again, a copy where there is room, and say how it ended."""
    from ..studies.rig_run import RunPlan

    if isinstance(answer, RunPlan):
        return False
    record, log = answer.recording, getattr(answer, "log", None)
    try:
        elsewhere = None if log is None else Path(tempfile.gettempdir())
        files.write("recording", lambda path: write_recording(record, path), elsewhere=elsewhere)
    except InputError:
        if record.meta["result"] != "done":
            typer.echo(f"mckibben: {record.meta['message']}", err=True)
        if log is not None and Path(log).exists():
            typer.echo(f"mckibben: the log {log} has what was written until then", err=True)
        raise
    return True


def _draw_recorded(answer: RunRecording | StimulatedRecording) -> Figure:
    record, bands = answer.recording, getattr(answer, "predicted", None)
    if bands is None:
        return recording_figures.time_figure(record)
    return fit_figures.run_bands(bands, title=record.meta["title"])


def _code_of_run(answer: RunPlan | RunRecording) -> int:
    from ..studies.rig_run import RunPlan

    if isinstance(answer, RunPlan):
        return 2
    return _progress.INTERRUPTED if answer.recording.meta["result"] == "interrupted" else 1


run = VerbCommand(
    "studies.rig_run:record_run",
    RECORDED,
    ("run work-loop --muscle nylon --set cycles=2 --out loop.nc --out loop.svg",),
    options={"changes": "set", "faults": "fault", "machine": "on", "posterior": "from_posterior"},
    pairs={"changes": CHANGE, "faults": "leak='0.2 l/min/bar'"},
    from_files=_log_beside,
    around=_running,
    keep=_keep_run,
    draw=_draw_recorded,
    failed=_code_of_run,
)


def _check_characterised(given: Mapping[str, Any], files: OutputFiles) -> None:
    if given["out"] is None and not given["dry_run"]:
        raise InputError("--out", None, "is missing: the folder of recordings, report and specimen")


@contextlib.contextmanager
def _characterising(given: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    from ..bench.software.interlocks import EmergencyStop
    from ..studies.characterisation.verb import place_of

    button, bars = EmergencyStop(), []

    @contextlib.contextmanager
    def begun(intended: CharacterisationPlan) -> Iterator[None]:
        if given["as_json"] and given["dry_run"]:
            print_json(intended.to_dict())
        else:
            show_answer(intended)
        if given["dry_run"]:
            raise typer.Exit

        def kept() -> str:
            stages, out = [*intended.seconds], Path(given["out"])
            done = [name for name in stages if place_of(out, name).exists()]
            if not done:
                return "no stage was done, and nothing was kept"
            return f"{', '.join(done)} of {len(stages)} stages are in {out}, and the same command goes on"

        with (
            _progress.progress("characterising", intended.total, saved=kept, guarded=False) as bar,
            button.on_signals(),
        ):
            bars.append(bar)
            try:
                yield
            except StageError as error:
                if not button():
                    raise
                typer.echo(f"mckibben: interrupted in stage {error.stage}; vented; {kept()}", err=True)
                raise typer.Exit(_progress.INTERRUPTED) from None

    yield {"begun": begun, "stop": button, "progress": lambda done, total, stage: bars[-1].reached(done, total, stage)}


characterise_unknown = VerbCommand(
    "studies.characterisation.verb:characterise",
    OutputKinds(),
    (
        "characterise --muscle nylon --rig modern --max-pressure '5 bar' --out nylon",
        "characterise --like festo-10mm --muscle mine.toml --out mine",
    ),
    options={"rig": "rig", "laws": "law", "machine": "on"},
    pairs={"known": "wall_thickness='0.5 mm'"},
    flags={"dry_run": "Print the stages and their times without moving anything."},
    check=_check_characterised,
    around=_characterising,
)

characterise_like = dataclasses.replace(
    characterise_unknown,
    place="studies.characterisation.readings:characterise_like",
    options={"like": "like", "rig": "rig", "machine": "on"},
    pairs={},
)
characterise = VerbsCommand(
    characterise_unknown, (Alternative(characterise_like, "--like", lambda given: given["like"] is not None),)
)


# ---- circuits

TUBE = "elements.tube.length='2 m'"


def _draw_circuit(answer: CircuitDescription) -> Figure:
    plan = answer.plan
    room = float(plan.environment.pressure_abs)
    pressures = {name: start + room for name, start in plan.starts.items()}
    # what the file says of a muscle; a junction's own volume is nothing that a person gave
    said = {
        name: "" if n.needs_volume else "\n".join(n.words.split(", ")[:2])
        for name, n in plan.nodes.items()
        if n.needs_volume or n.law is not None
    }
    return circuit_diagram.draw(plan.circuit, title=plan.title, pressures=pressures, subtitles=said)


def _write_recording(answer: Any, path: Path) -> None:
    write_recording(answer.recording, path)


@contextlib.contextmanager
def _circuit_bar(given: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    with _progress.progress("running", 1.0, guarded=False) as bar:  # it ends by itself with what it has
        yield {"progress": bar.at}


def _draw_circuit_response(answer: CircuitResponse) -> Figure:
    about = f"about rest at {answer.about}" if answer.about else ""
    titles = analysis_figures.BodeTitles(f"{answer.title}: {answer.target} over {answer.source}", about, answer.unit)
    return analysis_figures.bode_figure(answer.response, titles, cutoff=answer.response.cutoff())


def _circuit_evaluations(given: Mapping[str, Any]) -> int:
    from ..identification.circuit_fit import EVALUATIONS

    return EVALUATIONS


circuit_show = VerbCommand(
    "studies.circuits:describe_circuit",
    STUDY,
    ("circuit show bench.toml --out bench.svg",),
    options={"changes": "set"},
    pairs={"changes": TUBE},
    draw=_draw_circuit,
)
circuit_run = VerbCommand(
    "studies.circuits:record_circuit",
    RECORDED,
    ("circuit run bench.toml --set elements.tube.length='2 m' --out bench.nc --out bench.svg",),
    options={"changes": "set"},
    pairs={"changes": TUBE},
    draw=lambda answer: run_figures.run_figure(answer.recording),
    writes={"recording": _write_recording},
    around=_circuit_bar,
    failed=_progress.INTERRUPTED,
)
circuit_frequency = VerbCommand(
    "studies.circuits:circuit_response",
    DRAWN,
    ("circuit frequency bench.toml --input valve.command --output muscle.pressure_abs --out bode.svg",),
    options={"source": "input", "target": "output", "lowest": "from", "highest": "to", "changes": "set"},
    pairs={"changes": TUBE},
    draw=_draw_circuit_response,
    doing=("settling", lambda given: None),
)
circuit_fit = VerbCommand(
    "studies.circuits:fit_circuit_file",
    DRAWN,
    (
        "circuit fit bench.toml measured.csv --free elements.tube.friction_scale --out fit.svg",
        "circuit fit bench.toml measured.csv --free elements.valve.conductance --posterior --out fit.json",
    ),
    options={"changes": "set"},
    pairs={
        "changes": TUBE,
        "start": "elements.tube.ends=2",
        "columns": "tank.pressure=2",
        "units": "tank.pressure=kPa",
    },
    draw=lambda answer: run_figures.overview(answer.fit, answer.trials, title=answer.title),
    doing=("fitting", _circuit_evaluations),
)


# ---- joint and sweep


def _draw_joint(answer: JointRecording) -> Figure:
    draw = run_figures.joint_figure if answer.controlled else recording_figures.time_figure
    return draw(answer.recording)


@contextlib.contextmanager
def _joint_bar(given: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    with _progress.progress("running", None if "angle" in given else 1.0) as bar:
        yield {"progress": bar.at}


joint = VerbCommand(
    "studies.joint_run:record_joint",
    RECORDED,
    ("joint nylon --command 'flexor=0, 0.3 @ 50 ms' --duration '0.3 s' --out joint.nc",),
    options={"commands": "command"},
    pairs={"commands": "flexor='0, 0.3 @ 0.2 s'"},
    draw=_draw_joint,
    writes={"recording": _write_recording},
    around=_joint_bar,
)


@contextlib.contextmanager
def _control_bar(given: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    with _progress.progress("controllers", 1.0) as bar:
        yield {"progress": lambda done, total: bar.reached(done, total, f"{done} of {total} runs")}


control = VerbCommand(
    "control.scores:score",
    DRAWN,
    ("control --controller memory-inverse,mpc --bench B1 --reference R2 --plants 2 --out control.svg",),
    options={"controller": "controller"},
    draw=lambda answer: control_figures.control_figure(answer),
    around=_control_bar,
)


@contextlib.contextmanager
def _sweep_bar(given: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    if given["dry_run"]:
        yield {}
        return
    kept = {"variants": 0, "of": 0}

    def saved() -> str:
        if not kept["variants"]:
            return f"no variant was done{'; ' + str(given['out']) + ' is as it was' if not kept['of'] else ''}"
        done = f"{kept['variants']:,} of {kept['of']:,} variants are in {given['out']}"
        return f"{done}, and the same command goes on with the rest"

    with _progress.progress("sweep", 1.0, saved=saved) as bar:

        def tell(done: float, total: int) -> None:
            bar.reached(done, total, f"{math.floor(done):,} of {total:,} variants")

        yield {"progress": tell, "stored": lambda count, total: kept.update(variants=count, of=total)}


sweep = VerbCommand(
    "studies.sweep_run:sweep_variants", OutputKinds(), ("sweep tubes.toml --out results",), around=_sweep_bar
)


# ---- fits


def _draw_fits(answer: FittedTables) -> Figure:
    bands = answer.bands()
    return fit_figures.overview(answer.rankings) if bands is None else fit_figures.bands(bands)


def _save_fits(answer: FittedTables, path: Path) -> str:
    with warnings.catch_warnings():  # the answer has the caution that saving repeats
        warnings.simplefilter("ignore", PlausibilityWarning)
        answer.rankings[0].save(path)
    return answer.rankings[0].saved_laws()


def _check_fits(given: Mapping[str, Any], files: OutputFiles) -> None:
    if files["specimen"] and len(given["tables"]) > 1 and not given["runs"]:
        raise InputError("--out", str(files["specimen"][0]), "is allowed only with one table")


def _fit_stages(given: Mapping[str, Any]) -> int:
    from ..identification import SCHEMES
    from ..identification.shared_hysteresis import FRICTIONS
    from ..muscles.laws import LAWS

    laws = given.get("law") or ["all"]
    count = sum(name != "all" for name in laws) + (len(LAWS) if "all" in laws else 0)
    forms = 2 * len(tuple(FRICTIONS)) if given.get("hysteresis") else 0
    tables = 1 if given.get("runs") else len(given["tables"])
    samples = 0 if not given.get("posterior") else count if len(laws) > 1 else 1
    return int(tables * (count * (1 + len(SCHEMES)) + forms + samples))


fit_tables = VerbCommand(
    "studies.fitting:fit_tables",
    OutputKinds(report=REPORT, figure=FIGURE, specimen=SPECIMEN, table=TABLE, result=OBJECT),
    (
        "fit measured.csv --rest-length '300 mm' --out report.html --out my-muscle.toml",
        "fit measured.csv --rest-length '300 mm' --law linear_threshold --posterior --out fit.json",
        "fit loop.csv --friction bouc_wen --posterior --out loop.svg",
        "fit loop.csv --friction all --creep",
        "fit three.csv --law seated_braid --hysteresis 'runs/*.csv' --out muscles.toml",
    ),
    options={"known": "set"},
    required=("tables",),
    draw=_draw_fits,
    writes={"report": lambda answer, path: answer.report(path), "specimen": _save_fits},
    doing=("fitting", _fit_stages),
    check=_check_fits,
)
fit_friction = VerbCommand(
    "studies.fitting:fit_friction",
    DRAWN,
    ("fit loop.csv --friction dahl",),
    options={"model": "friction", "known": "set"},
    draw=lambda answer: fit_figures.loop_bands(answer.fit, answer.samples),
)
fit_printed = VerbCommand("identification.constraints:fit_printed", ANSWERED, ("fit printed.toml",))
fit = VerbsCommand(
    fit_tables,
    (
        Alternative(fit_friction, "--friction", lambda given: given["model"] is not None),
        Alternative(
            fit_printed,
            "a .toml file of constraints",
            lambda given: any(str(one).endswith(".toml") for one in given["tables"]),
        ),
    ),
)


def _write_protocol(answer: NextMeasurement | NextReadings, path: Path) -> None:
    from ..studies.next_measurement import NextReadings

    if isinstance(answer, NextReadings):
        raise InputError("--out", str(path), "is a protocol, which is made of a fit only: give a table or a result")
    documents.write_text(path, answer.chosen.protocol())


next_measurement = VerbCommand(
    "studies.next_measurement:next_measurement",
    OutputKinds(protocol=(".toml",), table=TABLE, result=OBJECT),
    (
        "next --from fit.json --rig modern --budget '5 min' --out next.toml",
        "next --from fit.json --laws gas_spring,linear_threshold --out next.toml",
        "next --like festo-10mm --set rest_length='132 mm' --length '115 mm'",
    ),
    options={"fit": "from", "parameters": "set"},
    writes={"protocol": _write_protocol},
)


# ---- files and recordings

TIMES = {"start": "from", "end": "to"}


def _draw_response(answer: ChannelResponse) -> Figure:
    titles = analysis_figures.BodeTitles(f"{answer.target} over {answer.source}", answer.title, answer.unit)
    return analysis_figures.bode_figure(answer.response, titles, cutoff=answer.response.cutoff())


def _draw_courses(answer: CourseRepeatability) -> Figure:
    shown = shown_unit(answer.unit)
    scaled = answer.compared._replace(courses=from_si(1.0, answer.unit, shown) * answer.compared.courses)
    channel = f"{answer.channel.replace('.', ' ').replace('_', ' ').capitalize()}, {shown}"
    over = "Phase of the cycle" if answer.each == "cycle" else "Time, s"
    return analysis_figures.repeatability_figure(scaled, title=answer.title, channel=channel, over=over)


read = VerbCommand(
    "analysis.description:describe_file",
    ANSWERED,
    ("read measured.csv --rest-length '300 mm' --unit force=N --out map.csv",),
    options={"kind": "as"},
)
record_show = VerbCommand("analysis.description:describe_recording", ANSWERED, ("record show loop.nc",))
record_energy = VerbCommand(
    "analysis.energy_accounts:energy_account",
    DRAWN,
    ("record energy loop.nc --out energy.svg",),
    options=TIMES,
    draw=lambda answer: energy_figures.energy_flow_figure(answer, **({"title": answer.title} if answer.title else {})),
)
record_frequency = VerbCommand(
    "analysis.frequency:channel_response",
    DRAWN,
    ("record frequency chirp.nc --input command.pressure --output tension --out response.svg",),
    options=TIMES | {"source": "input", "target": "output"},
    draw=_draw_response,
)
ROLES = {name: f"{name}_channel" for name in ("length", "tension", "pressure", "command")}  # of channels


def _question(name: str, *examples: str) -> VerbCommand:
    return VerbCommand(f"analysis.questions:{name}", ANSWERED, examples, options=TIMES | ROLES)


record_loops = _question("loops", "record loops loop.nc --skip 1", "record loops pulls.csv --tension-channel cell")
record_work = _question("work", "record work loop.nc --out work.csv")
record_stiffness = _question("stiffness", "record stiffness loop.nc")
record_steps = _question("steps", "record steps steps.nc --command-channel valve.command")
record_leak = _question("leak", "record leak shut.csv --gas-volume '200 ml' --from '40 s'")
record_contraction = VerbCommand(
    "analysis.lever_answers:contraction",
    ANSWERED,
    ('record contraction twitch.ddf --rising "10 %, 50 %, 90 %"',),
    options={"force": "force_channel", "stimulus": "stimulus_channel"},
)
record_work_loops = VerbCommand(
    "analysis.lever_answers:work_loops",
    ANSWERED,
    ("record work-loops workloop.ddf --cut peak --keep 4-6 --gear-ratio 2",),
    options={"frequency": "cycle_frequency", "length": "length_channel", "force": "force_channel"},
)
record_repeatability = VerbCommand(
    "analysis.repeatability:repeatability",
    DRAWN,
    ("record repeatability loop.nc --skip 1 --out cycles.svg",),
    options=TIMES,
    draw=_draw_courses,
)


# ---- calibrations

calibrate_show = VerbCommand(
    "recordings.calibration_file:describe_calibration", OutputKinds(result=OBJECT), ("calibrate show calibration.toml",)
)
calibrate_apply = VerbCommand(
    "recordings.calibration_file:apply_calibration",
    OutputKinds(recording=_outputs.KEPT_RECORDING),
    ("calibrate apply raw.nc --calibration calibration.toml --out true.nc",),
    required=("out",),
    writes={"recording": _write_recording},
)


# ---- studies


def _tube_stages(given: Mapping[str, Any]) -> int:
    if not given["quick"]:
        return tube_study.stages()
    return tube_study.stages(seeds=tube_study.QUICK_SEEDS, thermals=tube_study.QUICK_THERMALS)


study_tube = VerbCommand(
    "studies.tube_study:tube_study",
    STUDY,
    ("study tube --quick --out tube.svg",),
    draw=lambda answer: study_figures.tube_figure(answer),
    doing=("tube study", _tube_stages),
)
