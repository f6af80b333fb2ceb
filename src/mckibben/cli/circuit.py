"""``circuit``: pneumatic circuits from TOML files: drawings, runs, fits and frequency responses."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from .. import components, identification, recordings
from ..analysis import frequency as response_module
from ..assembly import circuit_file
from ..assembly import linearise as linearisation
from ..assembly import sentence as sentences_module
from ..bench import circuit_run
from ..documents import JsonValue
from ..errors import InputError
from ..pneumatics import volume
from ..quantities import from_si, parse, shown_unit, with_unit
from ..report.figures import analysis_figures, circuit_diagram, run_figures, style
from ._outputs import FIGURE, OBJECT, RECORDING, TABLE, OutputFiles, OutputKinds, Paths, write_recording
from ._progress import progress, told
from ._terminal import FigureLook, FigureWidth, Json, caution, options_named, pairs, print_json, table
from ._verb import show_tables

if TYPE_CHECKING:
    from ..assembly.circuit_file import CircuitPlan
    from ..identification import CircuitFit, Trial
    from ..recordings.recording import Recording

SHOWN = OutputKinds(figure=FIGURE, result=OBJECT)
RUN = OutputKinds(recording=RECORDING, figure=FIGURE, result=OBJECT)
DRAWS = 1000
FIT = RESPONSE = OutputKinds(figure=FIGURE, table=TABLE, result=OBJECT)
File = Annotated[Path, typer.Argument(metavar="CIRCUIT", help="Circuit file with its signals and its run.")]
Change = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="PATH=VALUE", help="Replace a value, such as elements.tube.length='2 m'."),
]


def show(
    file: File,
    change: Change = None,
    width: FigureWidth = None,
    look: FigureLook = "screen",
    out: Annotated[Paths, SHOWN.option()] = None,
    as_json: Json = False,
) -> None:
    """Describe a circuit, its fastest mode, and the method with which a run begins.

    $ mckibben circuit show bench.toml --out bench.svg
    """
    with SHOWN.files(out) as files:
        plan = planned(file, change)
        rate, method = plan.rates()
        files.write("figure", lambda path: _draw(plan, path))
        content = _description(plan) | {"rates": {"fastest": rate, "method": method, "step": plan.inner_step}}
        files.write_result(content)
        if as_json:
            print_json(content)
        else:
            _print_plan(plan)
            typer.echo(f"Fastest mode at the start {rate:.3g} 1/s: a run begins with {method}.")
            files.say()


def _description(plan: CircuitPlan) -> dict[str, Any]:
    return {
        "title": plan.title,
        "nodes": _nodes(plan),
        "elements": _elements(plan),
        "signals": {
            name: {
                "kind": s.waveform.kind,
                "unit": s.unit,
                "straight": s.straight,
                "drives": list(s.drives),
                "sentence": s.waveform.sentence(s.unit),
            }
            for name, s in plan.signals.items()
        },
        "sentence": sentences_module.sentence(plan),
        "run": sentences_module.run_sentence(plan),
    }


def _print_plan(plan: CircuitPlan) -> None:
    rows = [[name, n.kind, n.words] for name, n in plan.nodes.items()]
    table(plan.title, ["node", "kind", ""], rows)
    rows = [[n, e["kind"], ", ".join(f"{p} {at}" for p, at in e["ports"].items())] for n, e in _elements(plan).items()]
    table("", ["element", "kind", "leads to"], rows)
    if plan.signals:
        rows = [[n, s.waveform.sentence(s.unit), ", ".join(s.drives)] for n, s in plan.signals.items()]
        table("", ["signal", "", "drives"], rows)
    typer.echo(f"\n{sentences_module.sentence(plan)}\n{sentences_module.run_sentence(plan)}")


def run(
    file: File,
    change: Change = None,
    width: FigureWidth = None,
    look: FigureLook = "screen",
    out: Annotated[Paths, RUN.option()] = None,
    as_json: Json = False,
) -> None:
    """Run a circuit, close its balances of mass and energy, and save the recording.

    $ mckibben circuit run bench.toml --set elements.tube.length='2 m' --out bench.nc --out bench.svg
    """
    with RUN.files(out) as files:
        plan = planned(file, change)
        with progress("running", circuit_run.chunks(plan), guarded=False) as advance:
            recording = circuit_run.run_circuit(plan, progress=advance)
        caution(*recording.meta.get("warnings", ()))
        files.write("recording", lambda path: write_recording(recording, path))
        files.write("figure", lambda path: style.save(run_figures.run_figure(recording), path))
        result = _result(recording, files.first("recording"))
        files.write_result(result)
        if as_json:
            print_json(result)
        else:
            _print(recording)
            files.say()
    if recording.meta["result"] != "done":
        raise typer.Exit(130)


def planned(file: Path, change: list[str] | None) -> CircuitPlan:
    """Read a circuit's file, with the replacements of ``--set``."""
    plan = circuit_file.read_circuit(file)
    plan = plan.change(pairs(change, "--set", "elements.tube.length='2 m'")) if change else plan
    caution(*plan.cautions)
    return plan


