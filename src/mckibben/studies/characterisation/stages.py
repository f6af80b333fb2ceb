"""Stages of a characterisation as protocols, and how long they take.

    seat        vented and slack for the zeros of the sensors, then pulled longer until it is taut
    leak        shut off under a low pressure, where the plumbing has a shut-off valve
    ramp        pressure up at the rest length until the largest tension or pressure, then down
    map         loops of the span at constant pressures, rising from loop to loop: shortened until slack, lengthened back;
                then slack for the zeros
    relaxation  a stretch at constant pressure, and a hold
    held-out    holds at pressures and lengths that the map does not have, reached by shortening and lengthening; then one
                loop of the map again, which shows a gain that has changed, and slack for the zeros

Every stage begins and ends vented at the rest length. No set-point lies beyond the limits of the rig; a step at which the
tension may become too large ends by a test of the load cell.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...bench.rig import Rig
from ...errors import InputError
from ...experiments.protocol import Protocol
from ...experiments.read import parse_protocol
from ...muscles.elements import Tendon
from ...quantities import with_unit

STAGES = {
    "seat": "Slack and seat",
    "leak": "Leak, shut off",
    "ramp": "Pressure ramp",
    "map": "Force map, loading and unloading",
    "relaxation": "Stretch and hold",
    "held-out": "Held-out points",
}
# Stages of other questions than the whole characterisation, each run by itself.
OTHER_STAGES = {"readings": "Readings of one of a make", "cord": "Pull on a rod in the muscle's place"}
RATE = 100.0  # samples per second of the recordings [1/s]
MARGIN = 0.9  # of what a rig bears
ISOBARS = 6
AGAIN = "again"  # in the labels of the loop that is measured again
SPEED = 0.02  # of the loops [rest lengths/s]
SHORTEST = 0.6  # span, of the rest length
STRETCH, STRETCH_TIME, RELAX, HOLD = 0.04, 1.0, 40.0, 40.0  # [rest lengths], [s]
DRAIN = 4.0  # in which what is left of the pressure goes, before the zeros are read again [s]
LEAK_PRESSURE, LEAK_TIME = 2e5, 10.0  # [Pa], [s]
LENGTH_ERROR, MOST_LENGTH_ERROR = 0.01, 0.1  # of the rest length, which a ruler misses, a share
SEAT_TENSION = 1.0  # from which the muscle counts as taut, if the cell's noise allows [N]
MOST_PULLED = 1.03  # of a rod's length, as far as `Bounds` lets a span go beyond the rest length
# Of the length range at a pressure, 0 where it is slack and 1 at the rest length, in their order.
HELD_OUT = ((0.62, 0.27, 0.81, 0.45), (0.70, 0.35, 0.15, 0.55), (0.55, 0.20, 0.40, 0.75))


@dataclass(frozen=True)
class Bounds:
    """Bounds of a characterisation, with margins to those of the rig.

    Attributes:
        rest_length: span at which the muscle is mounted [m].
        shortest: shortest span [m].
        pressure: highest gauge pressure [Pa].
        tension: largest tension [N].
        shut_off: whether the plumbing has a shut-off valve.
        rest_length_error: largest error of the rest length as it was measured at the muscle, a share.
        cord: what holds the muscle, cord and frame in series, where it is known: spans are longer than the muscle by what
            it stretches.
    """

    rest_length: float
    shortest: float
    pressure: float
    tension: float
    shut_off: bool
    rest_length_error: float = LENGTH_ERROR
    cord: Tendon | None = None

    @classmethod
    def of(
        cls,
        rig: Rig,
        layout: str,
        *,
        rest_length: float,
        pressure: float | None = None,
        tension: float | None = None,
        rest_length_error: float = LENGTH_ERROR,
    ) -> Bounds:
        """Bounds on a rig.

        Args:
            rig: the rig.
            layout: name of its plumbing.
            rest_length: span at which the muscle is mounted [m].
            pressure: largest gauge pressure of the muscle [Pa]; what the rig bears by default.
            tension: largest tension of the muscle [N]; likewise.
            rest_length_error: largest error of the rest length as it was measured at the muscle, a share.

        Raises:
            InputError: the rig has no motor or lacks a sensor, or a value is beyond it.
        """
        for name in ("pressure", "tension"):
            if name not in rig.sensors:
                raise InputError("rig", rig.name, f"must have a sensor of the {name}")
        if not 0.0 <= rest_length_error <= MOST_LENGTH_ERROR:
            allowed = f"must be between 0 and {100.0 * MOST_LENGTH_ERROR:g} %"
            raise InputError("rest_length_error", f"{100.0 * rest_length_error:g} %", allowed)
        if rig.motor is None or rig.encoder is None:
            raise InputError("rig", rig.name, "must have a motor and an encoder: the span is driven")
        limits = rig.limits(layout)
        sensor = rig.sensors["pressure"]
        most_pressure = min(
            limits.pressure[1],
            MARGIN * limits.burst_pressure,
            MARGIN * min(float(sensor.high), float(sensor.converter.top)),
        )
        cell = rig.sensors["tension"]
        most_tension = MARGIN * min(
            limits.tension, limits.motor_force, float(rig.interlocks.most_tension), float(cell.converter.top)
        )
        asked = {"max_pressure": (pressure, most_pressure, "Pa"), "max_tension": (tension, most_tension, "N")}
        for name, (value, most, unit) in asked.items():
            if value is not None and not 0.0 < value <= most:
                raise InputError(name, with_unit(value, unit), f"must be above 0 and at most {with_unit(most, unit)}")
        low, high = rig.shortest, rig.longest
        if not low < rest_length <= high / 1.03:
            allowed = (
                f"must be above {with_unit(low, 'm')} and at most {with_unit(high / 1.03, 'm')} on the rig {rig.name}"
            )
            raise InputError("rest_length", with_unit(rest_length, "m"), allowed)
        return cls(
            rest_length=rest_length,
            shortest=max(low, SHORTEST * rest_length),
            pressure=most_pressure if pressure is None else pressure,
            tension=most_tension if tension is None else tension,
            shut_off=rig.plumbing[layout].shut_off is not None,
            rest_length_error=rest_length_error,
        )

    @property
    def stages(self) -> list[str]:
        """Names of the stages."""
        return [name for name in STAGES if name != "leak" or self.shut_off]


@dataclass(frozen=True)
class Progression:
    """What the stages so far have found, and the next ones need.

    Attributes:
        zero: reading of the load cell without tension [N].
        zero_pressure: reading of the pressure sensor without pressure [Pa].
        slack: tension from which the muscle counts as taut [N].
        top: highest gauge pressure that the muscle may have [Pa].
        largest: largest tension at it [N].
        isobars: pressure [Pa] and shortest taut length [m] of each loop of the map.
        again: number of the loop that is measured again at the end, from 1.
        places: span [m] and gauge pressure [Pa] of each reading of a muscle that is like others.
    """

    zero: float = 0.0
    zero_pressure: float = 0.0
    slack: float = SEAT_TENSION
    top: float = 0.0
    largest: float = 0.0
    isobars: tuple[tuple[float, float], ...] = ()
    again: int = ISOBARS
    places: tuple[tuple[float, float], ...] = ()

    def shortest_at(self, pressure: float) -> float:
        """Shortest taut length at a pressure [m], between those of the map."""
        levels, lengths = zip(*self.isobars, strict=True)
        return float(np.interp(pressure, levels, lengths))


def planned(bounds: Bounds) -> Progression:
    """What is assumed of stages that have not run, so that the plan holds for any muscle."""
    isobars = tuple((p, bounds.shortest) for p in pressures_of(bounds.pressure))
    return Progression(top=bounds.pressure, largest=bounds.tension, isobars=isobars)


def pressures_of(top: float) -> list[float]:
    """Pressures of the map's loops, rising [Pa]."""
    return [top * (i + 1) / ISOBARS for i in range(ISOBARS)]


