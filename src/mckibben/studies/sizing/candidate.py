"""Candidates of sizing: law, values at both ends of the stroke, and margins to the requirements.

promised force = tension of the law at the end of the stroke - friction - error of the law x largest tension
margin = (what it has over what is needed) - 1      of the force, the stroke, the diameter, the length, the pressure
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from ..._jax import Scalar
from ...analysis.energy.cycles import PotentialMuscle, Probe
from ...answers import brief
from ...assembly.build import INFERRED as ASSEMBLED
from ...assembly.muscle_unit import MuscleUnit
from ...components.gas import AIR
from ...documents import JsonValue
from ...muscles.evidence import interval_words, tension_interval
from ...muscles.law import TensionLaw
from ...specimens import Specimen
from .braid_law import LawError
from .requirements import Requirements

VERDICTS = ("yes", "within the error", "no")
POINTS, REFINED = 256, 4  # lengths among which an end of a stroke is sought, and how often it is refined


class LawEnds(NamedTuple):
    """A law with each inferred number at both ends of its range, by the number's name; and those without a range."""

    pairs: Mapping[str, tuple[TensionLaw, ...]] = {}  # of a law whose numbers are all printed
    without_range: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return brief(self)


@dataclass(frozen=True, eq=False)
class Candidate:
    """A muscle as a candidate.

    Attributes:
        id: short name.
        title: description.
        kind: ``braid``, ``specimen`` or ``size``.
        law: its tension law.
        law_name: under which the law is addressed.
        error: error of the law.
        longest: length from which it shortens [m].
        friction: at the wished pressure, which its promised force is less [N].
        overall_length: with fittings [m].
        diameter: outer, at the end of the stroke [m].
        mass: with fittings; None if unknown [kg].
        rated_pressure: None if unknown [Pa].
        dimensions: what it is made with, by name [SI].
        inferred: numbers that no source prints.
        sources: citation keys.
        law_ends: its law with each inferred number at the ends of its range.
        friction_range: of an inferred friction [N]; None if it is stated.
        spec: specimen that it is, or whose law was taken to another length; None for a braid.
    """

    id: str
    title: str
    kind: str
    law: TensionLaw
    law_name: str
    error: LawError
    longest: float
    friction: float
    overall_length: float
    diameter: float
    mass: float | None
    rated_pressure: float | None = None
    dimensions: Mapping[str, float] = field(default_factory=dict)
    inferred: tuple[str, ...] = ()
    sources: tuple[str, ...] = ()
    law_ends: Callable[[], LawEnds] = LawEnds
    friction_range: tuple[float, float] | None = None
    spec: Specimen | None = None

    __repr__ = brief


