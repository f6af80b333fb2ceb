"""Tension, volume and state of a muscle at lengths and pressures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, cast

import numpy as np

from .. import muscles, verbs
from ..answers import Answer, Caution, Column, Table, collect
from ..documents import JsonValue
from ..errors import InputError
from ..muscles.build import changed_parameters, missing_parameters, needed_words
from ..muscles.muscle import built_muscle
from ..quantities import MOST_VALUES, declared, shown_unit, values, with_unit
from ..specimens import Specimen, muscle_specimen, specimens

# Units of a law's state at a point, in the order in which they are shown.
STATE = {"tension": "N", "passive": "N", "active": "N", "volume": "m^3", "stiffness": "N/m", "free_length": "m"}
BAND = {"tension_low": "N", "tension_high": "N"}


@dataclass(frozen=True)
class Tensions(Answer):
    """State of a muscle at each of some points: what `tension` computes.

    Attributes:
        muscle: with its law; cut to another length where a rest length was given.
        law: name of the law.
        points: a row per length and pressure or activation, lengths first [SI]; ``by_law`` has the tensions by other laws of
            the braid, ``tension_low`` and ``tension_high`` the ends of `band`.
        band: what the ends are those of: the range of uncertain numbers, or the 95 % of a muscle of the make, of this one as
            calibrated, or of a posterior.
        defaults: parameters of a law without specimen that were left to its defaults.
        cautions: about lengths, pressures, the law and its posterior.
    """

    muscle: muscles.Muscle
    law: str
    points: Sequence[Mapping[str, Any]]
    band: str
    defaults: tuple[str, ...] = ()
    cautions: tuple[Caution, ...] = field(default=())

    units: ClassVar[Mapping[str, str]] = STATE | {"length": "m", "pressure": "Pa", "braid_length": "m"} | BAND

    @property
    def interval(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Low and high ends of the tension at each point (n,) [N]; None where nothing says how far it is off."""
        if "tension_low" not in self.points[0]:
            return None
        low, high = (np.array([point[key] for point in self.points]) for key in BAND)
        return low, high

    def to_dict(self) -> dict[str, JsonValue]:
        """The state at one point, or several as ``points``; law, specimen and cautions beside."""
        spec = self.muscle.specimen
        about: dict[str, Any] = {"law": self.law, "specimen": None if spec is None else spec.id}
        about |= {
            "warnings": [one.text for one in self.cautions],
            "law_error": muscles.evidence.law_error(spec, self.muscle.law),
        }
        if spec is None:
            about |= {"parameters": values(self.muscle.law), "defaults": list(self.defaults)}
        return dict(self.points[0] if len(self.points) == 1 else {"points": self.points}) | about

    def rows(self) -> list[dict[str, JsonValue]]:
        """One row per point."""
        return [{key: value for key, value in point.items() if key != "by_law"} for point in self.points]

    def tables(self) -> list[Table]:
        """The state at one point line by line, or a line per point."""
        spec, law = self.muscle.specimen, cast(Any, self.muscle.law)
        title = f"{law.title} law" if spec is None else f"{spec.title}, {self.law}"
        return [self._one(title) if len(self.points) == 1 else self._several(title)]

    def _one(self, title: str) -> Table:
        point = self.points[0]
        lines = {
            key.replace("_", " "): "not known to this law" if point[key] != point[key] else with_unit(point[key], unit)
            for key, unit in STATE.items()
        }
        tension = {"tension": lines.pop("tension")}
        if "tension_low" in point:
            ends = [with_unit(point[key], "N") for key in BAND]
            if {*ends} != {tension["tension"]}:  # ranges of numbers that do not matter here say nothing
                tension |= {f"tension, {self.band}": " to ".join(ends)}
        others = list(point.get("by_law", {}).items())[1:]
        lines = tension | {f"by {law}": with_unit(pull, "N") for law, pull in others} | lines
        state = ["slack" if point["slack"] else "taut"] + ["overstretched"] * point["overstretched"]
        drive = with_unit(point["pressure"], "Pa") if "pressure" in point else f"activation {point['activation']:g}"
        title = f"{title}, at {with_unit(point['length'], 'm')} and {drive}: {', '.join(state)}"
        rows = [{"name": name, "value": value} for name, value in lines.items()]
        return Table(title, (Column("name", ""), Column("value", "", right=True)), rows)

    def _several(self, title: str) -> Table:
        drive = Column("pressure", unit="Pa") if "pressure" in self.points[0] else Column("activation", unit="1")
        tension = Column("tension", unit="N")
        band = [Column("tension_low", f"{self.band}: from", "N"), Column("tension_high", "to", "N")]
        columns = [Column("length", unit="m"), drive, tension]
        shown = ({tension.text(p.get(key)) for key in ("tension", *BAND)} for p in self.points)
        # ranges of numbers that matter nowhere here say nothing
        columns += band if "tension_low" in self.points[0] and any(len(words) > 1 for words in shown) else []
        columns += [Column("volume", unit="m^3"), Column("stiffness", unit="N/m"), Column("state", "")]
        rows = [
            {**point, "state": ", ".join(["slack"] * point["slack"] + ["overstretched"] * point["overstretched"])}
            for point in self.points
        ]
        return Table(title, tuple(columns), rows)

    def remarks(self) -> list[str]:
        """The error of the law, and which parameters of a named one were not given."""
        error = muscles.evidence.error_of(self.muscle.specimen, self.muscle.law)
        known = declared(type(self.muscle.law))
        stated = (f"{n} = {with_unit(float(getattr(self.muscle.law, n)), known[n].unit)}" for n in self.defaults)
        said = [] if error is None else [f"Error of the law: {error}."]
        spec = self.muscle.specimen
        interval = "" if spec is None else muscles.evidence.interval_words(spec, self.muscle.law)
        said += [f"{interval[:1].upper()}{interval[1:]}."] if interval else []
        return said + ([f"Not given, by default of the law: {', '.join(stated)}."] if self.defaults else [])