def _nodes(plan: CircuitPlan) -> dict[str, JsonValue]:

    nodes = {}
    for name, n in plan.nodes.items():
        entry: dict[str, Any] = {"kind": n.kind, "words": n.words, "signal": n.signal}
        if isinstance(n.node, volume.Reservoir):
            if n.signal is None:
                node: Any = plan.circuit.nodes[name]
                entry["pressure"] = float(node.pressure_abs) - float(plan.environment.pressure_abs)
        else:
            entry |= {"start_pressure": n.start, "heat": type(n.node.heat).__name__}
        nodes[name] = entry
    return nodes


def _elements(plan: CircuitPlan) -> dict[str, JsonValue]:

    elements = {}
    for name, element in plan.circuit.elements.items():
        ends, command = plan.circuit.ends[name]
        elements[name] = {
            "kind": plan.document["elements"][name]["kind"],
            "ports": dict(zip(element.ports, ends, strict=True)),
            "command": command,
            "parameters": {
                path: {"value": components.paths.get(element, path), "unit": q.unit}
                for path, q in components.paths.parameters(element)
                if "gas." not in path
            },
        }
    return elements


def _draw(plan: CircuitPlan, path: Path) -> None:

    room = float(plan.environment.pressure_abs)
    pressures = {name: start + room for name, start in plan.starts.items()}
    # what the file says of a muscle; a junction's own volume is nothing that a person gave
    said = {
        name: "" if n.needs_volume else "\n".join(n.words.split(", ")[:2])
        for name, n in plan.nodes.items()
        if n.needs_volume or n.law is not None
    }
    style.save(circuit_diagram.draw(plan.circuit, title=plan.title, pressures=pressures, subtitles=said), path)


def _summary(recording: Recording) -> dict[str, dict[str, Any]]:
    return {
        name: {**{k: s[k] for k in ("min", "max", "mean")}, "final": float(recording[name][-1]), "unit": s["unit"]}
        for name, s in recording.summary().items()
    }


def _result(recording: Recording, out: Path | None) -> dict[str, JsonValue]:
    meta = recording.meta
    return {
        "result": meta["result"],
        "message": meta["message"],
        "file": None if out is None else str(out),
        "summary": _summary(recording),
        "warnings": list(meta.get("warnings", ())),
        "balance": dict(meta["balance"]),
        "stiff": meta["stiff"],
        "step": meta["step"],
    }


