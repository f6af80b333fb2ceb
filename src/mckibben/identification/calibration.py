"""Muscles that are calibrated by readings: one more muscle of a fit, or of the make of a specimen.

The covariance of the fitted parameters is that of the muscles to which a law was fitted, see `between`; of a specimen, whose
points do not ship, that of a fit to muscles of its measured rest lengths, over its measured range.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..answers import Caution, warn
from ..documents import JsonValue
from ..errors import InputError
from ..muscles.build import at_rest_length, measured_rest_lengths, rest_length_of
from ..muscles.evidence import own_numbers
from ..muscles.law import TensionLaw, law_name
from ..muscles.laws import law_type
from ..muscles.muscle import Muscle, built_muscle
from ..quantities import declared, with_unit
from ..specimens import Specimen, SpecimenNumber
from ..specimens.model import BEFORE
from .between import (
    GRID,
    LEAST_SHARE,
    SHORTEST,
    Between,
    MuscleLaw,
    NewMuscle,
    PredictedTension,
    TensionReading,
    parameter_covariance,
    thinned,
)
from .problem import SAME_LENGTH, FittedLaw

LEAST_SHORTENED, MOST_SHORTENED = 0.7, 0.98  # ends of a plausible shortest length, as shares of the rest length
READING = "reading_tensions"
OF_THE_LAW = ("rms", "largest")  # errors that remain those of the law where a muscle is calibrated


class CalibratedFit:
    """A fit of several muscles, and readings of one more: its tension with intervals, and the muscle.

    Attributes:
        fit: of the muscles that were measured.
        new: Gaussian of the tension of the one that was read.
    """

    def __init__(self, fit: FittedLaw, new: NewMuscle) -> None:
        self.fit, self.new = fit, new

    def __repr__(self) -> str:
        said = "; ".join(map(str, self.new.readings))
        return f"CalibratedFit({self.fit.law!r}, {with_unit(self.new.muscle.rest_length, 'm')} at rest, by {said})"

    def calibrate(self, readings: Any) -> CalibratedFit:
        """The same muscle with further readings."""
        return CalibratedFit(self.fit, self.new.conditioned(readings))

    def predict(self, length: Any, pressure: Any) -> PredictedTension:
        """Predict the tension of this muscle with a 95 % interval of a further reading.

        Args:
            length: [m] or text with a unit, broadcast with the pressure.
            pressure: gauge pressure, [Pa] or text with a unit.
        """
        return self.new.predicted(length, pressure)

    @functools.cached_property
    def muscle(self) -> Muscle:
        """The muscle: the law with its parameters moved to the readings."""
        rest = self.new.muscle.rest_length
        whole = self.fit.muscle
        assert whole.specimen is not None
        spec = at_rest_length(whole.specimen, self.fit.law, {"rest_length": rest})[0]
        return built_muscle(calibrated_specimen(spec, self.fit.law, self.new), law=self.fit.law)

    @property
    def cautions(self) -> tuple[Caution, ...]:
        """What must be known of the readings."""
        return self.new.cautions()

    def to_dict(self) -> dict[str, JsonValue]:
        """Law, parameters [SI], readings and components as plain values, for JSON."""
        return {
            "law": self.fit.law,
            "rest_length": self.new.muscle.rest_length,
            "parameters": dict(self.new.calibrated()),
            "warnings": [str(one) for one in self.cautions],
        } | self.new.to_dict()


def muscle_of_fit(
    fit: FittedLaw, between: Between, law: TensionLaw, free: Sequence[str], *, elsewhere: bool = False
) -> NewMuscle:
    """One muscle more of the kind to which a law was fitted, not measured yet.

    Args:
        fit: with a table of rest lengths.
        between: how far muscles of the kind differ.
        law: as of the muscle.
        free: fitted parameters that it has as they were fitted.
        elsewhere: it is not measured on the rig of the table.
    """
    points = fit.points
    assert points.rest_length is not None
    highest = float(points.pressure.max())
    shortest = float(np.min(points.length / points.rest_length))

    def of(one: TensionLaw, rest: float) -> MuscleLaw:
        at_rest = np.asarray(one.tension(rest, highest))
        return MuscleLaw(
            fit.law, one, tuple(free), rest, float(at_rest), highest, shortest, frozenset((*fit.known, *fit.parameters))
        )

    measured = []
    for rest in np.unique(points.rest_length):
        some = thinned(points.select(points.rest_length == rest))
        measured.append(
            of(fit.build(rest_length=float(rest)), float(rest)).points(some.length, some.pressure, some.branch)
        )
    own: Any = law
    taken = between.elsewhere() if elsewhere else between
    return NewMuscle(of(law, float(own.rest_length)), taken, parameter_covariance(between, measured))


# ---- a muscle of a specimen


def new_muscle(spec: Specimen | None, law: TensionLaw, *, same_rig: bool = False) -> NewMuscle:
    """One muscle of the make of a specimen, with the readings by which it was calibrated.

    The parameters' covariance is that of a fit to muscles of the measured rest lengths, over the measured range.

    Args:
        spec: states how far muscles of its make differ.
        law: of the muscle, with the rest length to which it was cut.
        same_rig: it is measured on the rig on which those were.

    Raises:
        InputError: the specimen states no such differences, or a number of the law is not its.
    """
    name = law_name(law)
    if spec is None:
        raise InputError(
            "between", None, "is not known of a muscle without specimen: nothing says how far others differ"
        )
    between = Between.of(spec)
    for key in own_numbers(spec, law):
        shown = with_unit(float(getattr(law, key)), declared(law)[key].unit)
        said = (
            f"must be that of {spec.id}: readings move all of its numbers together, and of others nothing says how far"
        )
        raise InputError(f"{name}.{key}", shown, said)
    before = {
        key.removeprefix(BEFORE): float(
            str(number.si(declared(law_type(name))[key.removeprefix(BEFORE)].unit, field=key))
        )
        for key, number in spec.between.items()
        if key.startswith(BEFORE)
    }
    law = law.replace(**before) if before else law
    free = tuple(n for n in law_type(name).fitted if n in spec.laws[name] and spec.laws[name][n].range is not None)
    free = tuple(before) or free
    rest = rest_length_of(None if hasattr(law, "rest_length") else spec, law)
    if not free:
        raise InputError("between", None, f"of {spec.id} needs ranges of the parameters of {name}")
    highest = spec.property_si("highest_measured_pressure", "Pa")
    whole = measured_rest_lengths(spec) or [rest]
    own = spec.property_si("rest_length", "m")
    shortest = min(spec.property_si("shortest_measured_length", "m") / own, MOST_SHORTENED)
    if shortest < LEAST_SHORTENED:  # of the shortest of several muscles, while the rest length is that of the longest
        shortest = SHORTEST

    def cut(to: float) -> MuscleLaw:
        ends = {n: to for n in ("rest_length", "upper_length") if hasattr(law, n)}
        made = law.replace(**ends) if abs(to - rest) > SAME_LENGTH else law
        largest = float(made.tension(to, highest))
        return MuscleLaw(name, made, free, to, largest, highest, shortest, frozenset(spec.laws[name]))

    measured = []
    for to in whole:
        lengths = np.linspace(shortest * to, to, 4)
        length, pressure = (a.ravel() for a in np.meshgrid(lengths, np.linspace(LEAST_SHARE, 1.0, GRID[1]) * highest))
        measured.append(cut(to).points(length, pressure))
    taken = between if same_rig or READING in spec.between else between.elsewhere()
    spread = parameter_covariance(between, measured)
    return NewMuscle(cut(rest), taken, spread, stated_readings(spec))


def stated_readings(spec: Specimen) -> tuple[TensionReading, ...]:
    """Readings by which a specimen was calibrated; none of one that was not."""
    if READING not in spec.between:
        return ()
    columns = [
        np.atleast_1d(np.asarray(spec.between[f"reading_{name}s"].si(unit, field=f"between.reading_{name}s"), float))
        for name, unit in (("length", "m"), ("pressure", "Pa"), ("tension", "N"))
    ]
    return tuple(TensionReading(*map(float, row)) for row in zip(*columns, strict=True))


def calibrate_muscle(muscle: Muscle, readings: Any, *, same_rig: bool = False) -> tuple[Muscle, NewMuscle]:
    """A muscle of a specimen with its law moved to what readings of it say, and the Gaussian that says how far it is off."""
    new = new_muscle(muscle.specimen, muscle.law, same_rig=same_rig).conditioned(readings)
    spec, name = muscle.specimen, muscle.law_name
    assert spec is not None
    made = calibrated_specimen(spec, name, new)
    moved = {key: float(str(number.si(declared(law_type(name))[key].unit, field=key)))
             for key, number in made.laws[name].items() if key in new.muscle.free}  # fmt: skip
    return muscle.with_fields(law=muscle.law.replace(**moved), specimen=made), new


def calibrate(muscle: Muscle, readings: Any, *, same_rig: bool = False) -> Muscle:
    """A muscle of a specimen, calibrated; its cautions go out as warnings. What `Muscle.calibrate` does."""
    made, new = calibrate_muscle(muscle, readings, same_rig=same_rig)
    warn(new.cautions(), stacklevel=4)
    return made


def calibrated_specimen(spec: Specimen, name: str, new: NewMuscle) -> Specimen:
    """A specimen with the parameters of a law moved by readings, which it states with what they were before."""
    count = f"{len(new.readings)} reading{'s' * (len(new.readings) > 1)}"
    before = dict(zip(new.muscle.free, new.muscle.values().tolist(), strict=True))
    units = {key: declared(law_type(name))[key].unit for key in before}
    group = spec.laws[name] | {
        key: SpecimenNumber(value=value, unit=units[key], inferred=True, note=f"moved by {count} of this muscle")
        for key, value in new.calibrated().items()
    }
    stated = dataclasses.replace(new.between, source=spec.between["whole_length"].note).numbers()
    stated |= {
        f"{BEFORE}{key}": SpecimenNumber(value=value, unit=units[key], note="before the readings")
        for key, value in before.items()
    }
    share = float(f"{new.share():.2g}")
    stated["calibrated"] = SpecimenNumber(value=share, unit="1", inferred=True, note=f"computed, after {count}")
    for at, (key, unit) in enumerate((("lengths", "m"), ("pressures", "Pa"), ("tensions", "N"))):
        column = [float(reading[at]) for reading in new.readings]
        stated[f"reading_{key}"] = SpecimenNumber(value=column, unit=unit, note="of this muscle")
    return dataclasses.replace(
        spec,
        id=spec.id if READING in spec.between else f"{spec.id}-calibrated",
        law=name,
        title=spec.title if READING in spec.between else f"{spec.title}, calibrated",
        map=None,
        laws={name: group},
        errors={name: {key: number for key, number in spec.errors.get(name, {}).items() if key in OF_THE_LAW}},
        between=stated,
    )
