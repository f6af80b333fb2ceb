"""The pages of the reference that are made from the package: one function per page, given the stage and returning text."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

MADE = "<!-- made by docs/generated.py; do not edit -->\n"
FOLDER = "reference/generated"


def nomenclature(_: Path) -> str:
    """All physical terms."""
    from mckibben.nomenclature import TERMS

    rows = [[f"`{name}`", t.symbol, t.unit, t.meaning, t.sign] for name, t in TERMS.items()]
    return _page(
        "Nomenclature",
        "Names of columns, channels, parameters and JSON fields are taken from this table, which is made from "
        "`mckibben.nomenclature`. Pressures are gauge unless a name ends in `_abs`.",
        _table(["name", "symbol", "SI unit", "meaning", "sign"], rows),
    )


def parameters(_: Path) -> str:
    """Every declared parameter."""
    from mckibben.components import Environment
    from mckibben.muscles import LAWS, law_type
    from mckibben.muscles.biological import BiologicalMuscle
    from mckibben.muscles.creep import KelvinVoigtChain, MaxwellChain
    from mckibben.muscles.elements import PassiveSpring, Tendon, Viscous
    from mckibben.muscles.hysteresis import HYSTERESES, FrictionLimit, PlayMap
    from mckibben.pneumatics.build import ELEMENTS
    from mckibben.pneumatics.gas import Gas
    from mckibben.pneumatics.heat import Polytropic, WallHeat
    from mckibben.pneumatics.orifice import Orifice
    from mckibben.pneumatics.valves import Solenoid
    from mckibben.pneumatics.volume import CompliantVolume, FixedVolume

    parts = []
    for heading, owners in {
        "Tension laws": {name: law_type(name) for name in LAWS},
        "Friction": {"limit (of every friction but Prandtl-Ishlinskii)": FrictionLimit}
        | HYSTERESES
        | {"play_map": PlayMap},
        "Creep": {"maxwell_chain": MaxwellChain, "kelvin_voigt_chain": KelvinVoigtChain},
        "Elements": {"passive_spring": PassiveSpring, "viscous": Viscous, "tendon": Tendon},
        "Biological muscle": {"biological": BiologicalMuscle},
        "Pneumatic elements": {"passage (of every valve)": Orifice, "drive (of switching valves)": Solenoid} | ELEMENTS,
        "Volumes and heat": {
            "volume": FixedVolume,
            "compliant": CompliantVolume,
            "wall": WallHeat,
            "polytropic": Polytropic,
            "gas": Gas,
        },
        "Environment": {"environment": Environment},
    }.items():
        parts.append(f"## {heading}")
        for name, owner in owners.items():
            known = _parameter_rows(owner)
            parts += [
                f"### `{name}`",
                _first_line(owner),
                _table(_PARAMETER_COLUMNS, known) if known else "No parameters.",
            ]
    return _page(
        "Parameters",
        "A parameter is declared once, with unit, bounds and meaning; this page, the bounds of a fit, the complaints about "
        "bad input and the command line all read that declaration. *Usual* is the range from which a fit draws its starting "
        "points. A parameter marked *fitted* is freed by a fit unless told otherwise; one with a default may be left out.",
        *parts,
    )


_PARAMETER_COLUMNS = ["name", "symbol", "meaning", "allowed", "usual", "default", ""]


def _parameter_rows(owner: Any) -> list[list[str]]:
    from mckibben.quantities import declared, with_unit

    fitted = getattr(owner, "fitted", ())
    rows = []
    for f in dataclasses.fields(owner):
        if f.name not in declared(owner):
            continue
        q = declared(owner)[f.name]
        given = f.default is not dataclasses.MISSING
        usual = "" if q.typical == q.bounds else " to ".join(with_unit(v, q.unit, 3) for v in q.typical)
        default = ""
        if given:
            default = "none" if isinstance(f.default, tuple) else with_unit(float(f.default), q.unit)
        rows.append([f"`{f.name}`", q.symbol, q.doc, q.allowed(), usual, default, "fitted" if f.name in fitted else ""])
    return rows


def cli(_: Path) -> str:
    """The help of every command."""
    from examples import run_command

    parts = []
    for name in ["", *commands()]:
        text, code = run_command([*name.split(), "--help"])
        assert code == 0, name
        parts += [f"## `mckibben{' ' if name else ''}{name}`", f"```text\n{text}```"]
    return _page(
        "Command line",
        f"Every command but {_listed(without_json())}, which go on until they are ended, takes `--json` and then prints one "
        "JSON object in SI units and nothing else on standard output. Exit codes: 0 done, 1 a "
        "comparison fell short or a fit did not converge, 2 the input is wrong (one line on standard error that names the "
        "field, the value and what is allowed).",
        "A value has its unit behind it, any one of its dimension: `12 cm`, `120 mm`, `5 bar`, `500 kPa`. Numbers have a decimal "
        "point. Values of a list are parted by `, ` or `;`; a comma between two digits could mean either and is refused. What is "
        "unusual but possible is said on standard error, and under `warnings` in the JSON object.",
        *parts,
    )


def without_json() -> list[str]:
    """Names of the commands that take no ``--json``."""
    import typer

    from mckibben.cli.app import app

    command: Any = typer.main.get_command(app)
    found = []
    for name in commands():
        one = command
        for word in name.split():
            one = one.commands[word]
        if not hasattr(one, "commands") and not any("--json" in p.opts for p in one.params):
            found.append(name)
    return found


def _listed(names: list[str]) -> str:
    named = [f"`{name}`" for name in names]
    return f"{', '.join(named[:-1])} and {named[-1]}"


def commands() -> list[str]:
    """Names of all commands; those of a group after it, as ``circuit run``."""
    import typer

    from mckibben.cli.app import app

    def under(command: Any, prefix: str) -> list[str]:
        found = []
        for name, inner in getattr(command, "commands", {}).items():
            found += [f"{prefix}{name}", *under(inner, f"{prefix}{name} ")]
        return found

    return under(typer.main.get_command(app), "")


def specimens(_: Path) -> str:
    """Every shipped muscle with its numbers."""
    from mckibben.citations import reference
    from mckibben.specimens import specimens as known

    parts = []
    for s in known():
        parts += [f"## {s.id}", f"{s.title}; {s.kind}{f', default law `{s.law}`' if s.law else ''}. {s.note}".strip()]
        parts.append("\n".join(f"- {reference(key)}" for key in s.sources))
        if s.map:
            parts.append(f"Ships with the measured force map `{s.map}`; `mckibben fit {s.id}` fits every law to it.")
        groups = {"properties": s.properties} | {f"laws.{k}": g for k, g in s.laws.items()}
        groups |= {f"friction.{k}": g for k, g in s.friction.items()}
        for path, group in groups.items():
            rows = [
                [
                    f"`{k}`",
                    _number(p.value),
                    "" if p.unit == "1" else p.unit,
                    p.source,
                    "inferred" if p.inferred else "",
                    p.note,
                ]
                for k, p in group.items()
            ]
            parts += [f"### {s.id}: {path}", _table(["parameter", "value", "unit", "source", "", "note"], rows)]
    return _page(
        "Specimens",
        "The muscles and valves that ship, number by number. *Inferred* marks every number that its source does not print; the note "
        "says how it was found.",
        *parts,
    )


def rigs(_: Path) -> str:
    """Every key of a rig's file, and what the rigs that ship say."""
    from mckibben.bench.hardware import AnalogOut, Computer, Converter, Encoder, Frame, Motor, Sensor
    from mckibben.bench.hardware.pneumatics import Plumbing
    from mckibben.bench.rig_file import LENGTH, shipped_rigs
    from mckibben.bench.software.controllers import ForceControl, PositionControl, PressureControl
    from mckibben.bench.software.interlocks import Interlocks
    from mckibben.bench.software.controllers import MotionEstimate
    from mckibben.components import Environment
    from mckibben.pneumatics.build import ELEMENTS, known_keys
    from mckibben.quantities import Quantity, declared

    known = shipped_rigs()
    span = {"shortest": LENGTH, "longest": LENGTH}
    watched = declared(Interlocks)
    parts = []
    tables: list[tuple[str, str, Any, dict[str, Quantity]]] = [
        ("computer", "", Computer, declared(Computer)),
        ("sensors.pressure", "; so are `sensors.valve_pressure` and `sensors.tension`", Sensor, declared(Sensor)),
        ("sensors.pressure.converter", "", Converter, declared(Converter)),
        ("encoder", "; leave the table out where there is none, and the motor too", Encoder, declared(Encoder)),
        ("outputs.valve", "; so is `outputs.motor`, in newtons", AnalogOut, declared(AnalogOut)),
        ("motor", "", Motor, declared(Motor)),
        ("frame", "", Frame, span | declared(Frame)),
        (
            "plumbing.direct",
            "; a table for each, the usual one first",
            Plumbing,
            declared(Plumbing),
        ),
        ("plumbing.direct.valve", "", ELEMENTS["pressure_regulator"], known_keys("pressure_regulator")),
        ("plumbing.direct.tube", "", ELEMENTS["lumped_tube"], known_keys("lumped_tube")),
        ("plumbing.tight.shut_off", "; only where there is one", ELEMENTS["on_off_valve"], known_keys("on_off_valve")),
        ("plumbing.tight.leak", "; only where there is one", ELEMENTS["leak"], known_keys("leak")),
        ("control.motion", "", MotionEstimate, declared(MotionEstimate)),
        ("control.pressure", "", PressureControl, declared(PressureControl)),
        ("control.position", "", PositionControl, declared(PositionControl)),
        ("control.force", "", ForceControl, declared(ForceControl)),
        ("interlocks", "", Interlocks, {k: watched[k] for k in _WATCHED}),
        ("environment", "", Environment, declared(Environment)),
    ]
    for path, more, owner, keys in tables:
        names = [*keys, *(n for n in _WHOLE if n in {f.name for f in dataclasses.fields(owner)})]
        rows = [
            [f"`{n}`", *_rig_key(n, keys.get(n), owner), *(_rig_value(r, path, n) for r in known.values())]
            for n in names
        ]
        first = _first_line(owner).rstrip(".")
        parts += [f"## `[{path}]`", f"{first}{more}.", _table(["key", "meaning", "allowed", "default", *known], rows)]
    return _page(
        "Rigs",
        "Every key of a rig's file ([Describe your own rig](../../how-to/describe-your-own-rig.md)), read from the declarations, with what "
        "the rigs that ship say. A star marks what is inferred and stated by no source. Ends, offset and noise of a sensor and of a converter "
        "are in the unit of their channel. A key with a default may be left out.",
        *(f"`{name}`: {r.title}. {r.note}" for name, r in known.items()),
        *parts,
        "## Beside the tables",
        _table(["key", "meaning"], [[f"`{k}`", v] for k, v in _RIG_REST.items()]),
    )


