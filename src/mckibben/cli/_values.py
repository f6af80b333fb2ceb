"""Kinds of values that options and arguments take, by the word that stands for them in the help.

The word states what is meant: ``--length LENGTH`` takes a length with its unit, ``--muscle SPECIMEN`` the id of a specimen
or a file. From it follow the SI unit, the caution about a value that can only be a slip, and what the shell completes.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from .. import registry
from ..answers import Caution, collect
from ..documents import JsonValue, parse_toml
from ..verbs import QUANTITIES, ParameterType

PACKAGE = Path(__file__).parents[1]
DATA = tuple(".csv .xlsx .ods .xls .txt .mat .tdms .parquet .h5 .hdf5 .mcap .db3 .ddf .edf .c3d .mf4 .nc".split())
RECORDINGS = (".nc", ".csv", ".mcap")


# ---- names, read from the files of the package without importing what computes


def specimens(*kinds: str) -> Iterator[tuple[str, str]]:
    """Ids and titles of the specimens of some kinds; muscles by default."""
    folders: list[str | Path] = [
        PACKAGE / "specimens" / "data",
        *filter(None, os.environ.get("MCKIBBEN_SPECIMENS", "").split(os.pathsep)),
    ]
    for table in (read_toml(path) for folder in folders for path in sorted(Path(folder).glob("*.toml"))):
        if table.get("kind", "mckibben") in (kinds or ("mckibben", "biological")) and isinstance(table.get("id"), str):
            yield table["id"], str(table.get("title", ""))


def frictions() -> Iterator[tuple[str, str]]:
    """Models of friction that a loop can identify, and the word for the best of those without kinks."""
    yield from (("bouc_wen", "Bouc and Wen"), ("dahl", "Dahl"), ("maxwell_slip", "Maxwell slip"), ("all", "the best"))


def valves() -> Iterator[tuple[str, str]]:
    """Ids and titles of the valves."""
    yield from specimens("valve")


def parts() -> Iterator[tuple[str, str]]:
    """Kinds of parts, and names of valves, muscles and laws."""
    yield from ((kind, "") for kind in ("valves", "tubes", "sources", "laws", "muscles"))
    yield from valves()
    yield from muscles_and_laws()


def laws() -> Iterator[tuple[str, str]]:
    """Names of the tension laws, those of installed packages too."""
    files = sorted((PACKAGE / "muscles" / "laws").glob("[a-z]*.py"))
    for path in files:
        with path.open(encoding="utf-8") as stream:
            yield path.stem, stream.readline().strip().strip('"')
    yield from ((name, point.value) for name, point in registry.entry_points("mckibben.laws").items())


def muscles_and_laws() -> Iterator[tuple[str, str]]:
    """Ids of muscles, and names of laws."""
    yield from specimens()
    yield from laws()


def protocols() -> Iterator[tuple[str, str]]:
    """Names and titles of the protocols."""
    yield from _titles(PACKAGE / "experiments" / "protocols")
    yield from _titles(PACKAGE / "experiments" / "protocols" / "stimulation")


def rigs() -> Iterator[tuple[str, str]]:
    """Names and titles of the rigs."""
    yield from _titles(PACKAGE / "bench" / "rigs")


def plumbings() -> Iterator[tuple[str, str]]:
    """Names of the plumbings of the rigs."""
    named: dict[str, list[str]] = {}
    for path in sorted((PACKAGE / "bench" / "rigs").glob("*.toml")):
        for name, table in read_toml(path).get("plumbing", {}).items():
            if isinstance(table, dict):
                named.setdefault(name, []).append(path.stem)
    yield from ((name, f"of the rig {' and '.join(of)}") for name, of in named.items())


def controllers() -> Iterator[tuple[str, str]]:
    """Names of the controllers that ship."""
    from ..control.catalogue import CONTROLLERS

    yield from ((name, "") for name in CONTROLLERS)


def words(*known: str) -> Callable[[], Iterable[tuple[str, str]]]:
    """A fixed list of names."""
    return lambda: ((word, "") for word in known)


def _titles(folder: Path) -> Iterator[tuple[str, str]]:
    yield from (
        (path.stem, str(read_toml(path).get("title", "")))
        for path in sorted(folder.glob("*.toml"), key=lambda path: path.stem)
    )


def read_toml(path: Path) -> dict[str, JsonValue]:
    """The tables of a file; none if it cannot be read."""
    try:
        return parse_toml(path.read_text(encoding="utf-8"), where=str(path))
    except (OSError, ValueError):
        return {}


# ---- kinds

_ANY = ("",)
# Numbers, words, and values that a command reads for itself: a COURSE over time, an UNCERTAINTY in the unit of its channel.
PLAIN = """
    LENGTHxDIAMETER LENGTH,PRESSURE,FORCE HARDNESS UNCERTAINTY TANK COURSE N NUMBER TEXT ADDRESS CHANNEL CHANNELS SIGNAL
    SHEET TOPIC LABEL DATASET TASK PATH PATH=VALUE NAME=VALUE NAME=COURSE NAME=COLUMN NAME=UNIT NAME=SCALE NAMES
    CYCLES ROW FIGURE COMMAND
