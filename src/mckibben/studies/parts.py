"""Catalogue of the parts that a design can name: valves, tubes, gas sources, tension laws and muscles, number by number.

It reads what other packages state, and states nothing itself: valves and muscles are specimens (those of the user's folders
too), tubes, sources and ranges of fluidic muscles are `specimens.parts`, laws are `muscles.laws`. A name found here is the
one that circuits, rigs, `Air` and `size` take. Numbers are in SI; one that no source prints is marked as inferred.
"""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

from ..answers import Answer, Caution, Column, Table
from ..citations import known_keys, reference
from ..documents import JsonValue, path_text
from ..errors import InputError
from ..extras import library
from ..muscles.biological import BiologicalMuscle
from ..muscles.laws import LAWS, law_type
from ..pneumatics.build import known_keys as keys_of_element
from ..pneumatics.build import passages_of, size_as, valve_from_specimen
from ..quantities import declared, in_si, with_unit
from ..specimens import KNOWN_PROPERTIES, Specimen, SpecimenNumber, specimen, specimens
from ..specimens import parts as published
from ..verbs import Flow, Mass, PartName, verb

if TYPE_CHECKING:
    import pandas

FLOWS = ("nominal_flow", "free_flow")  # what a least flow is compared with, of a valve and of a compressor
KINDS: dict[str, str] = {
    "valves": "Valves",
    "tubes": "Tubes",
    "sources": "Gas sources",
    "laws": "Tension laws",
    "muscles": "Muscles",
}
NAMED_IN: dict[str, str] = {
    "valves": 'specimen = "{id}" of a valve in circuits and rigs; mk.Air(valve="{id}"); mckibben size --valve {id}',
    "tubes": 'diameter = "{id}" of a tube in circuits and rigs; mk.Air(tube=("1 m", "{id}")); mckibben size',
    "sources": "mckibben size, which says how long it lasts",
    "laws": '--law {id} of every command with a muscle; mk.law("{id}", ..)',
    "muscles": 'the muscle of every command and page; mk.muscle("{id}")',
}
# Numbers in the list of each kind: name, title, SI unit, and unit in which it is shown.
LISTED: dict[str, tuple[tuple[str, str, str, str], ...]] = {
    "valves": (
        ("nominal_flow", "nominal flow", "m^3/s", "l/min"), ("mass", "mass", "kg", "g"), ("current", "current", "A", "A"),
        ("voltage", "voltage", "V", "V"),
    ),
    "tubes": (
        ("inner_diameter", "inside", "m", "mm"), ("outer_diameter", "outside", "m", "mm"),
        ("bend_radius", "bends to", "m", "mm"), ("modulus", "modulus", "Pa", "MPa"),
        ("density", "density", "kg/m^3", "kg/m^3"),
    ),
    "sources": (
        ("pressure", "pressure", "Pa", "bar"), ("filling", "filling", "kg", "g"),
        ("free_flow", "free flow", "m^3/s", "l/min"), ("stored_energy", "battery", "J", "kJ"), ("mass", "mass", "kg", "kg"),
    ),
    "laws": (),
    "muscles": (
        ("rest_length", "rest length", "m", "mm"), ("bore", "bore", "m", "mm"), ("rated_pressure", "rated", "Pa", "bar"),
    ),
}  # fmt: skip
ALSO = {"bore": "rest_inner_diameter"}  # another name of a number, in specimens
FORMS = {"valves": "element", "sources": "form", "muscles": "law"}
CUT_TO_LENGTH = "mckibben size, which cuts it to the length that is needed"


class PartNumber(NamedTuple):
    """A number of a part.

    Attributes:
        name: of the quantity.
        value: in `unit`; None for a parameter of a law, which has only bounds.
        unit: SI unit.
        low: lower end of what is possible [unit]; None if unknown.
        high: upper end [unit].
        source: citation key; empty if no source prints it.
        inferred: whether no source prints it.
        note: how it was derived, or what it means.
    """

    name: str
    value: float | None
    unit: str
    low: float | None = None
    high: float | None = None
    source: str = ""
    inferred: bool = False
    note: str = ""