@dataclass(frozen=True, eq=False)
class Judged:
    """A candidate with its margins to the requirements.

    Attributes:
        muscle: the candidate.
        end_force: what the gas adds at the end of the stroke, as the law says, less friction [N].
        promised_force: the same less the error of the law [N].
        largest_force: tension at the longest length [N].
        error_force: what the error of the law may take [N].
        passive: tension at the end of the stroke without gas, where it pulls, which is not counted [N].
        stroke: by which it shortens until the promised force is the wished one [m].
        margins: by part of the wish, with the error of the law carried [1].
        nominal: margins of force and stroke as the law says, without its error [1].
        air: mass that a working cycle takes from the room, without valve and tube [kg].
        speed: with which it still pulls with the wished force, behind the best line; None if it was not run [m/s].
        interval: 95 % interval of `end_force` of one muscle, as its specimen states how far such differ [N]; None where it
            does not.
    """

    muscle: Candidate
    end_force: float
    promised_force: float
    largest_force: float
    error_force: float
    passive: float
    stroke: float
    margins: Mapping[str, float]
    nominal: Mapping[str, float]
    air: float
    speed: float | None = None
    interval: tuple[float, float] | None = None

    __repr__ = brief

    @property
    def interval_words(self) -> str:
        """How far one such muscle may be off, in words, or that nothing says it."""
        one, ends = self.muscle, self.interval
        if ends is not None and one.spec is not None:
            of_make = interval_words(one.spec, one.law)
            return f"{ends[0]:.3g} to {ends[1]:.3g} N at the end of the stroke (95 %): {of_make}"
        return "no interval: nothing says how far one such muscle is from the law"

    @property
    def verdict(self) -> str:
        """One of `VERDICTS`: sufficient beyond the error of its law, by its law alone, or not."""
        if min(self.margins.values()) >= -1e-9:
            return VERDICTS[0]
        as_said = {**self.margins, **self.nominal}
        return VERDICTS[1] if min(as_said.values()) >= -1e-9 else VERDICTS[2]

    @property
    def worst(self) -> tuple[str, float]:
        """Requirement with the smallest margin, and that margin."""
        name = min(self.margins, key=lambda n: self.margins[n])
        return name, self.margins[name]

    def to_dict(self) -> dict[str, JsonValue]:
        """Candidate and margins as plain values in SI."""
        m = self.muscle
        return {
            "id": m.id,
            "title": m.title,
            "kind": m.kind,
            "law": m.law_name,
            "verdict": self.verdict,
            "error": {
                "share": m.error.share,
                "force": self.error_force,
                "kind": m.error.kind,
                "source": m.error.source,
            },
            "end_force": self.end_force,
            "interval": None if self.interval is None else list(self.interval),
            "interval_words": self.interval_words,
            "promised_force": self.promised_force,
            "largest_force": self.largest_force,
            "passive": self.passive,
            "stroke": self.stroke,
            "speed": self.speed,
            "friction": m.friction,
            "longest": m.longest,
            "overall_length": m.overall_length,
            "diameter": m.diameter,
            "mass": m.mass,
            "air": self.air,
            "margins": dict(self.margins),
            "nominal": dict(self.nominal),
            "dimensions": dict(m.dimensions),
            "inferred": list(m.inferred),
            "sources": list(m.sources),
        }

    def with_speed(self, speed: float, wished: float) -> Judged:
        """Return a copy with the speed that a line gives it [m/s]."""
        return replace(self, speed=speed, margins={**self.margins, "speed": speed / wished - 1.0})


class LawAtPressure:
    """A law evaluated with plain numbers at one gauge pressure [Pa], for many lengths at once."""

    def __init__(self, law: TensionLaw, pressure: float) -> None:
        self.law, self.pressure, self.probe = law, pressure, Probe(PotentialMuscle(law))

    def tension(self, length: Scalar) -> np.ndarray:
        """Signed tension of the braid at lengths [m] [N]."""
        return self.probe.tension(length, self.pressure)

    def passive(self, length: Scalar) -> np.ndarray:
        """Tension without gas, not below zero [N]."""
        passive: np.ndarray = np.maximum(self.probe.tension(length, 0.0), 0.0)
        return passive

    def added(self, length: Scalar) -> np.ndarray:
        """Tension added by the gas [N]."""
        pressures = np.reshape((self.pressure, 0.0), (2, *(1,) * np.ndim(length)))
        full, empty = self.probe.tension(
            length, pressures
        )  # in one call of the kernel: a sizing asks thousands of times
        active: np.ndarray = full - np.maximum(empty, 0.0)
        return active

    def volume(self, length: Scalar, pressure: float | None = None) -> float:
        """Gas volume at a length [m^3], optionally at another gauge pressure [Pa]."""
        return float(self.probe.volume(length, self.pressure if pressure is None else pressure))

    def last_below(self, force: float, longest: float) -> float:
        """Longest length up to `longest` at which the gas adds at most a force [m]; the law's shortest if none."""
        low, high = float(self.law.length_range()[0]), longest
        for _ in range(REFINED):
            grid = np.linspace(low, high, POINTS)
            weak = np.flatnonzero(self.added(grid) <= force)
            if not weak.size:
                return low
            if weak[-1] == POINTS - 1:
                return high
            low, high = float(grid[weak[-1]]), float(grid[weak[-1] + 1])
        return low

    def free_length(self, longest: float) -> float:
        """Length at which the tension ends [m]."""
        return self.last_below(0.0, longest)