def _print(recording: Recording) -> None:

    meta, rows = recording.meta, []
    units = {"kg/s": "g/s", "kg": "g"}
    for name, s in _summary(recording).items():
        owner, _, last = name.rpartition(".")
        if last in ("pressure_abs", "mass") or (last == "temperature" and f"{owner}.mass" not in recording):
            continue
        unit, span = units.get(s["unit"], shown_unit(s["unit"])), max(abs(s["min"]), abs(s["max"]))
        # what is nothing but rounding is shown as nothing
        numbers = [0.0 if abs(s[k]) < 1e-9 * span else s[k] for k in ("min", "max", "mean", "final")]
        shown = [f"{from_si(n, s['unit'], unit):.4g}" for n in numbers]
        rows.append([name, *shown, "" if unit == "1" else unit])
    table(str(meta["title"]), ["channel", "min", "max", "mean", "final", "unit"], rows, right=[1, 2, 3, 4])
    method = "ros2" if meta["stiff"] else "rk4"
    typer.echo(f"\n{meta['run']}")
    typer.echo(
        f"{meta['message']} Balance: mass {meta['balance']['mass']:.1e}, energy {meta['balance']['energy']:.1e} "
        f"of what went through. Method {method}, step {meta['step'] * 1e6:g} us."
    )


def fit(
    file: File,
    records: Annotated[
        list[Path], typer.Argument(metavar="RECORD", help="Recordings, or measured CSV tables, to fit to.")
    ],
    free: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PATH",
            help="Parameter to fit, such as elements.tube.friction_scale; * matches several.",
        ),
    ] = None,
    predict: Annotated[
        list[Path] | None,
        typer.Option(metavar="RECORD", help="Record to predict with the fitted parameters."),
    ] = None,
    start: Annotated[
        list[str] | None, typer.Option(metavar="PATH=VALUE", help="Initial value of a free parameter.")
    ] = None,
    column: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=COLUMN", help="Column that holds tank.pressure, time, .., such as tank.pressure=2."),
    ] = None,
    unit: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=UNIT", help="Unit of a column whose header has none, such as tank.pressure=kPa."),
    ] = None,
    change: Change = None,
    posterior: Annotated[
        bool,
        typer.Option(
            "--posterior", help="Draw from the posterior of the parameters, with a discrepancy of the circuit."
        ),
    ] = False,
    draws: Annotated[int, typer.Option("--draws", metavar="N", help="Number of samples of the posterior.")] = DRAWS,
    width: FigureWidth = None,
    look: FigureLook = "screen",
    out: Annotated[Paths, FIT.option()] = None,
    as_json: Json = False,
) -> None:
    """Fit a circuit's parameters to records of its pressures, and predict other records.

    $ mckibben circuit fit bench.toml measured.csv --free elements.tube.friction_scale --out fit.svg
    $ mckibben circuit fit bench.toml measured.csv --free elements.valve.conductance --posterior --out fit.json
    """
    if posterior:
        identification.posterior.check_draws(draws, field="--draws")
    with FIT.files(out) as files:
        result, used, title = _fitted(file, records, free, predict, start, column, unit, change)
        samples = (
            result.posterior(used[: len(records)], step=planned(file, change).step, draws=draws) if posterior else None
        )
        files.write("figure", lambda path: style.save(run_figures.overview(result, used, title=title), path))
        content = result.to_dict()
        if samples is not None:
            content["posterior"] = samples.to_dict()
        files.write_rows([{"parameter": name} | e._asdict() for name, e in result.parameters.items()])
        files.write_result(content)
        if as_json:
            print_json(content)
        else:
            show_tables(result.tables(title))
            if samples is not None:
                typer.echo("")
                show_tables(samples.tables("the circuit"))
            files.say()


def _fitted(
    file: Path,
    records: list[Path],
    free: list[str] | None,
    predict: list[Path] | None,
    start: list[str] | None,
    column: list[str] | None,
    unit: list[str] | None,
    change: list[str] | None,
) -> tuple[CircuitFit, list[Trial], str]:
    """Fit as the options say; with the records that were used, and the circuit's title."""
    plan = planned(file, change)
    wanted = list(free or plan.fit.free)
    if not wanted:
        raise InputError(
            "--free", None, "is missing: give a dotted path, here or as free = [..] in [fit]", where=str(file)
        )
    reading = _reading(plan, column, unit)
    for option, words in (("--column", column), ("--unit", unit)):
        if words and (own_file := next(filter(_is_own, [*records, *(predict or [])]), None)):
            allowed = "a recording of mckibben says these itself; they are for files of others"
            raise InputError(option, words[0], allowed, where=str(own_file))
    trials = [_trial(plan, path, reading) for path in records]
    others = [_trial(plan, path, reading) for path in predict or []]
    with told("fitting", identification.circuit_fit.EVALUATIONS) as tell:
        result = identification.fit_circuit(
            trials, wanted, predict=others, start=_starts(plan, wanted, start), step=plan.step, progress=tell
        )
    return result, [*trials, *others], plan.title