@dataclass(frozen=True)
class ListedPart:
    """A part of the catalogue: a valve, a tube, a gas source, a tension law or a muscle.

    Attributes:
        id: name by which it is addressed.
        kind: one of `KINDS`.
        title: description.
        form: element of a valve, form of a source, default law of a muscle.
        numbers: its numbers.
        sources: citation keys.
        note: remarks.
        named_in: where its name can be written.
    """

    id: str
    kind: str
    title: str
    form: str
    numbers: tuple[PartNumber, ...]
    sources: tuple[str, ...]
    note: str = ""
    named_in: str = ""

    def number(self, name: str) -> PartNumber | None:
        """The number of a name; None if the part does not have it."""
        return next((n for n in self.numbers if n.name == name), None)

    def value(self, name: str) -> float | None:
        """Value of a number [SI]; None if the part does not have it."""
        number = self.number(name)
        return None if number is None else number.value

    def inferred(self) -> list[str]:
        """Names of the numbers that no source prints."""
        return [n.name for n in self.numbers if n.inferred]

    def references(self) -> list[str]:
        """References of the part and of its numbers, as sentences."""
        keys = dict.fromkeys((*self.sources, *(n.source for n in self.numbers if n.source)))
        known = set(known_keys())
        return [reference(key) if key in known else key for key in keys]

    def to_dict(self) -> dict[str, JsonValue]:
        """The part as plain values, numbers in SI."""
        numbers = [n._asdict() for n in self.numbers]
        return {**{f.name: getattr(self, f.name) for f in dataclasses.fields(self)}, "numbers": numbers}

    def table(self) -> Table:
        """Its numbers with range, source and note."""
        rows = [
            {"number": n.name, "value": n.value, "unit": n.unit, "note": n.note}
            | {"source": "inferred" if n.inferred else n.source}
            | {
                "range": ""
                if n.low is None or n.high is None
                else " to ".join(with_unit(x, n.unit) for x in (n.low, n.high))
            }
            for n in self.numbers
        ]
        columns = (Column("number"), Column("value", own="unit"), Column("range", right=True), Column("source"))
        title = f"{self.id}: {self.title} ({self.kind}{f', {self.form}' if self.form else ''})"
        return Table("\n".join([title, *([self.note] if self.note else [])]), (*columns, Column("note")), rows)

    def to_dataframe(self) -> pandas.DataFrame:
        """One row per number: value, unit, range, source, whether it is inferred, note.

        Raises:
            MissingLibraryError: pandas is not installed; it comes with the extra ``data``.
        """
        return frame_of([self])

    def __repr__(self) -> str:
        return f"ListedPart({self.id!r}, {self.kind}: {self.title}, {len(self.numbers)} numbers)"

    def _repr_html_(self) -> str:
        return self.table()._repr_html_()


def list_parts(
    kind: str | None = None, *, min_flow: Flow | None = None, max_mass: Mass | None = None
) -> tuple[ListedPart, ...]:
    """List the parts of the catalogue.

    Args:
        kind: one of `KINDS`; all by default.
        min_flow: least nominal flow of a valve (from 6 to 5 bar gauge), or free flow of a compressor [m^3/s].
        max_mass: largest mass [kg].

    Raises:
        InputError: the kind is unknown, or none of its parts states what is compared.
    """
    if kind is not None and kind not in KINDS:
        raise InputError("kind", kind, known=KINDS)
    listed = [part for name in KINDS if kind in (None, name) for part in _OF_KIND[name]()]
    if min_flow is not None:
        listed = _compared(listed, "min_flow", FLOWS, float(in_si(min_flow, "m^3/s", field="min_flow")), 1.0)
    if max_mass is not None:
        listed = _compared(listed, "max_mass", ("mass",), float(in_si(max_mass, "kg", field="max_mass")), -1.0)
    return tuple(listed)


def _compared(
    some: Iterable[ListedPart], field: str, names: tuple[str, ...], limit: float, side: float
) -> list[ListedPart]:
    values = [(part, next((v for n in names if (v := part.value(n)) is not None), None)) for part in some]
    if not any(value is not None for _, value in values):
        raise InputError(field, None, "compares valves and gas sources: the parts that were asked for do not state it")
    return [part for part, value in values if value is not None and side * value >= side * limit * (1.0 - side * 1e-9)]


def parts(kind: str | None = None, *, min_flow: float | None = None, max_mass: float | None = None) -> pandas.DataFrame:
    """List valves, tubes, gas sources, laws and muscles with their numbers, units and sources.

    Args:
        kind: ``valves``, ``tubes``, ``sources``, ``laws`` or ``muscles``; all by default.
        min_flow: least nominal flow of a valve (from 6 to 5 bar gauge), or free flow of a compressor [m^3/s].
        max_mass: largest mass [kg].

    Returns:
        A data frame with one row per number: part, kind, title, number, value [unit], unit (SI), low, high, source,
        inferred, note.

    Raises:
        InputError: the kind is unknown, or none of its parts states what is compared.
        MissingLibraryError: pandas is not installed; it comes with the extra ``data``.

    Examples:
        >>> import mckibben as mk
        >>> valves = mk.parts("valves", min_flow="300 l/min", max_mass="400 g")
        >>> sorted(set(valves.part))[:2]
        ['MHE4-3-2', 'MPYE-5-1-8-HF']
    """
    return frame_of(list_parts(kind, min_flow=min_flow, max_mass=max_mass))