def judged(muscle: Candidate, wish: Requirements) -> Judged:
    """Compare a candidate with the requirements."""
    ends = LawAtPressure(muscle.law, wish.pressure)
    end = muscle.longest - wish.stroke
    low = 0.5 * float(muscle.law.length_range()[0]) + 0.5 * ends.free_length(muscle.longest)
    top, passive = float(ends.tension(muscle.longest)), float(ends.passive(max(end, low)))
    said = float(ends.added(max(end, low)))
    error = muscle.error.share * top
    if end < low:  # far beyond where it hangs slack, where a law means nothing
        said = min(said, 0.0)
    nominal = _margins(muscle, wish, ends, said, 0.0)
    sure = _margins(muscle, wish, ends, said, error)
    margins = dict(sure)
    for name, limit, has in (
        ("length", wish.length, muscle.overall_length),
        ("diameter", wish.diameter, muscle.diameter),
    ):
        if limit is not None:
            margins[name] = limit / has - 1.0
    if muscle.rated_pressure is not None:
        margins["pressure"] = muscle.rated_pressure / wish.pressure - 1.0
    pull = said - muscle.friction
    band = tension_interval(muscle.spec, muscle.law, max(end, low), wish.pressure)
    aside = None if band is None else band - float(ends.tension(max(end, low)))
    low_end, high_end = (0.0, 0.0) if aside is None else (max(pull + float(one), 0.0) for one in aside)
    return Judged(
        muscle,
        pull,
        pull - error,
        top,
        error,
        passive,
        (1.0 + sure["stroke"]) * wish.stroke,
        margins,
        nominal,
        air_of_cycle(muscle, wish),
        interval=None if aside is None else (low_end, high_end),
    )


def _margins(muscle: Candidate, wish: Requirements, ends: LawAtPressure, said: float, error: float) -> dict[str, float]:
    deducted = muscle.friction + error
    stroke = muscle.longest - ends.last_below(wish.force + deducted, muscle.longest)
    return {"force": max((said - deducted) / wish.force, 0.0) - 1.0, "stroke": stroke / wish.stroke - 1.0}


def air_of_cycle(muscle: Candidate, wish: Requirements, dead: float = 0.0) -> float:
    """Air of a cycle [kg]: filled at the short end with a dead volume [m^3], emptied and extended again."""
    if not muscle.law.has_volume():
        return float("nan")
    room, warm = float(wish.environment.pressure_abs), float(wish.environment.temperature)
    ends = LawAtPressure(muscle.law, wish.pressure)
    end = max(muscle.longest - wish.stroke, ends.free_length(muscle.longest))
    full = ends.volume(end) + dead
    empty = ends.volume(muscle.longest, 0.0) + dead
    return float(AIR.mass(wish.pressure + room, full, warm) - AIR.mass(room, empty, warm))


def unit_of(muscle: Candidate, **mechanics: JsonValue) -> MuscleUnit:
    """Candidate as part of a machine, tied to its anchors."""
    usual: dict[str, JsonValue] = {n: ASSEMBLED[n].value for n in ("viscosity", "stop_damping")}
    return MuscleUnit(law=muscle.law, **(usual | mechanics))


def ranked(many: list[Judged]) -> list[Judged]:
    """Sort candidates: sufficient ones first, by air consumption; the others by their worst margin."""

    def order(one: Judged) -> tuple[int, float]:
        rank = VERDICTS.index(one.verdict)
        return rank, -one.worst[1] if rank == 2 else (one.air if np.isfinite(one.air) else np.inf)

    return sorted(many, key=order)