_WATCHED = (
    "burst_pressure",
    "most_tension",
    "most_speed",
    "patience",
    "implausible_after",
)  # the rest a rig knows itself
_WHOLE = {
    "bits": ("counts are 2^bits", "whole, 2 to 24"),
    "steps_per_turn": ("of the disc", "whole, 1 to 10000000"),
    "edges": ("counts per step", "1, 2, 4"),
    "counter_bits": ("it wraps around", "whole, 4 to 48"),
}
_RIG_REST = {
    "schema": "1; the version of this format",
    "name": "short, for recordings",
    "title": "for people",
    "source": "where its numbers stand",
    "note": "anything else",
    "inferred": "dotted paths of what no source states; a whole table by its own path",
    "plumbing.NAME.heat": "`isothermal`, `adiabatic`, or the conductance to the walls of each volume, such as `0.2 W/K`",
    "plumbing.NAME.muscle": "false where an accumulator takes the muscle's place",
    "plumbing.NAME.valve.specimen": "a valve that ships, for what is not said",
    "hands": "list of tables: what a person does at an `ask` of a protocol: `ask`, and `plumbing` or `friction` afterwards, over that before",
}


def _rig_key(name: str, q: Any, owner: Any) -> list[str]:
    from mckibben.quantities import with_unit

    if q is None:
        default = next(f.default for f in dataclasses.fields(owner) if f.name == name)
        return [*_WHOLE[name], str(default)]
    given = {f.name: f.default for f in dataclasses.fields(owner)}.get(name)
    free = "in the unit of the channel" in q.doc
    meaning = q.doc.replace(", in the unit of the channel", "")
    default = with_unit(float(given), q.unit) if isinstance(given, int | float) else ""
    return [meaning, "" if free else q.allowed(), default]