def _reading(plan: CircuitPlan, column: list[str] | None, unit: list[str] | None) -> dict[str, JsonValue]:
    columns: dict[str, str | int] = dict(plan.fit.columns)
    for name, place in pairs(column, "--column", "tank.pressure=2").items():
        columns[name] = int(place) if place.isdigit() else place
    units = plan.fit.units | pairs(unit, "--unit", "tank.pressure=kPa")
    return {"columns": columns or None, "units": units or None, "pressure_zero": plan.fit.pressure_zero}


def _trial(plan: CircuitPlan, path: Path, reading: dict[str, Any]) -> Trial:

    if _is_own(path):
        record = recordings.read_recording(path)
    else:
        with options_named():
            record = recordings.read_record(path, ambient=float(plan.environment.pressure_abs), **reading)
        caution(*(f"{path}: {said}" for said in record.meta.get("source", {}).get("left_out", [])))
    trial = identification.trial.trial_from_record(plan, record, name=str(path))
    caution(*(c.text for c in trial.cautions))
    return trial


def _is_own(path: Path) -> bool:
    """Whether a file was saved by this package, and states its units."""
    return path.suffix == ".nc" or (path.suffix == ".csv" and _is_recording(path))


def _is_recording(path: Path) -> bool:
    """Whether a CSV file was saved by this package, and states its units."""
    try:
        with path.open(encoding="utf-8") as stream:
            return stream.readline().startswith("# mckibben")
    except (OSError, UnicodeDecodeError):
        return False


def _starts(plan: CircuitPlan, wanted: list[str], start: list[str] | None) -> dict[str, float]:

    starts = {}
    for name, words in {**plan.fit.start, **pairs(start, "--start", "elements.tube.ends=2")}.items():
        if name not in wanted:
            if name in plan.fit.start and not pairs(start, "--start", "").get(name):
                continue  # the file's guess for a parameter that is not asked for this time
            raise InputError("--start", name, f"it is not free; free are {', '.join(wanted)}")
        path = identification.trial.matching(name, plan.circuit, tuple(plan.signals))[0]
        unit = (
            identification.circuit_fit.DELAY.unit
            if path.startswith("signals.")
            else components.paths.declaration(plan.circuit, path).unit
        )
        starts[name] = parse(str(words), unit, field=f"start of {name}", bare=True)
    return starts


FREQUENCIES = 200  # at which a response is drawn and given as JSON


def frequency(
    file: File,
    source: Annotated[
        str, typer.Option("--input", metavar="SIGNAL", help="Signal that is varied, such as valve.command.")
    ],
    target: Annotated[
        str, typer.Option("--output", metavar="CHANNEL", help="Channel that answers, such as muscle.pressure_abs.")
    ],
    at: Annotated[
        str,
        typer.Option("--at", metavar="TIME", help="Time at which all signals have the values of the operating point."),
    ] = "0 s",
    lowest: Annotated[str, typer.Option("--from", metavar="FREQUENCY", help="Lowest frequency.")] = "0.1 Hz",
    highest: Annotated[str, typer.Option("--to", metavar="FREQUENCY", help="Highest frequency.")] = "100 Hz",
    change: Change = None,
    width: FigureWidth = None,
    look: FigureLook = "screen",
    out: Annotated[Paths, RESPONSE.option()] = None,
    as_json: Json = False,
) -> None:
    """Compute the frequency response of a circuit that is linearised at rest.

    The circuit settles under the values that its signals have at one time; about this operating point it answers to
    small sines of one signal. Friction with memory is held.

    $ mckibben circuit frequency bench.toml --input valve.command --output muscle.pressure_abs --out bode.svg
    """
    with RESPONSE.files(out) as files:
        _respond(file, source, target, at, lowest, highest, change, files, as_json)