@verbs.verb
def tension(
    muscle: verbs.MuscleOrLaw,
    *,
    length: verbs.Length | Sequence[verbs.Length] | None = None,
    contraction: verbs.Contraction | Sequence[verbs.Contraction] | None = None,
    pressure: verbs.Pressure | Sequence[verbs.Pressure] | None = None,
    activation: verbs.Activation | Sequence[verbs.Activation] | None = None,
    target_tension: verbs.Force | None = None,
    law: verbs.LawName | None = None,
    parameters: verbs.Changes | None = None,
    reading: verbs.TensionReading | Sequence[verbs.TensionReading] | None = None,
    same_rig: bool = False,
    posterior: verbs.PosteriorFile | None = None,
) -> Tensions:
    """Compute tension, volume and state of a muscle at one length and pressure.

    A range of lengths, contractions or pressures, such as '1:5 bar' or '0:25:5 %', gives a table.

    Args:
        muscle: id of a specimen, the .toml file of one, or the name of a law.
        length: distance between the anchors [m], such as '12 cm', or a range '10:15 cm'.
        contraction: contraction from the rest length instead of a length, such as '20 %'; negative if stretched.
        pressure: gauge pressure [Pa], such as '5 bar', or a range '1:5 bar'.
        activation: activation of a biological muscle, between 0 and 1, or a range '0:1:0.25'.
        target_tension: find the lowest pressure for this tension instead [N], such as '50 N'.
        law: law to use instead of the specimen's default, or my.py:MyLaw.
        parameters: replace a parameter, such as law.turns=3.2 or thread_length='16 cm'.
        reading: calibrate the muscle by one to three readings of it, such as '126.75 mm, 5.5 bar, 140 N'.
        same_rig: take the muscle to be on the rig on which its make was measured, for a narrower interval.
        posterior: result of `mckibben fit --posterior --out fit.json`, for 95 % bands of the answer.

    Raises:
        InputError: muscle or law is unknown; a length or what drives is missing, out of range or given twice.

    Examples:
        >>> from mckibben.studies.tension import tension
        >>> answer = tension("nylon", length="12 cm", pressure="5 bar")
        >>> [round(row["tension"]) for row in answer.rows()]
        [57]
    """
    built, chosen, defaults = _muscle(muscle, law, parameters)
    biological = built.specimen is not None and built.specimen.kind == "biological"
    lengths = _lengths(length, contraction, built)
    drives = _drives(target_tension, pressure, activation, built, lengths, muscle, biological)
    if len(lengths) * len(drives) > MOST_VALUES:
        count = f"{len(lengths):,} lengths by {len(drives):,} drives"
        problem = f"and its drive must be at most {MOST_VALUES:,} points together, got {count}"
        raise InputError("length" if contraction is None else "contraction", None, problem)
    said: tuple[Caution, ...] = ()
    spread = muscles.evidence.make_spread(built.specimen, built.law)
    if same_rig and (spread is None or spread.same_rig is None or posterior is not None):
        known = "a muscle whose specimen states how far others on its rig are from it, and which no readings calibrated"
        problem = "without {posterior}" if posterior is not None else f"for {known}, such as festo-10mm"
        raise InputError("same_rig", None, f"is allowed only {problem}")
    if reading is not None:
        from ..identification.calibration import calibrate_muscle

        built, new = calibrate_muscle(built, reading, same_rig=same_rig)
        said = new.cautions()
    points = [_point(built.law, at, drive, biological) for at in lengths for drive in drives]
    said += collect(*built.length_cautions(lengths, text=verbs.typed(length)))
    said += () if biological else _cautions(built, chosen, drives, pressure)
    said += _add_ranges(points, built, chosen)
    of_make = _add_spread(points, built, same_rig) if posterior is None else ""
    if posterior is not None:
        said += _add_bands(points, posterior, built, chosen, str(muscle))
    band = of_make or ("range" if posterior is None else "95 %")
    return Tensions(built, chosen, points, band, defaults, collect(*said))