def _rig_value(rig: Any, path: str, key: str) -> str:
    at: Any = rig.document
    for part in (*path.split("."), key):
        at = at.get(part) if isinstance(at, dict) else None
    if at is None or isinstance(at, dict):
        return ""
    full = f"{path}.{key}"
    return f"{at}" + ("*" if any(full == i or full.startswith(f"{i}.") for i in rig.inferred) else "")


def literature(_: Path) -> str:
    """All references."""
    from mckibben.citations import known_keys, reference

    rows = [[f"`{key}`", reference(key)] for key in sorted(known_keys())]
    return _page(
        "Literature",
        "What specimens and laws cite. `mckibben.citations.bibtex([...])` gives the entries for a paper of your own.",
        _table(["key", "reference"], rows),
    )


def papers(_: Path) -> str:
    """The papers' rows that need no recording, beside ours."""
    from mckibben.reproduction import reproduce
    from mckibben.reproduction.rows import select
    from mckibben.reproduction.verdicts import headline

    outcomes, printed = reproduce(recordings=False), select()
    done = [o for o in outcomes if o.ours is not None]
    rows = []
    for o in done:
        paper = " to ".join(f"{v:g}" for v in o.row.paper) if isinstance(o.row.paper, tuple) else f"{o.row.paper:g}"
        ours, unit = f"{o.ours:.4g}", "" if o.row.unit == "-" else o.row.unit
        rows.append([f"`{o.row.id}`", o.row.what, paper, ours, unit, o.verdict, o.note])
    return "---\nhide:\n  - toc\n---\n\n" + _page(
        "The papers, number by number",
        f"{headline(done)} The other {len(printed) - len(done)} of the {len(printed)} that this package reproduces come from recordings of "
        "the simulated test machine, which take minutes. *Calibrated* means that an input was inferred from that row or its companion, so "
        "that agreement is no prediction. A tolerance above 10 % stands in the note with its reason. All rows, and every figure of the papers:",
        "```sh\n$ mckibben reproduce --out reproduction\n```",
        _table(["row", "what", "paper", "ours", "unit", "verdict", "note"], rows, right=(2, 3)),
    )