def protocol_of(stage: str, bounds: Bounds, known: Progression) -> Protocol:
    """The protocol of a stage, after what the stages before have found."""
    steps = {
        "seat": _seat,
        "leak": _leak,
        "ramp": _ramp,
        "map": _map,
        "relaxation": _relaxation,
        "held-out": _held_out,
        "readings": _readings,
        "cord": _cord,
    }[stage](bounds, known)
    needs = ["pressure sensor", "span sensor", "tension sensor", *(["shut-off"] if stage == "leak" else [])]
    head = [
        "schema = 1",
        f'name = "characterise-{stage}"',
        f'title = "{(STAGES | OTHER_STAGES)[stage]}"',
        f"needs = {needs!r}",
        f'sample_rate = "{RATE:g} Hz"',
    ]
    rest = bounds.rest_length
    last = [
        '[[last]]\nlabel = "vent"\npressure = { to = "0 bar", in = "1 s" }\nrecord = false',
        f'[[last]]\nlabel = "return"\nspan = {{ to = "{rest!r} m", in = "1.5 s" }}\nrecord = false',
    ]
    return parse_protocol("\n".join([*head, *steps, *last]) + "\n", where=f"characterise-{stage}")


def _step(
    label: str,
    *,
    span: tuple[float, str] | None = None,
    pressure: tuple[float, float] | str | None = None,
    hold: float | None = None,
    until: str = "",
    record: bool = True,
) -> str:
    """A step: span to a length [m] in a time or at a speed, as text; pressure to a value [Pa] in a time [s]; hold [s]."""
    lines = ["[[steps]]", f'label = "{label}"']
    if span is not None:
        lines.append(f'span = {{ to = "{span[0]!r} m", {span[1]} }}')
    if isinstance(pressure, tuple):
        lines.append(f'pressure = {{ to = "{pressure[0]!r} Pa", in = "{pressure[1]:g} s" }}')
    elif pressure is not None:
        lines.append(f'pressure = "{pressure}"')
    if until:
        lines += [f'until = "{until}"', 'otherwise = "go on"']
    if hold is not None:
        lines.append(f'for = "{hold:.6g} s"')
    return "\n".join([*lines, *([] if record else ["record = false"])])