def _muscle(name: Any, law: str | None, changes: verbs.Changes | None) -> tuple[muscles.Muscle, str, tuple[str, ...]]:
    """The muscle, the name of its law, and parameters that a law without specimen has by default."""
    if name in muscles.laws.LAWS:
        if law is not None:
            raise InputError("law", None, f"is allowed only with a specimen; {name} is a law itself")
        stated = changed_parameters(changes, name)
        missing = missing_parameters(name, stated)
        if missing:
            blanks = {key: ".." if q.unit == "1" else f"'.. {shown_unit(q.unit)}'" for key, q in missing}
            words = " ".join(f"{{parameters}} {key}={blank}" for key, blank in blanks.items())
            having = [s.id for s in specimens() if name in s.laws]
            others = (
                f", or name a specimen that states this law with {{law}} {name}: {', '.join(having)}" if having else ""
            )
            it = "it" if len(missing) == 1 else "them"
            sentence = f"The law {name} needs {needed_words(missing)}. Give {it} with {words}{others}"
            raise InputError(f"{name}.{missing[0][0]}", "not given", f"give {words}", sentence=sentence)
        built = built_muscle(name, **cast(Any, stated))
        return built, name, tuple(n for n in declared(type(built.law)) if n not in stated)
    if isinstance(name, muscles.Muscle) and name.specimen is not None and not changes and law in (None, name.law_name):
        return name, name.law_name, ()
    spec = name if isinstance(name, Specimen) else muscle_specimen(name)
    if spec.kind == "valve":
        raise InputError("specimen", spec.id, "must be a muscle; it is a valve")
    if law is not None and not law.strip():
        raise InputError("law", law, f"{spec.id} states", known=spec.laws)
    chosen = law or spec.law
    return built_muscle(spec, law=chosen, **cast(Any, changed_parameters(changes, chosen, of=spec))), chosen, ()


def _lengths(length: Any, contraction: Any, muscle: muscles.Muscle) -> list[float]:
    """Lengths between the anchors [m]."""
    if (length is None) == (contraction is None):
        problem = "is missing: give a length such as '12 cm', or a contraction such as {contraction} '20 %'"
        raise InputError("length", None, problem if length is None else "is allowed only without {contraction}")
    if length is None:
        try:
            return [float(muscle.length_at(share)) for share in contraction]
        except InputError as error:
            raise error.changed(field="contraction") from None
    if not all(0.0 < at <= 100.0 for at in length):
        raise InputError("length", verbs.typed(length), "must be a length above 0 and up to 100 m")
    return list(length)


def _drives(
    target_tension: Any,
    pressure: Any,
    activation: Any,
    muscle: muscles.Muscle,
    lengths: list[float],
    name: Any,
    biological: bool,
) -> list[float]:
    """Gauge pressures [Pa], or activations [1] of a biological muscle."""
    if target_tension is not None:
        for other, value in (("pressure", pressure), ("activation", activation)):
            if value is not None:
                raise InputError("target_tension", None, f"is allowed only without {{{other}}}, which it finds")
        if len(lengths) > 1:
            raise InputError("target_tension", verbs.typed(target_tension), "is allowed only with one length")
        return [float(muscle.law.pressure_for(target_tension, lengths[0]))]
    if biological:
        of = f"{getattr(muscle.specimen, 'id', name)} is a biological muscle"
        if pressure is not None:
            raise InputError("pressure", verbs.typed(pressure), f"{of}; give {{activation}} from 0 to 1")
        if activation is None:
            raise InputError("activation", None, f"is missing: {of}, which needs one from 0 to 1")
        if not all(0.0 <= value <= 1.0 for value in activation):
            raise InputError("activation", verbs.typed(activation), "must be between 0 and 1")
        return list(activation)
    if activation is not None:
        raise InputError(
            "activation",
            verbs.typed(activation),
            f"{name} is no biological muscle; give {{pressure}} or {{target_tension}}",
        )
    if pressure is None:
        raise InputError(
            "pressure", None, "is missing: give a gauge pressure such as '5 bar', or a tension with {target_tension}"
        )
    if min(pressure) < muscles.plausible.LEAST_GAUGE or max(pressure) > 1e8:
        raise InputError("pressure", verbs.typed(pressure), "must be between -1.1 bar (vacuum) and 1000 bar gauge")
    return list(pressure)