# ---- pages of the Python reference, one per room

ROOMS: dict[str, tuple[str, str, list[str]]] = {
    "mckibben": ("mckibben", "The verbs of the package, `mckibben.fit` and so on. They load their rooms on first use.", ["VERBS"]),
    "muscles": ("muscles", "What a muscle is.", ["muscles.*"]),
    "pneumatics": ("pneumatics", "What air does.", ["pneumatics.**"]),
    "engine": ("engine", "Time.", ["engine.*"]),
    "experiments": ("experiments", "What to do, as data.", ["experiments.**"]),
    "assembly": ("assembly", "Muscle, circuit, load and joint become one state equation.", ["assembly.**"]),
    "bench": ("bench", "Where it happens: rigs, runs on them, and the software of the machine.", ["bench.*", "bench.software.**"]),
    "hardware": ("Hardware", "The parts of the machine, the hardware border, and what lies behind it.", ["bench.hardware.**"]),
    "calibrate": ("Calibration", "Sensors, zeros, leak and frame of a bench.", ["bench.calibrate.**"]),
    "session": ("Session and console", "A program that holds the machine, and who talks to it.", ["bench.session.**", "bench.console.**"]),
    "bluesky": ("Bluesky", "The machine as devices for Bluesky.", ["bench.bluesky.**"]),
    "studies": ("studies", "Questions, answered as a whole.", ["studies.*"]),
    "sizing": ("Sizing", "Which muscle, valve, tube and gas source do what is wished for.", ["studies.sizing.**"]),
    "comparison": ("Comparison", "Muscles beside biological muscle: Table 1, the same protocols, a search over elements.", ["studies.comparison.**"]),
    "design": ("Design", "Fronts of response time, air and efficiency over muscle, tube and valve.", ["studies.design.**"]),
    "laws": ("Tension laws", "One file per law; all of them have the methods of [TensionLaw](muscles.md).", ["muscles.laws.*"]),
    "hysteresis": ("Friction", "One file per model, under one interface.", ["components.element", "muscles.hysteresis.*"]),
    "biological": ("Biological muscle", "One file per effect, and the muscle that puts them together.", ["muscles.biological.*"]),
    "identification": ("identification", "Parameters from measured data.", ["identification.**"]),
    "recordings": ("recordings", "Measured data and how they are read.", ["recordings.**"]),
    "analysis": ("analysis", "Numbers from laws and recordings.", ["analysis.*"]),
    "energy": ("Energy of cycles", "Part IV of the paper: what goes in, what comes out, and where the rest goes.", ["analysis.energy.**"]),
    "specimens": ("specimens", "Published muscles as data.", ["specimens.**"]),
    "components": ("components", "Interfaces, and the environment.", ["components.*"]),
    "edges": ("Edges", "Units, errors, citations, names and extras.", ["quantities", "errors", "citations", "nomenclature", "documents", "extras"]),
    "reproduction": ("reproduction", "The papers' numbers.", ["reproduction.**"]),
    "report": ("report", "Reports and files for people.", ["report.*"]),
    "figures": ("Figures", "All that is drawn.", ["report.figures.**"]),
}  # fmt: skip
# Modules of these pages that another page shows already, or that are private to their room.
ELSEWHERE = {"components": {"element"}}


