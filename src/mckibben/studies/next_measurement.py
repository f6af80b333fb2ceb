"""Which points of length and pressure to measure next, within the machine time and the limits of a rig.

Of one more muscle of a known make these are one or two readings: at rest, and shortened.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from .. import identification
from ..answers import Answer, Caution, Column, Table, collect
from ..bench import rig_file
from ..bench.rig import Rig
from ..documents import JsonValue
from ..errors import InputError
from ..identification.between import READ_AT, READ_PRESSURES, TensionReading
from ..identification.calibration import new_muscle
from ..identification.next_points import LawTest, NextExperiment
from ..muscles.build import changed_parameters
from ..muscles.muscle import Muscle, built_muscle
from ..quantities import with_unit
from ..specimens import Specimen, muscle_specimen
from ..verbs import Changes, Duration, LawName, LawPair, Length, MuscleName, PosteriorFile, Pressure, RigName, verb

MARGIN = 0.95  # of what a rig bears
APART = 3.3  # standard deviations between two laws of which readings find the right one with 95 %
PLACE = (
    Column("number", "", right=True),
    Column("length", unit="m", beside=True),
    Column("pressure", unit="Pa", beside=True),
)


@dataclass(frozen=True)
class NextMeasurement(Answer):
    """Points to measure next, and what they are expected to teach: what `next_measurement` chooses.

    Attributes:
        chosen: the points; of a question about parameters or a tension, or of two laws.
        asked: whether it was a tension that was asked for.
        cautions: about a question outside of the measured map.
    """

    chosen: NextExperiment | LawTest
    asked: bool = False
    cautions: tuple[Caution, ...] = ()

    def rows(self) -> list[dict[str, JsonValue]]:
        """One row per point, in the order of the protocol; of two laws with the tension that each expects."""
        columns = {"length": self.chosen.length, "pressure": self.chosen.pressure}
        if isinstance(self.chosen, LawTest):
            columns |= {
                f"tension_{name}": pull for name, pull in zip(self.chosen.laws, self.chosen.tensions, strict=True)
            }
            columns["deviations"] = self.chosen.deviations
        values = [column.tolist() for column in columns.values()]
        return [dict(zip(columns, row, strict=True)) for row in zip(*values, strict=True)]

    def column_units(self) -> Mapping[str, str]:
        """SI units of the columns of `rows`."""
        units = {"length": "m", "pressure": "Pa"}
        if isinstance(self.chosen, LawTest):
            units |= {f"tension_{name}": "N" for name in self.chosen.laws} | {"deviations": "1"}
        return units

    def to_dict(self) -> dict[str, JsonValue]:
        """The points, the machine time, and what is expected of them."""
        one = self.chosen
        content: dict[str, JsonValue] = {"points": self.rows(), "duration": one.duration, "wait": one.wait}
        if isinstance(one, LawTest):
            return content | {"laws": list(one.laws), "distance": one.distance, "recognised": one.recognised}
        return content | {
            "information": one.information,
            "expected": {n: {"now": e._asdict(), "width_left": one.expected[n]} for n, e in one.intervals.items()},
            "tension_deviation": {"now": one.deviation[0], "expected": one.deviation[1]},
        }

    def tables(self) -> list[Table]:
        """The points, those that are repeated in one row; and what they teach, or what two laws expect there."""
        one, rows = self.chosen, self.rows()
        title = f"The next {len(one)} points, {one.duration / 60.0:.3g} min of machine time"
        if isinstance(one, LawTest):
            expects = (Column(f"tension_{name}", f"{name} expects", "N", beside=True) for name in one.laws)
            columns = (*PLACE, *expects, Column("deviations", "standard deviations apart", "1", places=".2g"))
            return [
                Table(title, columns, [row | {"number": i} for i, row in enumerate(rows, 1)], (self._verdict(one),))
            ]
        points, last = [], 0
        for place, repeated in itertools.groupby(rows):
            first, last = last + 1, last + len(list(repeated))
            points.append(place | {"number": first if first == last else f"{first} to {last}"})
        teaches = [{"name": n, **e._asdict(), "left": one.expected[n]} for n, e in one.intervals.items()]
        ends = Column("low", "95 % now: from", own="unit"), Column("high", "to", own="unit")
        left = Column("left", "width left", "1", shown="%", places=".0f", beside=True)
        where = "the tension asked for" if self.asked else "the tension over the map, rms"
        now, after = one.deviation
        said = [f"Standard uncertainty of {where}: {now:.3g} N now, {after:.3g} N expected."]
        if not one.narrows and not self.asked:
            said.insert(
                0,
                "No point within the map and the limits separates the parameters from what the law has no parameter for; "
                "the points are those that leave least uncertainty of the tension.",
            )
        learned = Table("What they teach", (Column("name", "parameter"), *ends, left), teaches, tuple(said))
        return [Table(title, PLACE, points), learned]

    def remarks(self) -> list[str]:
        """How the points are reached."""
        return ["Each point is reached with rising pressure from an empty muscle, and held before it is read."]

    def _verdict(self, one: LawTest) -> str:
        tell = "These readings tell the laws apart"
        if one.distance < APART:
            tell = "No readings within the map, the limits and the budget tell the laws apart"
        return (
            f"{tell}: {one.laws[0]} and {one.laws[1]} expect them {one.distance:.2g} standard deviations apart, of noise, "
            "discrepancy and parameters. If one of the laws is right, they speak for it with a probability of "
            f"{100.0 * one.recognised:.3g} %."
        )


@dataclass(frozen=True)
class NextReadings(Answer):
    """Readings to take of a muscle of a make: what `readings_to_take` chooses.

    Attributes:
        muscle: of the make, cut to its length.
        places: in their order: length [m], gauge pressure [Pa], expected tension with its 95 % interval [N], and the mean
            half width of the interval after it, as a share of the largest tension.
        before: that half width without a reading.
        elsewhere: the muscle is on another rig than those of its make.
    """

    muscle: Muscle
    places: tuple[Mapping[str, float], ...]
    before: float
    elsewhere: bool
    cautions: tuple[Caution, ...] = ()

    def rows(self) -> list[dict[str, JsonValue]]:
        """One row per reading."""
        return [dict(place) for place in self.places]

    def column_units(self) -> Mapping[str, str]:
        """SI units of the columns of `rows`."""
        return {"length": "m", "pressure": "Pa", "tension": "N", "low": "N", "high": "N", "half_width": "1"}

    def to_dict(self) -> dict[str, JsonValue]:
        """The readings, and the half width without any."""
        return {"readings": self.rows(), "half_width_now": self.before, "elsewhere": self.elsewhere}

    def tables(self) -> list[Table]:
        """The readings in their order."""
        expected = (Column(key, title, "N", beside=True) for key, title in
                    (("tension", "expected"), ("low", "95 %: from"), ("high", "to")))  # fmt: skip
        columns = (
            *PLACE,
            *expected,
            Column("half_width", "interval after it, \u00b1", "1", shown="%", places=".1f"),
        )
        spec = self.muscle.specimen
        title = f"Readings of a muscle like {self.muscle.law_name if spec is None else spec.id}, by what they leave"
        where = "elsewhere" if self.elsewhere else "on the rig of its make"
        now = f"without a reading \u00b1 {100.0 * self.before:.1f} % of the largest tension, {where} (95 %, mean of the map)"
        return [Table(title, columns, [place | {"number": i} for i, place in enumerate(self.rows(), 1)], (now,))]

    def remarks(self) -> list[str]:
        """How the readings are taken and used."""
        first = self.places[0]
        example = f"'{with_unit(first['length'], 'm', 4)}, {with_unit(first['pressure'], 'Pa')}, .. N'"
        return [
            f"Fill the muscle at the length to {READ_PRESSURES}, wait, and read the force; a second length teaches more "
            "than more pressures at one.",
            f"Then give both together: mckibben tension .. --reading {example}; correct no single number by them.",
        ]


def readings_to_take(
    muscle: Muscle, *, same_rig: bool = False, shortest: float | None = None, highest: float = math.inf
) -> NextReadings:
    """Choose the readings of a muscle: at rest, then shortened by 4 %, or as far as it is used if it is from elsewhere.

    Where one muscle of the make in forty or more would hang slack, the second is at the next longer length.

    Args:
        muscle: of a specimen that states how far muscles of its make differ, cut to its rest length.
        same_rig: it is measured on the rig on which those were.
        shortest: most contracted length that is used [m]; the shortest that was measured, in proportion, where left out.
        highest: gauge pressure that the muscle may have [Pa].

    Raises:
        InputError: the specimen states no such differences, or the length is none of such a muscle.
    """
    new = new_muscle(muscle.specimen, muscle.law, same_rig=same_rig)
    rest = new.muscle.rest_length
    if shortest is not None and not 0.5 * rest < shortest < rest:
        ends = f"{with_unit(0.5 * rest, 'm')} and its rest length, {with_unit(rest, 'm')}"
        raise InputError("length", with_unit(shortest, "m"), f"must be between {ends}")
    pressure = min(READ_AT, new.muscle.highest_pressure, highest)
    before, places = new.share(), []
    for second in (False, True):
        length = new.second_length(pressure, shortest) if second else rest
        mean, half = (float(value[0]) for value in new.predict(np.array([length]), np.array([pressure])))
        if mean <= half:
            problem = (
                f"leaves nothing to read at rest: muscles of the make may pull nothing at {with_unit(pressure, 'Pa')}"
            )
            raise InputError("pressure", None, problem)
        new = new.conditioned([TensionReading(length, pressure, mean)])
        expected = {"tension": mean, "low": max(mean - half, 0.0), "high": mean + half}
        places.append({"length": length, "pressure": pressure, **expected, "half_width": new.share()})
    taken, said = places[1]["length"], None
    if shortest is not None and not same_rig and taken > shortest:
        where = f"{with_unit(shortest, 'm', 4)} and {with_unit(pressure, 'Pa')}"
        said = Caution(f"a muscle of the make may hang slack at {where}; the second reading is at the next length where "
                       f"39 of 40 pull, {with_unit(taken, 'm', 4)}", "length")  # fmt: skip
    return NextReadings(muscle, tuple(places), before, not same_rig, collect(said))


@verb
def next_measurement(
    *,
    fit: PosteriorFile | None = None,
    like: MuscleName | None = None,
    same_rig: bool = False,
    rig: RigName | None = None,
    law: LawName | None = None,
    laws: LawPair | None = None,
    parameters: Changes | None = None,
    budget: Duration = "5 min",
    wait: Duration = "3 s",
    length: Length | None = None,
    pressure: Pressure | None = None,
) -> NextMeasurement | NextReadings:
    """Choose the points of length and pressure that teach most next, and write them as a protocol.

    Of a muscle that is like those of a specimen, such as festo-10mm, they are the one or two readings that calibrate it.

    Args:
        fit: result of `mckibben fit --posterior --out fit.json`.
        like: specimen of whose make the muscle is, instead of a fit: where to read its force, and what that leaves.
        same_rig: the muscle is on the rig on which its make was measured; else its most contracted length is read, too.
        rig: test machine whose lengths, pressures and tensions are the limits.
        law: law of the fit whose parameters are asked for; the first where left out.
        laws: two laws of the fit to tell apart, such as gas_spring,linear_threshold, instead of the parameters of one.
        parameters: replace a parameter of the specimen that it is like, such as rest_length='132 mm'.
        budget: machine time of the measurement [s], such as '5 min'.
        wait: hold of each point before its reading [s], for creep, such as '3 s'.
        length: length at which the tension is asked for [m], such as '12 cm', instead of the parameters; of a
            muscle that is like those of a specimen the most contracted one that is used.
        pressure: gauge pressure at which the tension is asked for [Pa], such as '3 bar'.

    Raises:
        InputError: the budget is too short, the machine can reach no point, or the file has no samples of a law.
    """
    if like is not None:
        for name, value in (("fit", fit), ("rig", rig), ("law", law), ("laws", laws), ("pressure", pressure)):
            if value is not None:
                raise InputError(name, None, "is allowed only without {like}")
        spec = like if isinstance(like, Specimen) else muscle_specimen(like)
        built = built_muscle(spec, law=spec.law, **cast(Any, changed_parameters(parameters, spec.law, of=spec)))
        return readings_to_take(built, same_rig=same_rig, shortest=None if length is None else float(length))
    if fit is None:
        problem = "is missing: the result of a fit with samples, or {like} the specimen of a muscle's make"
        raise InputError("fit", None, problem)
    for name, stated in (("parameters", bool(parameters)), ("same_rig", same_rig)):
        if stated:
            raise InputError(name, None, "is allowed only beside {like}")
    if (length is None) != (pressure is None):
        missing = "pressure" if pressure is None else "length"
        raise InputError(missing, None, "is missing: a tension is asked for at a length and a pressure")
    for name, value in (("law", law), ("length", length)):
        if laws is not None and value is not None:
            raise InputError(name, None, "is allowed only without {laws}")
    pair: list[str] = []
    if laws is not None:
        pair = [name.strip() for name in (laws.split(",") if isinstance(laws, str) else laws)]
        if len(pair) != 2 or not all(pair) or pair[0] == pair[1]:
            raise InputError("laws", laws, "must be two laws, such as gas_spring,linear_threshold")
    for name, value, low, high in (("budget", budget, 1.0, 86400.0), ("wait", wait, 0.0, 600.0)):
        if not low <= float(value) <= high:
            raise InputError(name, value, f"must be between {low:g} s and {high:g} s")
    posteriors = [identification.read_posterior(fit, law=name) for name in pair or (law,)]
    limits: dict[str, Any] = {"budget": float(budget), "wait": float(wait)}
    if rig is not None:
        limits |= _limits(rig if isinstance(rig, Rig) else rig_file.rig(rig))
    if pair:
        return NextMeasurement(identification.next_points.law_test(posteriors, **limits))
    question, beyond = None, None
    if length is not None and pressure is not None:
        question = float(length), float(pressure)
        beyond = posteriors[0].beyond(*question)
    chosen = identification.next_points.next_experiment(posteriors[0], question=question, **limits)
    said = collect(
        None if beyond is None else Caution(beyond, "length" if beyond.startswith("a length") else "pressure")
    )
    return NextMeasurement(chosen, question is not None, said)


def _limits(rig: Rig) -> dict[str, Any]:
    """Lengths [m], pressure [Pa] and tension [N] that a rig bears, with a margin."""
    bearing, pressures = [float(rig.interlocks.most_tension)], [float(rig.interlocks.burst_pressure)]
    bearing += [float(rig.sensors["tension"].high)] if "tension" in rig.sensors else []
    pressures += [float(rig.sensors["pressure"].high)] if "pressure" in rig.sensors else []
    return {
        "lengths": (float(rig.shortest), float(rig.longest)),
        "highest_pressure": MARGIN * min(pressures),
        "highest_tension": MARGIN * min(bearing),
    }