"""
# Commands of other packages add theirs.
KINDS: dict[str, ParameterType] = QUANTITIES | {
    **dict.fromkeys(PLAIN.split(), ParameterType()),
    "STYLE": ParameterType(names=words("screen", "print", "gray", "projector")),
    "WIDTH": ParameterType(names=words("column", "page", "slide")),
    "FORMAT": ParameterType(names=words("svg", "pdf", "png")),
    "MACHINE": ParameterType(names=words("serial:", "daq")),
    "SCHEDULER": ParameterType(names=words("dask", "processes", "serial", "tcp://")),
    "KIND": ParameterType(names=words("map", "recording")),
    "MARK": ParameterType(names=words(".", ",")),
    "CONTROLLER": ParameterType(names=controllers, suffixes=(".py",), listed=True),
    "BENCH": ParameterType(names=words("B1", "J1")),
    "REFERENCE": ParameterType(names=words("R1", "R2", "R3", "R4")),
    "CYCLE": ParameterType(names=words("maximal", "isotonic", "valve")),
    "LEVEL": ParameterType(names=words("rest", "zero")),
    "POINT": ParameterType(names=words("L0", "peak", "trough")),
    "READING": ParameterType(names=words("printed", "throughout")),
    "VOLUME": ParameterType(names=words("paper", "potential")),
    "FRICTION": ParameterType(names=words("maxwell_slip", "dahl", "bouc_wen")),
    "CHAPTER": ParameterType(names=words("I", "II", "III", "IV", "discussion")),
    "SHELL": ParameterType(names=words("bash", "zsh", "fish")),
    # names of what ships, or files
    "SPECIMEN": ParameterType(names=specimens, suffixes=(".toml",)),
    "SPECIMEN|LAW": ParameterType(names=muscles_and_laws, suffixes=(".toml",)),
    "LAW": ParameterType(names=laws),
    "MODEL": ParameterType(names=frictions),
    "LAWS": ParameterType(names=laws, listed=True),
    "LAW|FILE.py:CLASS": ParameterType(names=laws, suffixes=(".py",)),
    "VALVE": ParameterType(names=valves),
    "PART": ParameterType(names=parts),
    "PROTOCOL": ParameterType(names=protocols, suffixes=(".toml",)),
    "RIG": ParameterType(names=rigs, suffixes=(".toml",)),
    "PLUMBING": ParameterType(names=plumbings),
    # files
    "TABLE": ParameterType(names=specimens, suffixes=(*DATA, ".toml")),
    "FILE": ParameterType(suffixes=DATA),
    "RECORDING": ParameterType(suffixes=RECORDINGS),
    "RECORD": ParameterType(suffixes=DATA),
    "LOG": ParameterType(suffixes=(".mcap",)),
    "CIRCUIT": ParameterType(suffixes=(".toml",)),
    "FIT": ParameterType(suffixes=(".json",)),
    "SWEEP": ParameterType(suffixes=(".toml",)),
    "CALIBRATION": ParameterType(suffixes=(".toml",)),
    "CALIBRATION|RECORDING": ParameterType(suffixes=(".toml", *RECORDINGS)),
    "SCORES": ParameterType(suffixes=(".json",)),
    "SCRIPT": ParameterType(suffixes=_ANY),
    "FOLDER": ParameterType(suffixes=("/",)),
    # files that are written
    "OUT": ParameterType(suffixes=_ANY),
    "OUT.mcap": ParameterType(suffixes=(".mcap",)),
}
# Kinds of files whose content may be piped in, named "-".
INPUTS = ("TABLE", "FILE", "RECORDING", "RECORD", "LOG", "CIRCUIT", "SWEEP", "CALIBRATION", "CALIBRATION|RECORDING")
INPUTS_WITH_NAMES = ("SPECIMEN", "SPECIMEN|LAW", "PROTOCOL", "RIG")


def kind_of(param: Any) -> ParameterType:
    """Kind of the value that a parameter takes."""
    return KINDS.get(str(param.metavar or ""), ParameterType())


def is_input(param: Any) -> bool:
    """Whether a parameter names files that are read."""
    return str(param.metavar or "") in INPUTS + INPUTS_WITH_NAMES


# ---- cautions


def cautions(params: Sequence[Any], values: dict[str, Any]) -> list[Caution]:
    """Cautions about given quantities that are far from those of muscles, rigs and their air, with the likely unit."""
    quantities: list[tuple[str, str, str, tuple[float, float] | None]] = []
    for p in params:
        value, kind = values.get(p.name), kind_of(p)
        if value is None or value == p.default:
            continue
        name = p.opts[0].lstrip("-").replace("-", " ") if p.param_type_name == "option" else p.name.replace("_", " ")
        for text in value if isinstance(value, list | tuple) else [value]:
            if kind.unit and kind.range and isinstance(text, str):
                quantities += [(name, one, kind.unit, kind.range) for one in _single(text, listed=kind.listed)]
            elif p.metavar == "PATH=VALUE" and isinstance(text, str) and "=" in text:
                path, _, content = text.partition("=")
                quantities += [(path.strip(), one, "", None) for one in _single(content, listed=True)]
    if not quantities:
        return []
    from ..slips import size_caution

    return list(collect(*(size_caution(text, unit, name=name, usual=ends) for name, text, unit, ends in quantities)))


def _single(text: str, *, listed: bool) -> list[str]:
    return [part.strip() for part in text.replace(";", ",").split(",") if part.strip()] if listed else [text]