def part(name: str) -> ListedPart:
    """Find a part of the catalogue by its name, or a specimen by its ``.toml`` file.

    Case does not matter, nor whether ``/`` or ``-`` is written; a valve without its flow means the one of low flow.

    Raises:
        InputError: there is none of that name.

    Examples:
        >>> import mckibben as mk
        >>> mk.part("PU-4x2").value("inner_diameter")
        0.002
    """
    name = path_text(name, "part")
    if name.lower().endswith(".toml"):
        return part_of_specimen(specimen(name))
    plain = name.lower().replace("/", "-")
    for wanted in (plain, f"{plain}-lf"):
        for spec in specimens():
            if spec.id.lower() == wanted:
                return part_of_specimen(spec)
        for kind in KINDS:
            for one in _OF_KIND[kind]() if kind != "valves" else ():
                if one.id.lower().replace("/", "-") == wanted:
                    return one
    raise InputError("part", name, known=[one.id for one in list_parts()])


def frame_of(some: Iterable[ListedPart]) -> pandas.DataFrame:
    """Data frame of parts, one row per number.

    Raises:
        MissingLibraryError: pandas is not installed; it comes with the extra ``data``.
    """
    frame: pandas.DataFrame = library("pandas", "Data frames need").DataFrame(rows_of(some), columns=list(COLUMNS))
    return frame


COLUMNS = ("part", "kind", "title", "number", "value", "unit", "low", "high", "source", "inferred", "note")


def rows_of(some: Iterable[ListedPart]) -> list[dict[str, JsonValue]]:
    """One row of `COLUMNS` per number of some parts."""
    rows = []
    for one in some:
        for n in one.numbers:
            values = n._asdict()
            head = {"part": one.id, "kind": one.kind, "title": one.title, "number": values.pop("name")}
            rows.append({key: (head | values)[key] for key in COLUMNS})
    return rows


@dataclass(frozen=True)
class FoundParts(Answer):
    """Parts of the catalogue: what `find_parts` finds.

    Attributes:
        parts: in the order of `KINDS`.
        named: whether it is one part that was asked for by its name.
        cautions: about what was asked for.
    """

    parts: tuple[ListedPart, ...]
    named: bool = False
    cautions: tuple[Caution, ...] = ()

    def to_dict(self) -> dict[str, JsonValue]:
        """Each part with all its numbers [SI]."""
        return {"parts": [one.to_dict() for one in self.parts]}

    def rows(self) -> list[dict[str, JsonValue]]:
        """One row of `COLUMNS` per number."""
        return rows_of(self.parts)

    def tables(self) -> list[Table]:
        """The page of the part that was named, or a list of each kind."""
        if self.named:
            return [self.parts[0].table()]
        kinds = {kind: [one for one in self.parts if one.kind == kind] for kind in KINDS}
        return [_list_of(kind, some) for kind, some in kinds.items() if some]

    def remarks(self) -> list[str]:
        """References and uses of the part that was named, or what a star means in the lists."""
        if self.named:
            (one,) = self.parts
            return [*one.references(), f"Its name can be used in: {one.named_in}."]
        pages = "mckibben parts NAME shows every number with its source and range."
        return [f"* inferred: no source at hand prints it. {pages}" if self.parts else "No part fits."]


def _list_of(kind: str, some: Iterable[ListedPart]) -> Table:
    rows: list[dict[str, Any]] = []
    for one in some:
        row = {"name": one.id, "title": one.title, "form": one.form, "numbers": len(one.numbers)}
        row |= {"inferred": len(one.inferred()), "parameters": ", ".join(n.name for n in one.numbers)}
        for name, *_ in LISTED[kind]:
            number = one.number(name) or one.number(ALSO.get(name, ""))
            if number is not None and number.value is not None:
                row |= {name: number.value, f"{name} inferred": number.inferred}
        rows.append(row)
    stated = [
        Column(name, title, unit, shown=shown, star=f"{name} inferred")
        for name, title, unit, shown in LISTED[kind]
        if any(name in row for row in rows)
    ]
    form = [Column("form", FORMS[kind])] if kind in FORMS else []
    counts = [Column("numbers", right=True), Column("inferred", right=True)]
    last = [Column("parameters")] if kind == "laws" else counts
    return Table(KINDS[kind], (Column("name"), Column("title", "what it is"), *form, *stated, *last), rows)


