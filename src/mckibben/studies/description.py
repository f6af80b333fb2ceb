"""Muscles in words: those that ship, the parameters that one of them states, and one that is made of a braid."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .. import muscles
from ..accessors import implementation
from ..answers import Answer, Caution, Column, Table, collect
from ..documents import JsonValue
from ..errors import InputError
from ..specimens import Specimen, SpecimenNumber, specimen, specimens
from ..verbs import Angle, Diameter, Hardness, LawName, Length, MuscleName, SmallLength, verb


@dataclass(frozen=True)
class ShippedMuscles(Answer):
    """The muscles that ship, with their sources: what `list_muscles` finds."""

    muscles: tuple[Specimen, ...]

    def to_dict(self) -> dict[str, JsonValue]:
        """Id, source, law and inferred numbers of each."""
        return {"specimens": [{name: row[name] for name in row if name != "title"} for row in self.rows()]}

    def rows(self) -> list[dict[str, Any]]:
        """One row per muscle."""
        return [
            {"id": s.id, "source": s.source(), "law": s.law, "inferred": s.inferred(), "title": s.title}
            for s in self.muscles
        ]

    def tables(self) -> list[Table]:
        """Each muscle with the number of its values that no source prints."""
        rows = [row | {"inferred": len(row["inferred"])} for row in self.rows()]
        words = (Column("id"), Column("title", "what it is"), Column("law"), Column("source"))
        return [Table("Muscles", (*words, Column("inferred", "inferred numbers", right=True)), rows)]


@verb
def list_muscles() -> ShippedMuscles:
    """List the muscles that ship, with their sources.

    Examples:
        >>> from mckibben.studies.description import list_muscles
        >>> [row["law"] for row in list_muscles().rows() if row["id"] == "nylon"]
        ['linear_threshold']
    """
    return ShippedMuscles(tuple(s for s in specimens() if s.kind != "valve"))


@dataclass(frozen=True)
class MuscleDescription(Answer):
    """What a specimen states, and the law that stands for it: what `describe_muscle` finds.

    Attributes:
        specimen: whose numbers these are.
        law_name: of the law that was asked for.
        law: that law; None of a valve.
        cautions: about the law.
        sources: keys of the references of the numbers.
    """

    specimen: Specimen
    law_name: str
    law: Any
    cautions: tuple[Caution, ...] = ()
    sources: tuple[str, ...] = ()

    def numbers(self) -> dict[str, SpecimenNumber]:
        """Properties, parameters and error of the law, and friction, by their paths."""
        spec, name = self.specimen, self.law_name
        groups = {"properties": spec.properties} | ({f"laws.{name}": spec.laws[name]} if self.law is not None else {})
        groups |= {f"errors.{name}": spec.errors[name]} if name in spec.errors else {}
        groups |= {f"friction.{key}": group for key, group in spec.friction.items()}
        return {f"{path}.{key}": number for path, group in groups.items() for key, number in group.items()}

    def to_dict(self) -> dict[str, JsonValue]:
        """The numbers by path as their file states them, and the error of the law."""
        spec = self.specimen
        return {
            "id": spec.id,
            "title": spec.title,
            "law": self.law_name,
            "laws": list(spec.laws),
            "parameters": {path: _entry(number) for path, number in self.numbers().items()},
            "sources": spec.sources,
            "law_error": muscles.evidence.law_error(spec, self.law),
        }

    def rows(self) -> list[dict[str, JsonValue]]:
        """One row per number."""
        return [{"parameter": path} | _entry(number) for path, number in self.numbers().items()]

    def tables(self) -> list[Table]:
        """Every number in the unit of its file, with its source."""
        rows = [
            {"parameter": path, "value": _amount(p), "source": p.source, "note": p.note}
            | {"inferred": "inferred" if p.inferred else ""}
            for path, p in self.numbers().items()
        ]
        columns = (Column("parameter"), Column("value", right=True), Column("source"), Column("inferred", ""))
        return [Table(f"{self.specimen.title} ({self.specimen.id})", (*columns, Column("note")), rows)]

    def remarks(self) -> list[str]:
        """The law, others that are stated, and the error of the law."""
        others = ", ".join(key for key in self.specimen.laws if key != self.law_name) or "none"
        title = getattr(self.law, "title", self.law_name)
        said = [] if self.law is None else [f"Law: {title}. Other laws stated: {others}."]
        error = muscles.evidence.error_of(self.specimen, self.law_name)
        said += [] if error is None else [f"Error of the law: {error}."]
        if self.law is None:
            return said
        return [*said, f"One muscle: {muscles.evidence.interval_words(self.specimen, self.law)}."]

    def data_sheet(self, path: str | Path) -> Path:
        """Write the data sheet of a McKibben muscle on one page, in the terms of makers' sheets.

        Args:
            path: of the file, ``.html`` or ``.pdf``.

        Raises:
            InputError: it is no McKibben muscle, the ending is another, or what sets a PDF file is not installed.
        """
        written: Path = implementation("write_data_sheet")(self, path)
        return written


def _entry(number: SpecimenNumber) -> dict[str, JsonValue]:
    return {name: getattr(number, name) for name in ("value", "unit", "source", "inferred", "note")}


def _amount(number: SpecimenNumber) -> str:
    values = number.value if isinstance(number.value, list) else [number.value]
    text = ", ".join(f"{one:g}" for one in values)
    return text if number.unit == "1" else f"{text} {number.unit}"


@verb
def describe_muscle(muscle: MuscleName, *, law: LawName | None = None) -> MuscleDescription:
    """Show the parameters of a muscle with their units and sources, and its law.

    Args:
        muscle: id of a specimen, or the .toml file of one.
        law: law to use instead of the specimen's default, or my.py:MyLaw.

    Raises:
        InputError: the muscle is unknown, or does not state the law.
    """
    spec = muscle if isinstance(muscle, Specimen) else specimen(muscle)
    if law is not None and not law.strip():
        raise InputError("law", law, f"{spec.id} states", known=spec.laws)
    chosen = spec.law if law is None else law
    built = None if spec.kind == "valve" else muscles.muscle.built_muscle(spec, law=chosen).law
    cautions = collect(*muscles.evidence.law_cautions(spec, built))
    return MuscleDescription(spec, chosen, built, cautions, tuple(dict.fromkeys(spec.sources)))


@dataclass(frozen=True)
class BraidDescription(Answer):
    """A muscle that was computed from the dimensions of its braid: what `describe_braid` finds.

    Attributes:
        specimen: with a range for each number that is not known.
        cautions: how far its tensions may be off, and what weakens a short one.
    """

    specimen: Specimen
    cautions: tuple[Caution, ...]

    def to_dict(self) -> dict[str, JsonValue]:
        """The specimen as its file states it, and the errors of its laws on published muscles."""
        errors = {law: [error._asdict() for error in known] for law, known in muscles.sleeve.ERRORS.items()}
        return {"specimen": self.specimen.stated(), "errors": errors}

    def tables(self) -> list[Table]:
        """The parameters of the recommended law and of the friction, and the errors of all laws."""
        spec = self.specimen
        groups = {f"laws.{spec.law}": spec.laws[spec.law]} | {f"friction.{k}": g for k, g in spec.friction.items()}
        rows = [
            {"parameter": f"{path}.{key}", "value": _amount(number), "from": number.note}
            | {"range": "" if number.range is None else f"{number.range[0]:g} to {number.range[1]:g}"}
            for path, group in groups.items()
            for key, number in group.items()
        ]
        columns = (Column("parameter"), Column("value", right=True), Column("range"), Column("from"))
        makes = [error.make for error in next(iter(muscles.sleeve.ERRORS.values()))]
        errors = [
            {"law": law} | {e.make: f"{100 * e.rms:.0f} % rms, {100 * e.largest:.0f} %" for e in known}
            for law, known in muscles.sleeve.ERRORS.items()
        ]
        title = "Errors on published muscles, of the largest tension: rms, largest"
        return [Table(spec.title, columns, rows), Table(title, tuple(map(Column, ("law", *makes))), errors)]


@verb
def describe_braid(
    *,
    rest_length: Length,
    braid_angle: Angle,
    diameter: Diameter,
    thread_diameter: SmallLength,
    bladder_thickness: SmallLength,
    shore: Hardness | None = None,
    name: str = "braid",
) -> BraidDescription:
    """Describe a muscle from the dimensions of its braid and bladder, with ranges for what is not known.

    Args:
        rest_length: length between the fittings without pressure and load [m], such as '300 mm'.
        braid_angle: angle of the threads from the long axis at that length [rad], such as '25 deg'.
        diameter: outer diameter of the braid at that length [m], such as '12 mm'.
        thread_diameter: diameter of one thread [m], such as '0.25 mm'.
        bladder_thickness: wall thickness of the bladder [m], such as '1 mm'.
        shore: Shore A hardness of the bladder, such as 40A; 45 with a wide range by default.
        name: id of the specimen.

    Raises:
        InputError: a dimension is out of its bounds, or bladder and threads fill the braid.

    Examples:
        >>> from mckibben.studies.description import describe_braid
        >>> sleeve = {"rest_length": "300 mm", "braid_angle": "25 deg", "diameter": "12 mm"}
        >>> answer = describe_braid(**sleeve, thread_diameter="0.25 mm", bladder_thickness="1 mm")
        >>> answer.specimen.law
        'linear_threshold'
    """
    dimensions: dict[str, Any] = {
        "rest_length": rest_length,
        "diameter": diameter,
        "braid_angle": braid_angle,
        "thread_diameter": thread_diameter,
        "bladder_thickness": bladder_thickness,
    }
    try:
        spec = muscles.sleeve.from_braid(**dimensions, shore=shore, name=name)
    except InputError as error:
        at = dimensions.get(error.field)
        raise InputError(error.field, error.value if at is None else at, error.problem) from None
    slender = muscles.sleeve.slenderness_caution(spec)
    return BraidDescription(
        spec, collect(None if slender is None else Caution(slender), muscles.evidence.braid_caution(spec, spec.law))
    )
