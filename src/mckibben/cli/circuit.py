"""``circuit``: pneumatic circuits from TOML files: what they are, and what becomes of them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .words import Json, caution, pairs, print_json, progress, table, writable

if TYPE_CHECKING:
    from ..assembly.circuit_file import CircuitPlan
    from ..recordings.recording import Recording

circuit = typer.Typer(
    name="circuit",
    help="Pneumatic circuits: show one, run one, fit one to records.",
    no_args_is_help=True,
    rich_markup_mode=None,
)
File = Annotated[Path, typer.Argument(metavar="FILE.toml", help="The circuit, its signals and its run.")]
Change = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="PATH=VALUE", help="Replace a value, such as elements.tube.length='2 m'."),
]


@circuit.command("show")
def show(
    file: File,
    change: Change = None,
    svg: Annotated[Path | None, typer.Option(metavar="FILE.svg", help="Draw the circuit.")] = None,
    as_json: Json = False,
) -> None:
    """Say what a circuit is, how fast its modes are, and which method a run begins with."""
    from ..assembly.sentence import run_sentence, sentence

    writable("--svg", svg, ".svg", ".png")
    plan = planned(file, change)
    rate, method = plan.rates()
    if svg is not None:
        _draw(plan, svg)
    if as_json:
        print_json(
            {
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
                "sentence": sentence(plan),
                "run": run_sentence(plan),
                "rates": {"fastest": rate, "method": method, "step": plan.inner_step},
            }
        )
        return
    rows = [[name, n.kind, n.words] for name, n in plan.nodes.items()]
    table(plan.title, ["node", "kind", ""], rows)
    rows = [[n, e["kind"], ", ".join(f"{p} {at}" for p, at in e["ports"].items())] for n, e in _elements(plan).items()]
    table("", ["element", "kind", "leads to"], rows)
    if plan.signals:
        rows = [[n, s.waveform.sentence(s.unit), ", ".join(s.drives)] for n, s in plan.signals.items()]
        table("", ["signal", "", "drives"], rows)
    typer.echo(f"\n{sentence(plan)}\n{run_sentence(plan)}")
    typer.echo(f"Fastest mode at the start {rate:.3g} 1/s: a run begins with {method}.")
    if svg is not None:
        typer.echo(f"Written: {svg}")


@circuit.command("run")
def run(
    file: File,
    change: Change = None,
    out: Annotated[Path | None, typer.Option(metavar="FILE.nc|.csv", help="Save the recording.")] = None,
    figure: Annotated[Path | None, typer.Option(help="Draw the run into this SVG or PNG file.")] = None,
    as_json: Json = False,
) -> None:
    """Run a circuit, balance its accounts, and save the recording."""
    from ..bench.circuit_run import chunks, run_circuit

    writable("--out", out, ".nc", ".csv")
    writable("--figure", figure, ".svg", ".png")
    plan = planned(file, change)
    with progress("running", chunks(plan)) as advance:
        recording = run_circuit(plan, progress=advance)
    cautions = caution(*_cautions(plan, recording))
    if out is not None:
        recording.save(out)
    if figure is not None:
        from ..report.figures import circuit_figures, style

        style.save(circuit_figures.run_figure(recording), figure)
    if as_json:
        result = _result(recording, out)
        print_json(result | {"warnings": result["warnings"] + cautions})
    else:
        _print(recording)
        for path in (out, figure):
            if path is not None:
                typer.echo(f"Written: {path}")
    if recording.meta["result"] != "done":
        raise typer.Exit(130)


def _cautions(plan: CircuitPlan, recording: Recording) -> list[str | None]:
    """What is to be said of the highest pressure that each muscle took."""
    from ..muscles.plausible import pressure_caution

    found = []
    for name, node in plan.nodes.items():
        if node.law is not None:
            highest = float(recording[f"{name}.pressure_abs"].max()) - float(plan.environment.pressure_abs)
            said = pressure_caution(highest)
            found.append(None if said is None else f"{name}: {said}")
    return found


def planned(file: Path, change: list[str] | None) -> CircuitPlan:
    """A circuit's file, with what ``--set`` replaces."""
    from ..assembly.circuit_file import read_circuit

    plan = read_circuit(file)
    return plan.change(pairs(change, "--set", "elements.tube.length='2 m'")) if change else plan


def _nodes(plan: CircuitPlan) -> dict[str, Any]:
    from ..pneumatics.volume import Reservoir

    found = {}
    for name, n in plan.nodes.items():
        entry: dict[str, Any] = {"kind": n.kind, "words": n.words, "signal": n.signal}
        if isinstance(n.node, Reservoir):
            if n.signal is None:
                node: Any = plan.circuit.nodes[name]
                entry["pressure"] = float(node.pressure_abs) - float(plan.environment.pressure_abs)
        else:
            entry |= {"start_pressure": n.start, "heat": type(n.node.heat).__name__}
        found[name] = entry
    return found


def _elements(plan: CircuitPlan) -> dict[str, Any]:
    from ..components.paths import get, parameters

    found = {}
    for name, element in plan.circuit.elements.items():
        ends, command = plan.circuit.ends[name]
        found[name] = {
            "kind": plan.document["elements"][name]["kind"],
            "ports": dict(zip(element.ports, ends, strict=True)),
            "command": command,
            "parameters": {
                path: {"value": get(element, path), "unit": q.unit}
                for path, q in parameters(element)
                if "gas." not in path
            },
        }
    return found


def _draw(plan: CircuitPlan, path: Path) -> None:
    from ..report.figures import circuit_diagram, style

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


def _result(recording: Recording, out: Path | None) -> dict[str, Any]:
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
    from ..quantities import from_si, shown_unit

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
    for warning in meta.get("warnings", ()):
        typer.echo(f"Warning: {warning}.")
