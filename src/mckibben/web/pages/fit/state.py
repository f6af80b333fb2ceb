"""Request of a fit: a table, the meaning of its columns, and other known values; as stated in links and commands."""

from __future__ import annotations

import dataclasses
import filecmp
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ....documents import JsonValue, parse_json
from ....errors import InputError
from ....quantities import declared, parse
from ....specimens import map_file, specimen
from ...reader import check_rows
from ...workspace import Workspace

if TYPE_CHECKING:
    from ....recordings import ForceMap
    from ....specimens import Specimen

KINDS = ("table", "recording", "map")  # an uploaded file, one of the recordings, a specimen that ships with a map
WORDS = ("part", "rest", "like", "branch", "zero", "below")
MOST_ROWS = 50_000  # of a table that is fitted
LINK = (*KINDS, "columns", "units", "known", *WORDS, "slack", "laws", "law", "view")


@dataclass(frozen=True)
class FitRequest:
    """A table and how to read it, as text; equal ones give equal fits.

    Attributes:
        kind: one of `KINDS`.
        name: name of the file or the specimen.
        columns: what a column holds, and its cell of the header; over what the header says.
        units: what a column holds, and its unit as text; over what the header says.
        known: parameters that are not fitted, with their values as text.
        part: sheet of a spreadsheet, or topic of a bag; the only one with numbers where empty.
        rest: rest length as text.
        like: a specimen whose dimensions are known.
        branch: branch of the rows that are kept.
        zero: what the pressure reads at zero, as text.
        below: gauge pressure up to which a separate fit is trained, as text.
        slack: use slack points to say where a law may not pull.
    """

    kind: str
    name: str
    columns: tuple[tuple[str, str], ...] = ()
    units: tuple[tuple[str, str], ...] = ()
    known: tuple[tuple[str, str], ...] = ()
    part: str = ""
    rest: str = ""
    like: str = ""
    branch: str = ""
    zero: str = ""
    below: str = ""
    slack: bool = True

    def link(self) -> dict[str, str | None]:
        """Parameters of an address."""
        parameters: dict[str, str | None] = {kind: self.name if kind == self.kind else None for kind in KINDS}
        for key in ("columns", "units", "known"):
            pairs = dict(getattr(self, key))
            parameters[key] = json.dumps(pairs, separators=(",", ":"), ensure_ascii=False) if pairs else None
        return {**parameters, **{w: getattr(self, w) or None for w in WORDS}, "slack": None if self.slack else "no"}

    def with_pair(self, key: str, name: str, words: str | None) -> FitRequest:
        """Return a copy with one column, unit or known parameter set or removed."""
        pairs = {k: v for k, v in getattr(self, key) if k != name}
        new: dict[str, Any] = {key: tuple(sorted({**pairs, **({name: words} if words else {})}.items()))}
        return dataclasses.replace(self, **new)


def from_link(words: Mapping[str, str]) -> FitRequest | None:
    """Read the request from an address; None if it names no table."""
    kind = next((k for k in KINDS if words.get(k)), None)
    if kind is None:
        return None
    pairs: dict[str, Any] = {key: _pairs(words.get(key, "")) for key in ("columns", "units", "known")}
    more: dict[str, Any] = {w: words.get(w, "") for w in WORDS}
    return FitRequest(kind, words[kind], **pairs, **more, slack=words.get("slack") != "no")


def _pairs(text: str) -> tuple[tuple[str, str], ...]:
    try:
        table = parse_json(text) if text else {}
    except (ValueError, RecursionError):
        return ()
    return tuple(sorted((str(k), str(v)) for k, v in table.items())) if isinstance(table, dict) else ()


def stored(workspace: Workspace, name: str, data: Path) -> Path:
    """Store an uploaded file; an identical one is reused.

    Raises:
        InputError: if it has more rows than a fit takes, or the name is not allowed; nothing is stored then.
    """
    path = workspace.uploads.path(name)
    check_rows(data, MOST_ROWS, "a fit")
    return path if path.is_file() and filecmp.cmp(path, data, shallow=False) else workspace.uploads.store(name, data)


def specimen_of(asked: FitRequest) -> Specimen | None:
    """Specimen of the map, or the one with the known dimensions."""
    name = asked.name if asked.kind == "map" else asked.like
    return specimen(name) if name else None


def file_of(workspace: Workspace, asked: FitRequest) -> Path:
    """Path of the table."""
    if asked.kind == "map":
        return map_file(specimen(asked.name))
    return (workspace.uploads if asked.kind == "table" else workspace.recordings).found(asked.name)


def read(path: Path, asked: FitRequest) -> ForceMap:
    """Read the table of a file as a force map, as the command ``fit`` does.

    Raises:
        InputError: names file, column, value and what is allowed.
    """
    from ....recordings import read_force_map
    from ....recordings.formats import part_options

    rest = parse(asked.rest, "m", field="rest length") if asked.rest else None
    spec = specimen_of(asked)
    if asked.kind == "map" and spec is not None:
        rest = rest or spec.property_si("rest_length", "m")
    zero = parse(asked.zero, "Pa", field="pressure zero") if asked.zero else 0.0
    try:
        return read_force_map(
            path,
            rest_length=rest,
            columns=dict(asked.columns),
            units=dict(asked.units),
            branch=asked.branch or None,
            pressure_zero=zero,
            **part_options(path, asked.part),
        )
    except InputError as error:  # the file by its name, not by its path on the server
        raise error.changed(where=path.name) from None


def known(asked: FitRequest) -> dict[str, float]:
    """Parameters that are not fitted [SI]: of the specimen, then stated ones."""
    from ....identification.ranking import known_of

    dimensions_known, fields = known_of(specimen_of(asked)), dimensions()
    for name, words in asked.known:
        if name not in fields:
            raise InputError(name, words, known=fields)
        dimensions_known[name] = parse(words, fields[name].unit, field=name)
        fields[name].check(name, dimensions_known[name])
    return dimensions_known


def dimensions() -> dict[str, JsonValue]:
    """Dimensions of a muscle that can be stated for a fit: declared by laws, and stated by specimens."""
    from ....muscles.laws import LAWS, law_type

    names = ("rest_diameter", "wall_thickness")
    every = {k: q for law in LAWS for k, q in declared(law_type(law)).items()}
    return {name: every[name] for name in names if name in every}


def below(asked: FitRequest) -> float | None:
    """Gauge pressure up to which a separate fit is trained [Pa]."""
    return parse(asked.below, "Pa", field="train below") if asked.below else None