def _taken(seconds: float) -> str:
    return f'in = "{seconds:g} s"'


def _at(speed: float) -> str:
    return f'at = "{speed!r} m/s"'


def _above(tension: float, known: Progression) -> str:
    return f"tension >= {tension + known.zero!r} N"


def _seat(bounds: Bounds, known: Progression) -> list[str]:
    rest = bounds.rest_length
    longest = 1.02 * rest
    speed = 0.005 * rest
    return [
        _step("slack", span=(0.97 * rest, _taken(2.0)), pressure=(0.0, 1.0), record=False),
        _step("zero", hold=2.0),
        _step("pull", span=(longest, _at(speed)), hold=(longest - 0.97 * rest) / speed, until="tension >= 5 N"),
    ]


def _readings(bounds: Bounds, known: Progression) -> list[str]:
    """Filled from empty at each of the places, and held before it is read."""
    steps = []
    for i, (length, pressure) in enumerate(known.places, 1):
        steps += [
            _step(f"approach {i}", span=(length, _taken(2.0)), pressure=(0.0, 1.5), hold=3.5, record=False),
            _step(f"fill {i}", pressure=(pressure, 4.0), hold=4.0, until=_above(bounds.tension, known)),
            _step(f"settle {i}", hold=5.0),
            _step(f"reading {i}", hold=2.0),
        ]
    return [*steps, *_zeros(bounds)]


def _cord(bounds: Bounds, known: Progression) -> list[str]:
    """From slack to the largest tension, and back, slowly enough that nothing swings."""
    rest = bounds.rest_length
    longest, speed = MOST_PULLED * rest, 0.005 * rest
    time = (longest - 0.99 * rest) / speed
    return [
        _step("slack", span=(0.99 * rest, _taken(2.0)), pressure=(0.0, 1.0), record=False),
        _step("zero", hold=2.0),
        _step("pull", span=(longest, _at(speed)), hold=time, until=_above(bounds.tension, known)),
        _step("release", span=(0.99 * rest, _taken(4.0))),
    ]


def _leak(bounds: Bounds, known: Progression) -> list[str]:
    rest = bounds.rest_length
    pressure = min(LEAK_PRESSURE, 0.4 * bounds.pressure)
    return [
        _step("rest", span=(rest, _taken(0.5)), pressure=(0.0, 0.5), record=False),
        # half the tension: what flows in while the valve closes must not take it above the bound
        _step("fill", pressure=(pressure, 3.0), hold=3.0, until=_above(0.5 * bounds.tension, known)),
        _step("settle", hold=3.0),
        _step("shut", pressure="shut", hold=LEAK_TIME),
    ]


