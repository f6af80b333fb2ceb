"""Kinds of values that options and arguments take, by the word that stands for them in the help.

The word states what is meant: ``--length LENGTH`` takes a length with its unit, ``--muscle SPECIMEN`` the id of a specimen
or a file. From it follow the SI unit, the caution about a value that can only be a slip, and what the shell completes.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from ..answers import Caution, collect
from ..documents import JsonValue, parse_toml

PACKAGE = Path(__file__).parents[1]
DATA = (
    ".csv",
    ".xlsx",
    ".ods",
    ".xls",
    ".txt",
    ".mat",
    ".tdms",
    ".parquet",
    ".h5",
    ".hdf5",
    ".mcap",
    ".db3",
    ".ddf",
    ".nc",
)
RECORDINGS = (".nc", ".csv", ".mcap")


class ValueKind(NamedTuple):
    """What a value is.

    Attributes:
        unit: SI unit of a quantity, else empty.
        range: within which such a quantity lies at muscles, rigs and their air [unit]; outside a value is a slip.
        names: lists the known names, for the shell.
        suffixes: of files that are taken, ``("",)`` for any; folders end in a slash.
        listed: whether several values are separated by commas.
    """

    unit: str = ""
    range: tuple[float, float] | None = None
    names: Callable[[], Iterable[tuple[str, str]]] | None = None
    suffixes: tuple[str, ...] = ()
    listed: bool = False


# ---- names, read from the files of the package without importing what computes


def specimens(*kinds: str) -> Iterator[tuple[str, str]]:
    """Ids and titles of the specimens of some kinds; muscles by default."""
    folders: list[str | Path] = [
        PACKAGE / "specimens" / "data",
        *filter(None, os.environ.get("MCKIBBEN_SPECIMENS", "").split(os.pathsep)),
    ]
    for table in _tables(folders):
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
    from importlib.metadata import entry_points

    files = sorted((PACKAGE / "muscles" / "laws").glob("[a-z]*.py"))
    yield from ((path.stem, _first_line(path)) for path in files)
    yield from ((point.name, point.value) for point in entry_points(group="mckibben.laws"))


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


def words(*known: str) -> Callable[[], Iterable[tuple[str, str]]]:
    """A fixed list of names."""
    return lambda: ((word, "") for word in known)


def _titles(folder: Path) -> Iterator[tuple[str, str]]:
    yield from (
        (path.stem, str(read_toml(path).get("title", "")))
        for path in sorted(folder.glob("*.toml"), key=lambda path: path.stem)
    )


def _tables(folders: Iterable[str | Path]) -> Iterator[dict[str, Any]]:
    yield from (read_toml(path) for folder in folders for path in sorted(Path(folder).glob("*.toml")))


def read_toml(path: Path) -> dict[str, JsonValue]:
    """The tables of a file; none if it cannot be read."""
    try:
        return parse_toml(path.read_text(encoding="utf-8"), where=str(path))
    except (OSError, ValueError):
        return {}


def _first_line(path: Path) -> str:
    with path.open(encoding="utf-8") as stream:
        return stream.readline().strip().strip('"')


# ---- kinds

_ANY = ("",)
KINDS: dict[str, ValueKind] = {
    # quantities with a unit
    "LENGTH": ValueKind("m", (1e-3, 20.0)),
    "SIZE": ValueKind("m", (1e-5, 0.5)),  # small: a diameter, a thickness, a moment arm, an error of a length
    "LENGTHxDIAMETER": ValueKind(),
    "PRESSURE": ValueKind("Pa", (1e3, 3e6)),
    "FORCE": ValueKind("N", (1e-2, 5e4)),
    "TIME": ValueKind("s", (1e-7, 1e10)),
    "FREQUENCY": ValueKind("1/s", (1e-4, 1e5)),
    "SPEED": ValueKind("m/s", (1e-5, 20.0)),
    "ANGLE": ValueKind("rad", (1e-4, 7.0)),
    "INERTIA": ValueKind("kg*m^2", (1e-8, 10.0)),
    "STIFFNESS": ValueKind("N/m", (1e2, 1e8)),
    "ACCELERATION": ValueKind("m/s^2", (1.0, 30.0)),
    "SHARE": ValueKind("1", (1e-9, 2.0)),
    "SHARES": ValueKind("1", (0.0, 1.0), listed=True),
    "CONTRACTION": ValueKind("1", (1e-4, 0.5)),
    "ACTIVATION": ValueKind("1", (1e-4, 1.0)),
    "HARDNESS": ValueKind(),
    "UNCERTAINTY": ValueKind(),  # in the unit of the channel
    # lists of them
    "LENGTHS": ValueKind("m", (1e-4, 20.0), listed=True),
    "PRESSURES": ValueKind("Pa", (1e3, 3e6), listed=True),
    "MASS": ValueKind("kg", (1e-4, 1e3)),
    "STYLE": ValueKind(names=words("screen", "print", "gray", "projector")),
    "WIDTH": ValueKind(names=words("column", "page", "slide")),
    "FORMAT": ValueKind(names=words("svg", "pdf", "png")),
    "ENERGY": ValueKind("J", (1e-2, 1e9)),
    "TANK": ValueKind(),
    "FLOW": ValueKind("m^3/s", (1e-8, 0.2)),
    "MASSES": ValueKind("kg", (1e-3, 2e3), listed=True),
    "FREQUENCIES": ValueKind("1/s", (1e-4, 1e5), listed=True),
    "COURSE": ValueKind(),  # values over time
    # numbers and words
    "N": ValueKind(),
    "NUMBER": ValueKind(),
    "TEXT": ValueKind(),
    "ADDRESS": ValueKind(),
    "MACHINE": ValueKind(names=words("serial:", "daq")),
    "SCHEDULER": ValueKind(names=words("dask", "processes", "serial", "tcp://")),
    "CHANNEL": ValueKind(),
    "CHANNELS": ValueKind(),
    "SIGNAL": ValueKind(),
    "SHEET": ValueKind(),
    "TOPIC": ValueKind(),
    "LABEL": ValueKind(),
    "DATASET": ValueKind(),
    "TASK": ValueKind(),
    "PATH": ValueKind(),
    "PATH=VALUE": ValueKind(),
    "NAME=VALUE": ValueKind(),
    "NAME=COURSE": ValueKind(),
    "NAME=COLUMN": ValueKind(),
    "NAME=UNIT": ValueKind(),
    "KIND": ValueKind(names=words("map", "recording")),
    "CYCLE": ValueKind(names=words("maximal", "isotonic", "valve")),
    "CYCLES": ValueKind(),  # numbers and ranges of them
    "LEVEL": ValueKind(names=words("rest", "zero")),
    "POINT": ValueKind(names=words("L0", "peak", "trough")),
    "READING": ValueKind(names=words("printed", "throughout")),
    "VOLUME": ValueKind(names=words("paper", "potential")),
    "FRICTION": ValueKind(names=words("maxwell_slip", "dahl", "bouc_wen")),
    "CHAPTER": ValueKind(names=words("I", "II", "III", "IV", "discussion")),
    "ROW": ValueKind(),
    "FIGURE": ValueKind(),
    "SHELL": ValueKind(names=words("bash", "zsh", "fish")),
    "COMMAND": ValueKind(),
    # names of what ships, or files
    "SPECIMEN": ValueKind(names=specimens, suffixes=(".toml",)),
    "SPECIMEN|LAW": ValueKind(names=muscles_and_laws, suffixes=(".toml",)),
    "LAW": ValueKind(names=laws),
    "MODEL": ValueKind(names=frictions),
    "LAWS": ValueKind(names=laws, listed=True),
    "LAW|FILE.py:CLASS": ValueKind(names=laws, suffixes=(".py",)),
    "VALVE": ValueKind(names=valves),
    "PART": ValueKind(names=parts),
    "PROTOCOL": ValueKind(names=protocols, suffixes=(".toml",)),
    "RIG": ValueKind(names=rigs, suffixes=(".toml",)),
    "PLUMBING": ValueKind(names=plumbings),
    # files
    "TABLE": ValueKind(names=specimens, suffixes=(*DATA, ".toml")),
    "FILE": ValueKind(suffixes=DATA),
    "RECORDING": ValueKind(suffixes=RECORDINGS),
    "RECORD": ValueKind(suffixes=DATA),
    "LOG": ValueKind(suffixes=(".mcap",)),
    "CIRCUIT": ValueKind(suffixes=(".toml",)),
    "CIRCUIT|SPECIMEN": ValueKind(names=specimens, suffixes=(".toml",)),
    "TARGET": ValueKind(names=words("c")),
    "HOST": ValueKind(names=words("python", "c")),
    "SCENARIO": ValueKind(names=words("isometric", "hang", "slack", "loop", "leak", "joint")),
    "FIT": ValueKind(suffixes=(".json",)),
    "SWEEP": ValueKind(suffixes=(".toml",)),
    "CALIBRATION": ValueKind(suffixes=(".toml",)),
    "CALIBRATION|RECORDING": ValueKind(suffixes=(".toml", *RECORDINGS)),
    "SCORES": ValueKind(suffixes=(".json",)),
    "SCRIPT": ValueKind(suffixes=_ANY),
    "FOLDER": ValueKind(suffixes=("/",)),
    # files that are written
    "OUT": ValueKind(suffixes=_ANY),
    "OUT.mcap": ValueKind(suffixes=(".mcap",)),
}
# Kinds of files whose content may be piped in, named "-".
INPUTS = ("TABLE", "FILE", "RECORDING", "RECORD", "LOG", "CIRCUIT", "SWEEP", "CALIBRATION", "CALIBRATION|RECORDING")
INPUTS_WITH_NAMES = ("SPECIMEN", "SPECIMEN|LAW", "PROTOCOL", "RIG")


def kind_of(param: Any) -> ValueKind:
    """Kind of the value that a parameter takes."""
    return KINDS.get(str(param.metavar or ""), ValueKind())


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
    from ..muscles.plausible import size_caution

    return list(collect(*(size_caution(text, unit, name=name, usual=ends) for name, text, unit, ends in quantities)))


def _single(text: str, *, listed: bool) -> list[str]:
    return [part.strip() for part in text.replace(";", ",").split(",") if part.strip()] if listed else [text]