def room(name: str) -> str:
    """One room's page for mkdocstrings."""
    title, words, entries = ROOMS[name]
    parts = []
    for entry in entries:
        for full in _modules(entry, ELSEWHERE.get(name, set())):
            parts.append(f"::: {full}")
    return _page(title, words, *parts)


def _modules(entry: str, left_out: set[str]) -> list[str]:
    import importlib
    import pkgutil

    import mckibben

    if entry == "VERBS":
        verbs = [getattr(mckibben, name) for name in mckibben.__all__ if not name.startswith("_")]
        return [f"{verb.__module__}.{verb.__name__}" for verb in verbs]
    path, _, stars = entry.partition(".*")
    if entry == path:
        return [f"mckibben.{entry}"]
    whole, package = stars == "*", importlib.import_module(f"mckibben.{path}")
    inside = [m for m in pkgutil.iter_modules(package.__path__) if not m.name.startswith("_")]
    found = [f"{package.__name__}.{m.name}" for m in inside if not m.ispkg and m.name not in left_out]
    if whole:
        found += [f for m in inside if m.ispkg for f in _modules(f"{path}.{m.name}.**", left_out)]
    return found


PAGES: dict[str, Callable[[Path], str]] = {
    f"{FOLDER}/{make.__name__}.md": make
    for make in (nomenclature, parameters, cli, specimens, rigs, papers, literature)
} | {f"reference/api/{name}.md": (lambda _, name=name: room(name)) for name in ROOMS}  # type: ignore[misc]


# ---- words and tables


def _page(title: str, *parts: str) -> str:
    return MADE + "\n" + "\n\n".join([f"# {title}", *parts]) + "\n"


def _table(columns: list[str], rows: Iterable[list[str]], right: Iterable[int] = ()) -> str:
    aligned = set(right)
    line = lambda cells: "| " + " | ".join(c.replace("|", "\\|").replace("\n", " ") for c in cells) + " |"  # noqa: E731
    rule = "|" + "|".join("---:" if i in aligned else "---" for i in range(len(columns))) + "|"
    return "\n".join([line(columns), rule, *(line(r) for r in rows)])


def _first_line(owner: Any) -> str:
    return (inspect.getdoc(owner) or "").splitlines()[0]


def _number(value: float | list[float]) -> str:
    return ", ".join(f"{v:g}" for v in value) if isinstance(value, list) else f"{value:g}"
