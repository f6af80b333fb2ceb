"""Which points of length and pressure to measure next, within the machine time and the limits of a rig."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from .. import identification
from ..answers import Answer, Caution, Column, Table, collect
from ..bench import rig_file
from ..bench.rig import Rig
from ..documents import JsonValue
from ..errors import InputError
from ..identification.next_points import LawTest, NextExperiment
from ..verbs import Duration, LawName, LawPair, Length, PosteriorFile, Pressure, RigName, verb

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


@verb
def next_measurement(
    *,
    fit: PosteriorFile,
    rig: RigName | None = None,
    law: LawName | None = None,
    laws: LawPair | None = None,
    budget: Duration = "5 min",
    wait: Duration = "3 s",
    length: Length | None = None,
    pressure: Pressure | None = None,
) -> NextMeasurement:
    """Choose the points of length and pressure that teach most next, and write them as a protocol.

    Args:
        fit: result of `mckibben fit --posterior --out fit.json`.
        rig: test machine whose lengths, pressures and tensions are the limits.
        law: law of the fit whose parameters are asked for; the first where left out.
        laws: two laws of the fit to tell apart, such as gas_spring,linear_threshold, instead of the parameters of one.
        budget: machine time of the measurement [s], such as '5 min'.
        wait: hold of each point before its reading [s], for creep, such as '3 s'.
        length: length at which the tension is asked for [m], such as '12 cm', instead of the parameters.
        pressure: gauge pressure at which the tension is asked for [Pa], such as '3 bar'.

    Raises:
        InputError: the budget is too short, the machine can reach no point, or the file has no samples of a law.
    """
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