def _ramp(bounds: Bounds, known: Progression) -> list[str]:
    rest = bounds.rest_length
    return [
        _step("rest", span=(rest, _taken(0.5)), pressure=(0.0, 0.5), hold=1.0),
        _step("rise", pressure=(bounds.pressure, 20.0), hold=20.0, until=_above(bounds.tension, known)),
        _step("fall", pressure=(0.0, 10.0)),
    ]


def _map(bounds: Bounds, known: Progression) -> list[str]:
    steps = [_step("rest", span=(bounds.rest_length, _taken(0.5)), pressure=(0.0, 0.5), hold=1.0)]
    for i, pressure in enumerate(pressures_of(known.top), 1):
        steps += _loop(str(i), pressure, bounds, known)
    return [*steps, *_zeros(bounds)]


def _loop(name: str, pressure: float, bounds: Bounds, known: Progression) -> list[str]:
    """A loop of the map at a pressure [Pa]: shortened until slack, and lengthened back."""
    rest, speed = bounds.rest_length, SPEED * bounds.rest_length
    time = (rest - bounds.shortest) / speed
    return [
        _step(f"approach {name}", span=(rest, _taken(1.5)), pressure=(pressure, 1.5), hold=1.5),
        _step(f"settle {name}", hold=1.5),
        _step(
            f"shorten {name}",
            span=(bounds.shortest, _at(speed)),
            hold=time,
            until=f"tension <= {known.slack + known.zero!r} N for 30 ms",
        ),
        _step(
            f"lengthen {name}", span=(rest, _taken(time)), hold=time, until=_above(bounds.tension / MARGIN**0.5, known)
        ),
    ]


def _zeros(bounds: Bounds) -> list[str]:
    """Vented and slack, for the zeros of the sensors."""
    return [
        _step("empty", pressure=(0.0, 1.5), record=False),
        _step("slacken", span=(0.97 * bounds.rest_length, _taken(1.5)), record=False),
        _step("drain", hold=DRAIN, record=False),
        _step("zero", hold=1.5),
    ]


def _relaxation(bounds: Bounds, known: Progression) -> list[str]:
    rest = bounds.rest_length
    pressure = 0.7 * known.top
    shortest = known.shortest_at(pressure)
    longest = shortest + 0.75 * (rest - shortest)
    stretch = min(STRETCH * rest, 0.5 * (rest - shortest))
    return [
        _step("rest", span=(rest, _taken(0.5)), pressure=(0.0, 0.5), hold=1.0),
        _step("fill", pressure=(pressure, 2.0)),
        _step("shorten", span=(longest - stretch, _taken(3.0))),
        _step("settle", hold=RELAX),
        _step("stretch", span=(longest, _taken(STRETCH_TIME))),
        _step("hold", hold=HOLD),
    ]


def held_out_points(bounds: Bounds, known: Progression) -> list[tuple[float, list[float]]]:
    """Pressures of the held-out points [Pa], between those of the map, and the lengths at each in their order [m]."""
    levels = [p for p, length in known.isobars if length < bounds.rest_length] or [known.top]
    levels = [known.top * (1.0 - 0.5 / ISOBARS) if len(levels) < 2 else p for p in levels]
    between = [0.5 * (a + b) for a, b in zip(levels[:-1], levels[1:], strict=True)] or levels
    places = np.linspace(0, len(between) - 1, len(HELD_OUT)).round().astype(int)
    points = []
    for place, shares in zip(places, HELD_OUT, strict=True):
        shortest = known.shortest_at(between[place])
        points.append((between[place], [shortest + share * (bounds.rest_length - shortest) for share in shares]))
    return points


def _held_out(bounds: Bounds, known: Progression) -> list[str]:
    rest = bounds.rest_length
    steps = [_step("rest", span=(rest, _taken(0.5)), pressure=(0.0, 0.5), hold=1.0)]
    for i, (pressure, lengths) in enumerate(held_out_points(bounds, known), 1):
        steps.append(_step(f"approach {i}", span=(rest, _taken(3.0)), pressure=(pressure, 2.0), hold=3.0))
        for j, length in enumerate(lengths, 1):
            steps += [_step(f"move {i}.{j}", span=(length, _taken(3.0))), _step(f"point {i}.{j}", hold=2.0)]
    again = pressures_of(known.top)[known.again - 1]
    return [*steps, *_loop(AGAIN, again, bounds, known), *_zeros(bounds)]