def _point(law: Any, length: float, drive: float, biological: bool) -> dict[str, Any]:
    """State of a law at a length [m] and a gauge pressure [Pa] or activation [1]."""
    state = law.state(length, drive)
    point = {"length": length, "activation" if biological else "pressure": drive}
    point |= {name: float(getattr(state, name)) for name in ("tension", "passive", "active", "volume")}
    point |= {name: bool(getattr(state, name)) for name in ("slack", "overstretched")}
    point |= {name: float(getattr(state, name)) for name in ("stiffness", "braid_length")}
    return point | {"free_length": float(law.free_length(drive))}


def _cautions(muscle: muscles.Muscle, law: str, drives: list[float], pressure: Any) -> tuple[Caution, ...]:
    """Cautions about pressures and the law of a McKibben muscle."""
    spec = muscle.specimen
    high = (
        None if pressure is None else muscles.plausible.pressure_caution(max(drives), spec, text=verbs.typed(pressure))
    )
    free = muscles.plausible.free_length_caution(muscle.law, drives, spec)
    return collect(high, free, *muscles.evidence.law_cautions(spec, muscle.law, at_rest=False))


def _add_ranges(points: list[dict[str, Any]], muscle: muscles.Muscle, name: str) -> tuple[Caution, ...]:
    """Add to each point what ranges of a specimen's numbers leave of its tension, and the tensions by other laws.

    Returns:
        Cautions where the laws of a braid differ, for the point at which they do most, and where none can pull.
    """
    spec = muscle.specimen
    if spec is None or spec.kind != "mckibben":
        return ()
    at = [np.array([p[name] for p in points]) for name in ("length", "pressure")]
    ends = muscles.evidence.tension_range(spec, name, muscle.law, *at)
    for point, low, high in zip(points, *ends, strict=True) if ends is not None else ():
        point |= {"tension_low": float(low), "tension_high": float(high)}
    said = []
    for point in points:
        others = muscles.sleeve.other_laws(spec, name, point["length"], point["pressure"])
        point |= {"by_law": {name: point["tension"]} | others} if others else {}
        differing = muscles.sleeve.differing_caution(spec, name, point["tension"], others)
        said += [(max(others.values()) - min(others.values()), differing)] if differing else []
    beyond = muscles.evidence.beyond_braid_caution(muscle.law, at[0], np.array([p["tension"] for p in points]))
    return collect(max(said, key=lambda one: one[0])[1] if said else None, beyond)


def _add_spread(points: list[dict[str, Any]], muscle: muscles.Muscle, same_rig: bool) -> str:
    """Add to each point the 95 % interval of the tension of one muscle of the make; returns of which, in words."""
    spec = muscle.specimen
    if spec is None or spec.kind != "mckibben":
        return ""
    at = (np.array([p[name] for p in points]) for name in ("length", "pressure"))
    band = muscles.evidence.tension_interval(spec, muscle.law, *at, same_rig=same_rig)
    if band is None:
        return ""
    spread = muscles.evidence.make_spread(spec, muscle.law)
    for point, low, high in zip(points, *band, strict=True):
        point |= {"tension_low": float(low), "tension_high": float(high)}
    if spread is None:
        return "95 %, this muscle"
    if spread.calibrated is not None:
        return "95 %, calibrated"
    return "95 %, of the make on its rig" if same_rig else "95 %, any of the make"


def _add_bands(
    points: list[dict[str, Any]], file: Any, muscle: muscles.Muscle, law: str, name: str
) -> tuple[Caution, ...]:
    """Add the 95 % of a posterior to each point; cautions about points and tensions outside of it."""
    from ..identification import read_posterior

    posterior = read_posterior(file, law=law)
    posterior.check_muscle(cast(Any, muscle.law), name)
    at = [[p["length"] for p in points], [p["pressure"] for p in points]]
    band = posterior.tension(*at)
    for point, low, high in zip(points, band.low, band.high, strict=True):
        point |= {"tension_low": float(low), "tension_high": float(high)}
    beyond = posterior.beyond(*at)
    outside = [p for p in points if not p["tension_low"] <= p["tension"] <= p["tension_high"]]
    which = "" if len(points) == 1 else f" at {len(outside)} of {len(points)} points"
    lacks = (
        f"the tension of the muscle's own parameters lies outside of the 95 % of the posterior{which}, which adds to the "
        "law what its measured points have besides; the parameters are not the posterior's, or the law lacks that much"
    )
    return collect(
        None if beyond is None else Caution(beyond, "posterior"), Caution(lacks, "tension") if outside else None
    )