def _respond(
    file: Path,
    source: str,
    target: str,
    at: str,
    lowest: str,
    highest: str,
    change: list[str] | None,
    files: OutputFiles,
    as_json: bool,
) -> None:
    """Linearise at rest and write the response."""
    low, high = parse(lowest, "1/s", field="--from"), parse(highest, "1/s", field="--to")
    if not 0.0 < low < high:
        raise InputError("--from", lowest, f"must be above 0 Hz and below --to, {highest}")
    plan = planned(file, change)
    time = parse(at, "s", field="--at")
    if not 0.0 <= time <= plan.duration:
        raise InputError(
            "--at", at, f"must be between 0 s and {with_unit(plan.duration, 's')}, the duration of the run"
        )
    inputs = {name: s.at(round(time / plan.period), 0.0, plan.period) for name, s in plan.inputs().items()}
    driven = plan.inputs_of(source)
    if len(driven) > 1:
        raise InputError("--input", source, f"it drives {' and '.join(driven)}; name one of them")
    (source,) = driven
    state, memory = plan.initial()
    with told("settling"):
        rest = linearisation.settle(plan.circuit, state, memory, inputs).state
    model = linearisation.linearise(plan.circuit, rest, memory, inputs, inputs_by_name=(source,), outputs=(target,))
    response = response_module.linear_response(model, source, target, np.geomspace(low, high, FREQUENCIES))
    unit = _unit_of(plan, target, source)
    cutoff = response.cutoff()
    titles = analysis_figures.BodeTitles(
        f"{plan.title}: {target} over {source}", f"about rest at {at}" if inputs else "", unit
    )
    files.write("figure", lambda path: style.save(analysis_figures.bode_figure(response, titles, cutoff=cutoff), path))
    courses = {"frequency": response.frequency, "magnitude": response.magnitude, "phase": response.phase}
    units = {"frequency": "Hz", "magnitude": unit or "1", "phase": "rad"}
    files.write_columns(courses, units)
    level = float(plan.circuit.outputs(rest, memory, inputs)[target])
    modes = [m._asdict() | {"eigenvalue": [m.eigenvalue.real, m.eigenvalue.imag]} for m in model.modes()]
    content = {
        "title": plan.title,
        "input": source,
        "output": target,
        "unit": unit,
        "level": level,
        "cutoff": cutoff,
        "modes": modes,
        **courses,
    }
    files.write_result(content)
    if as_json:
        print_json(content)
        return
    shown = range(0, FREQUENCIES, FREQUENCIES // 10)
    rows = [
        [f"{response.frequency[i]:.3g}", f"{response.magnitude[i]:.4g}", f"{np.degrees(response.phase[i]):.1f}"]
        for i in (*shown, FREQUENCIES - 1)
    ]
    table(
        f"{plan.title}: {target} over {source}, about rest at {at}",
        ["frequency, Hz", f"magnitude{f', {unit}' if unit else ''}", "phase, degrees"],
        rows,
        right=[0, 1, 2],
    )
    typer.echo("")
    rows = [[f"{m['frequency']:.4g}", f"{m['damping']:.3g}"] for m in modes]
    table("Modes", ["natural frequency, Hz", "damping ratio"], rows, right=[0, 1])
    fallen = f"falls by 3 dB at {cutoff:.4g} Hz" if np.isfinite(cutoff) else f"does not fall by 3 dB up to {highest}"
    typer.echo(f"\n{target} is {level:.6g} at the operating point; its response {fallen}.")
    files.say()


def _unit_of(plan: CircuitPlan, target: str, source: str) -> str:
    """Unit of an output over that of an input, empty if both are the same."""
    units = {
        "pressure_abs": "Pa",
        "pressure": "Pa",
        "mass_flow": "kg/s",
        "mass": "kg",
        "temperature": "K",
        "length": "m",
    }
    above, below = (units.get(name.rpartition(".")[2], "1") for name in (target, source))
    return "" if above == below else above if below == "1" else f"{above} per {below}"