@verb
def find_parts(
    what: PartName | None = None, *, min_flow: Flow | None = None, max_mass: Mass | None = None
) -> FoundParts:
    """List valves, tubes, gas sources, laws and muscles with numbers, units and sources.

    Args:
        what: kind to list: valves, tubes, sources, laws or muscles; or the name of a part, whose page is shown.
        min_flow: least nominal flow of a valve, or free flow of a compressor [m^3/s], such as '100 l/min'.
        max_mass: largest mass [kg], such as '300 g'.

    Raises:
        InputError: there is no such kind or part, or none of the parts states what is compared.

    Examples:
        >>> from mckibben.studies.parts import find_parts
        >>> [one.id for one in find_parts("valves", min_flow="500 l/min").parts]
        ['MPYE-5-1-4', 'MPYE-5-1-8-HF']
    """
    if what is not None and what not in KINDS and min_flow is None and max_mass is None:
        return FoundParts((part(what),), named=True)
    return FoundParts(list_parts(what, min_flow=min_flow, max_mass=max_mass))


# ---- where they come from


def part_of_specimen(spec: Specimen) -> ListedPart:
    """A specimen as a part of the catalogue."""
    if spec.kind == "valve":
        return _valve(spec)
    numbers = [*_numbers(spec.properties, KNOWN_PROPERTIES)]
    for name in dict.fromkeys((spec.law, *spec.laws)):
        law: Any = BiologicalMuscle if name == "biological" else law_type(name)
        units = {key: q.unit for key, q in declared(law).items()}
        numbers += [n._replace(name=f"laws.{name}.{n.name}") for n in _numbers(spec.laws[name], units)]
    return _made("muscles", spec.id, spec.title, spec.law, tuple(numbers), spec.sources, spec.note)


def _made(
    kind: str, id_: str, title: str, form: str, numbers: tuple[PartNumber, ...], sources: Iterable[str], note: str = ""
) -> ListedPart:
    return ListedPart(id_, kind, title, form, numbers, tuple(sources), note, NAMED_IN[kind].format(id=id_))


def _numbers(group: Mapping[str, SpecimenNumber], units: Mapping[str, str]) -> Iterable[PartNumber]:
    for name, one in group.items():
        if name not in units:  # such as the shape of an activation, which is a table of its own
            continue
        value = one.si(units[name], field=name)
        if isinstance(value, list):
            continue
        low, high = (None, None) if one.range is None else (_in_unit(one, end, units[name]) for end in one.range)
        yield PartNumber(name, value, units[name], low, high, one.source, one.inferred, one.note)


def _in_unit(one: SpecimenNumber, end: float, unit: str) -> float:
    value = dataclasses.replace(one, value=end).si(unit, field="range")
    assert isinstance(value, float)
    return value


def _valve(spec: Specimen) -> ListedPart:
    units = {name: q.unit for name, q in keys_of_element(spec.element).items()} if spec.element else {}
    numbers = [*_numbers(spec.valve, units), *_numbers(spec.properties, KNOWN_PROPERTIES)]
    if spec.element and not any(n.name == "nominal_flow" for n in numbers):
        # of a file that leaves something out, which is said when the valve is used
        with contextlib.suppress(InputError):
            flow = size_as(getattr(valve_from_specimen(spec), passages_of(spec.element)[0]), "nominal_flow")
            note = "computed from the size that the file states, for comparison: from 6 to 5 bar gauge"
            numbers.insert(0, PartNumber("nominal_flow", flow, "m^3/s", inferred=True, note=note))
    return _made("valves", spec.id, spec.title, spec.element, tuple(numbers), spec.sources, spec.note)


def _published(kind: str, name: str) -> Iterator[ListedPart]:
    for p in published.parts(name):
        form = p.form or (f"law of {p.law}" if p.law else "")
        yield _made(kind, p.id, p.title, form, tuple(_numbers(p.stated, published.KINDS[name])), p.sources, p.note)


def _laws() -> list[ListedPart]:
    listed = []
    for name in LAWS:
        law = law_type(name)
        numbers = tuple(
            PartNumber(key, None, q.unit, *q.bounds, note=f"{q.doc}{f' ({q.symbol})' if q.symbol else ''}")
            for key, q in declared(law).items()
        )
        listed.append(_made("laws", name, law.title, "", numbers, law.cites))
    return listed


def _muscles() -> list[ListedPart]:
    listed = [part_of_specimen(spec) for spec in specimens() if spec.kind != "valve"]
    return listed + [dataclasses.replace(p, named_in=CUT_TO_LENGTH) for p in _published("muscles", "fluidic_muscle")]


_OF_KIND: dict[str, Callable[[], list[ListedPart]]] = {
    "valves": lambda: [_valve(spec) for spec in specimens() if spec.kind == "valve"],
    "tubes": lambda: [*_published("tubes", "tube")],
    "sources": lambda: [*_published("sources", "gas_source")],
    "laws": _laws,
    "muscles": _muscles,
}
