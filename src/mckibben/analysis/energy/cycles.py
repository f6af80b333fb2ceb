"""Working cycles of a muscle: shorten under a high pressure, give the air away, be stretched again (Part IV of the paper).

    maximal    at constant pressure from the stretched length until the muscle pulls no more          ABCD, Fig. 12
    isotonic   against a constant load while the pressure rises to its highest                        EFGH, Fig. 13
    valve      the same, the air from a supply at the highest pressure through a valve                EF'GH, Fig. 13

Air comes from the surroundings, or from an accumulator at ``exchange_pressure``, is compressed isothermally by a piston
without losses, and goes back there. All else is quasi-stationary. With the pressures P' above the surroundings, P'x that of
the exchange, P and Px absolute, and V1 the volume at the short end,

    input = P V1 (ln(P/Px) - 1 + Px/P)  +  integral of (P' - P'x) dV from the stretched to the short end     (eqs. 34, 39)
    output = integral of the tendon's tension over the shortening, less the same over the stretch                (eq. 40)

What is not output is traced: friction, what the valve throttles, and what leaves with the air: its exergy, the work of the
muscle as it empties, the spring of the slack braid. Each is an integral of its own; ``unaccounted`` is what they do not
explain, zero but for rounding where tension and volume come from one potential.
Range: taut lengths of the law, pressures above its threshold. Heat, leaks and the volume of tubes are left out.

The muscle of a cycle has one of two gas volumes:

    paper       V(L) of eq. 38b at every pressure, tension of eq. 12 with its sharp threshold
    potential   V(L, P') and tension of the law's own potential, dF/dP' = -dV/dL everywhere

With the first, a cycle that passes below the threshold loses (P_th - P_x) times the change of volume without a trace, where
P_x is the gauge pressure that it returns to. The paper's numbers rest on it, and it is kept for them. Both leave out the
stop at the end of the stroke and the threads that hold beyond it, which eq. 13 does not have: an isotonic load between the
tensions of a cycle that begins in the stop would be a load on that spring.
"""

from __future__ import annotations

import abc
import functools
import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from ..._jax import Scalar, jnp
from ...components import Environment, Module, derivative, jit_arrays
from ...components.programs import evaluated
from ...errors import InputError, NoVolumeError
from ...muscles.build import law_from_specimen
from ...muscles.law import TensionLaw, law_name
from ...muscles.laws.gas_spring import spring_volume
from ...quantities import Quantity, with_unit
from ...specimens import Specimen

VOLUMES = ("paper", "potential")
_LINE = ("stiffness_per_pressure", "shortest_length", "rest_length", "rest_volume")


class CycleMuscle(Module):
    """Signed tension of the braid and volume of its gas; elementwise in length [m] and gauge pressure [Pa]."""

    law: TensionLaw

    @abc.abstractmethod
    def tension(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Tension inside the braid, without friction [N]."""

    @abc.abstractmethod
    def gas_energy(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Integral of the volume over the gauge pressure, up to a function of the length [J]."""

    @abc.abstractmethod
    def volume(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Gas volume [m^3]."""

    def threshold(self) -> Scalar:
        """Gauge pressure from which the gas pulls, zero for a law without one [Pa]."""
        return jnp.asarray(getattr(self.law, "threshold_pressure", 0.0), float)


class PaperMuscle(CycleMuscle):
    """Eq. 12 with the volume of eq. 38b, as printed."""

    def volume(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Eq. 38b, whatever the pressure [m^3]."""
        return self._line(length) + 0.0 * pressure

    def gas_energy(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Pressure times volume [J]."""
        return self._line(length) * pressure

    def tension(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Eqs. 12a and 12b, the slope of the volume taken from eq. 38b (eq. 36) [N]."""
        length, pressure = jnp.broadcast_arrays(jnp.asarray(length, float), jnp.asarray(pressure, float))
        above = jnp.where(pressure > self.threshold(), pressure - self.threshold(), 0.0)
        return self.law.elastic_tension(length) - above * derivative(self._line, length)

    def _line(self, length: Scalar) -> Scalar:
        law: Any = self.law
        return spring_volume(
            length,
            rest_length=law.rest_length,
            rest_volume=law.rest_volume,
            shortest_length=law.shortest_length,
            per_pressure=law.stiffness_per_pressure,
        )


class PotentialMuscle(CycleMuscle):
    """Any law with its own volume: its formulas themselves, whose threads do not hold where a cycle stretches it further."""

    def volume(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Volume of the law [m^3]."""
        length, pressure = jnp.broadcast_arrays(jnp.asarray(length, float), jnp.asarray(pressure, float))
        return derivative(lambda p: self.law.gas_energy(length, p), pressure)

    def gas_energy(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Gas energy of the law [J]."""
        length, pressure = jnp.broadcast_arrays(jnp.asarray(length, float), jnp.asarray(pressure, float))
        return self.law.gas_energy(length, pressure)

    def tension(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Tension of the law [N]."""
        length, pressure = jnp.broadcast_arrays(jnp.asarray(length, float), jnp.asarray(pressure, float))
        return self.law.formula_tension(length, pressure)


def has_paper_volume(law: TensionLaw) -> bool:
    """Whether eq. 38b can be written with the parameters of a law."""
    return all(hasattr(law, name) for name in _LINE)


def cycle_muscle(law: TensionLaw, volume: str = "potential") -> CycleMuscle:
    """A law as the muscle of a working cycle.

    Args:
        law: with a volume.
        volume: ``paper`` or ``potential``.

    Raises:
        NoVolumeError: if the law knows only how its volume changes.
        InputError: if the name is unknown, or the law does not have the parameters of eq. 38b.
    """
    if volume not in VOLUMES:
        raise InputError("volume", volume, known=VOLUMES)
    if volume == "paper" and not has_paper_volume(law):
        raise InputError(
            "volume", volume, f"must be potential for the law '{law_name(law)}'; eq. 38b is not written for it"
        )
    if not law.has_volume():
        raise NoVolumeError(
            f"the law '{law_name(law)}' knows how the volume changes but not how large it is, so the work of the "
            "compressor is not known; state its rest_volume"
        )
    bare = law.replace(stop_stiffness=0.0) if hasattr(law, "stop_stiffness") else law
    return PaperMuscle(bare) if volume == "paper" else PotentialMuscle(bare)


# ---- in numbers


class Probe:
    """A muscle in plain arrays; length [m] and gauge pressure [Pa] broadcast."""

    def __init__(self, muscle: CycleMuscle) -> None:
        self.muscle = muscle

    def tension(self, length: Scalar, pressure: Scalar) -> np.ndarray:
        """Tension inside the braid, without friction [N]."""
        return np.asarray(self._ask(_tension, length, pressure))

    def volume(self, length: Scalar, pressure: Scalar) -> np.ndarray:
        """Gas volume [m^3]."""
        return np.asarray(self._ask(_gas, length, pressure)[0])

    def gas_energy(self, length: Scalar, pressure: Scalar) -> np.ndarray:
        """Integral of the volume over the gauge pressure [J]."""
        return np.asarray(self._ask(_gas, length, pressure)[1])

    def slopes(self, length: Scalar, pressure: Scalar) -> list[np.ndarray]:
        """Slope of the tension by length and by pressure, and of the volume by length and by pressure [SI]."""
        return list(map(np.asarray, self._ask(_slopes, length, pressure)))

    def _ask(self, function: Callable[..., Any], length: Scalar, pressure: Scalar) -> Any:
        return function(self.muscle, np.asarray(length, float), np.asarray(pressure, float))


@evaluated
@jit_arrays
def _tension(muscle: CycleMuscle, length: Scalar, pressure: Scalar) -> Scalar:
    return muscle.tension(length, pressure)


@evaluated
@jit_arrays
def _gas(muscle: CycleMuscle, length: Scalar, pressure: Scalar) -> tuple[Scalar, Scalar]:
    return muscle.volume(length, pressure), muscle.gas_energy(length, pressure)


@evaluated
@jit_arrays
def _slopes(muscle: CycleMuscle, length: Scalar, pressure: Scalar) -> tuple[Scalar, ...]:
    by_length = [derivative(lambda x: f(x, pressure), length) for f in (muscle.tension, muscle.volume)]  # noqa: B023
    by_pressure = [derivative(lambda p: f(length, p), pressure) for f in (muscle.tension, muscle.volume)]  # noqa: B023
    return by_length[0], by_pressure[0], by_length[1], by_pressure[1]


CYCLES = {
    "maximal": "constant pressure, maximal shortening",
    "isotonic": "isotonic, the pressure programmed",
    "valve": "isotonic, constant supply through a valve",
}
# Where friction acts in the isotonic cycles. The printed joules leave it out of the path and take it off the output.
READINGS = {
    "printed": "the load's mean is taken as tension inside the braid: friction lessens the output only",
    "throughout": "the load's mean is tension of the tendon: friction is in the length, the pressure and the output",
}
NODES, WEIGHTS = np.polynomial.legendre.leggauss(32)


class Conditions(NamedTuple):
    """Conditions of a working cycle.

    Attributes:
        pressure: highest gauge pressure, that of the supply [Pa].
        stretched_length: length at which each cycle begins, L2 [m].
        ambient: the surroundings; only their pressure counts.
        exchange_pressure: gauge pressure of the accumulator; zero is the surroundings [Pa].
        friction: Coulomb friction while shortening [N].
        return_friction: the same while stretched again, zero in the paper [N].
        reading: reading of `READINGS`, where friction acts in the isotonic cycles.
    """

    pressure: float
    stretched_length: float
    ambient: Environment = Environment()
    exchange_pressure: float = 0.0
    friction: float = 0.0
    return_friction: float = 0.0
    reading: str = "printed"

    def check(self, muscle: CycleMuscle) -> None:
        """Raise `InputError` for conditions under which the muscle makes no cycle."""
        known = {"friction": "N", "return_friction": "N", "stretched_length": "m"}
        for name, unit in known.items():
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise InputError(name, None, f"must be a number that is not negative, got {value:g} {unit}")
        if self.reading not in READINGS:
            raise InputError("reading", self.reading, known=READINGS)
        ambient, threshold = float(self.ambient.pressure_abs), float(muscle.threshold())
        if not (math.isfinite(self.pressure) and threshold < self.pressure <= 1e8):
            least = f"the threshold of {with_unit(threshold, 'Pa')}" if threshold else "that of the surroundings"
            raise InputError("pressure", with_unit(self.pressure, "Pa"), f"must be above {least}, up to 1000 bar")
        if not -0.99 * ambient <= self.exchange_pressure < self.pressure:
            exchange, problem = with_unit(self.exchange_pressure, "Pa"), "must be below the pressure, above a vacuum"
            raise InputError("exchange_pressure", exchange, problem)
        shown, thread = with_unit(self.stretched_length, "m"), getattr(muscle.law, "thread_length", None)
        if thread is not None and self.stretched_length >= float(thread):
            longest = with_unit(float(thread), "m")
            raise InputError("stretched_length", shown, f"must be below {longest}, the length of its threads")
        probe = Probe(muscle)
        full, empty = probe.tension(self.stretched_length, np.array([self.pressure, 0.0]))
        if probe.volume(self.stretched_length, self.pressure) <= 0.0 or full <= empty:
            raise InputError("stretched_length", shown, "must be shorter; the braid holds no gas there that pulls")
        if full <= self.friction:
            words = "must be longer; the muscle does not shorten from there against its friction"
            raise InputError("stretched_length", shown, words)


class EnergyCycle(NamedTuple):
    """A working cycle [J], its ends and its air; plain floats, or arrays in a curve.

    Attributes:
        input: work of the piston.
        output: net work given to the load; negative where friction takes more than is given.
        efficiency: output over input [1].
        compression: work until the muscle begins to shorten.
        delivery: work while it shortens.
        friction: turned into heat by friction.
        throttling: lost in the valve of the supply.
        exhaust: exergy of the air that leaves, against the exchange.
        emptying: work of the muscle on that air while it empties.
        slackening: energy of the empty braid that springs back to its free length.
        unaccounted: input less all of these, a remainder.
        shortened_length: short end, L1 or L3 [m].
        shortened_volume: gas volume there [m^3].
        stretched_volume: gas volume at the stretched length and the exchange pressure, V2 [m^3].
        load: tension of the tendon as the shortening begins [N].
        start_pressure: gauge pressure at which it begins [Pa].
        taut_length: length from which stretching takes force [m].
    """

    input: Any
    output: Any
    efficiency: Any
    compression: Any
    delivery: Any
    friction: Any
    throttling: Any
    exhaust: Any
    emptying: Any
    slackening: Any
    unaccounted: Any
    shortened_length: Any
    shortened_volume: Any
    stretched_volume: Any
    load: Any
    start_pressure: Any
    taut_length: Any


def energy_cycle(muscle: CycleMuscle, name: str, conditions: Conditions) -> EnergyCycle:
    """Compute one working cycle.

    Args:
        muscle: from `cycle_muscle`.
        name: name of `CYCLES`.
        conditions: between which pressures and lengths, and with which friction.

    Raises:
        InputError: a name is unknown, the pressure does not exceed the threshold, the stretch is out of the law's domain,
            or the muscle cannot shorten.
    """
    if name not in CYCLES:
        raise InputError("cycle", name, known=CYCLES)
    conditions.check(muscle)
    cycle = EnergyCycle(*(float(v) for v in computed(muscle, name, conditions)))
    if not math.isfinite(cycle.input):
        problem = f"must be more for the cycle '{name}'; or give a lower exchange pressure"
        raise InputError("pressure", with_unit(conditions.pressure, "Pa"), problem)
    return cycle


# ---- the numbers, for one pressure or an array of them


def computed(muscle: CycleMuscle, name: str, c: Conditions, pressure: np.ndarray | float | None = None) -> EnergyCycle:
    """A cycle under conditions that were checked, or at other gauge pressures (n,) [Pa]; not a number where impossible."""
    probe, long = Probe(muscle), c.stretched_length
    high, low = np.asarray(c.pressure if pressure is None else pressure, float), c.exchange_pressure
    start, inside, load = _start(probe, name, c, high)
    least, most = (float(v) for v in muscle.law.length_range())
    end = rising_root(lambda x: probe.tension(x, high) - inside, np.full_like(high, least), np.full_like(high, long))
    short, rest = probe.volume(end, high), probe.volume(long, low)
    fill = _filling(probe, long, low, start)

    def along(function: Callable[[np.ndarray], np.ndarray], a: Scalar, b: Any) -> np.ndarray:
        return _integral(function, a, b, most)

    if name == "maximal":
        delivery = (high - low) * (short - probe.volume(long, high))
        delivered = along(lambda x: probe.tension(x, _wide(high)), end, long)
    else:
        delivery = along(lambda x: _isotonic_power(probe, x, _wide(inside), low, _wide(high)), end, long)
        delivered = inside * (long - end)
    throttling = (high - low) * (short - rest) - fill - delivery if name == "valve" else np.zeros_like(high)
    # Isothermal work that the air of a volume at the highest pressure could do down to the exchange [J], eq. 34
    top, bottom = (p + float(c.ambient.pressure_abs) for p in (high, c.exchange_pressure))
    exhaust = np.asarray(top * short * (np.log(top / bottom) - 1.0 + bottom / top))
    taut = rising_root(lambda x: probe.tension(x, low), end, np.full_like(high, long))
    taken = along(lambda x: probe.tension(x, low) + c.return_friction, taut, long)
    rubbed = c.friction * (long - end)
    friction = rubbed + c.return_friction * (long - taut)
    emptying = _filling(probe, end, low, high)
    slackening = -along(lambda x: probe.tension(x, low), end, taut)
    put_in, output = exhaust + fill + delivery + throttling, delivered - rubbed - taken
    possible = probe.tension(long, high) >= inside
    if name != "maximal":
        possible &= probe.tension(long, low) <= inside
    put_in, output = np.where(possible, put_in, np.nan), np.where(possible, output, np.nan)
    return EnergyCycle(
        input=put_in,
        output=output,
        efficiency=output / put_in,
        compression=exhaust + fill,
        delivery=delivery + throttling,
        friction=friction,
        throttling=throttling,
        exhaust=exhaust,
        emptying=emptying,
        slackening=slackening,
        unaccounted=put_in - output - friction - throttling - exhaust - emptying - slackening,
        shortened_length=end,
        shortened_volume=short,
        stretched_volume=np.broadcast_to(rest, high.shape),
        load=load,
        start_pressure=start,
        taut_length=taut,
    )


def _start(probe: Probe, name: str, c: Conditions, high: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """How a shortening begins: gauge pressure [Pa], tension inside the braid at its end, tension of the tendon then [N]."""
    strongest = probe.tension(c.stretched_length, high) - c.friction
    if name == "maximal":
        return high, np.full_like(high, c.friction), strongest
    empty = np.maximum(probe.tension(c.stretched_length, 0.0), 0.0)
    inside = 0.5 * (strongest + empty) + (c.friction if c.reading == "throughout" else 0.0)
    at = isotonic_pressure(probe, np.full_like(high, c.stretched_length), inside, c.exchange_pressure, high)
    return at, inside, inside - c.friction


def isotonic_pressure(probe: Probe, length: np.ndarray, inside: Scalar, low: Scalar, high: Scalar) -> np.ndarray:
    """Gauge pressure from low to high at which the braid pulls with a tension [N] at a length [m] [Pa]."""
    ends = (np.broadcast_to(np.asarray(v, float), length.shape) for v in (low, high))
    return rising_root(lambda p: probe.tension(length, p) - inside, *ends)


def _isotonic_power(probe: Probe, length: np.ndarray, inside: Any, low: Scalar, high: Scalar) -> np.ndarray:
    """Piston work per length of an isotonic shortening, (P' - P'x) times -dV/dL along it [N]."""
    p = isotonic_pressure(probe, length, inside, low, high)
    tension_by_length, tension_by_pressure, volume_by_length, volume_by_pressure = probe.slopes(length, p)
    pulls = np.where(tension_by_pressure > 0.0, tension_by_pressure, np.nan)  # below the threshold no pressure is found
    swell = volume_by_length - volume_by_pressure * tension_by_length / pulls
    isotonic_power: np.ndarray = -(p - low) * swell
    return isotonic_power


def _filling(probe: Probe, length: Scalar, low: Scalar, high: Scalar) -> np.ndarray:
    """Integral of (P' - low) dV at one length while the pressure goes from low to high [J]."""
    stored = probe.gas_energy(length, high) - probe.gas_energy(length, low)
    return np.asarray((high - low) * probe.volume(length, high) - stored)


def _wide(value: Scalar) -> np.ndarray:
    """An array with an axis more, along which the nodes of an integral lie."""
    return np.asarray(value, float)[..., None]


def _integral(function: Callable[[np.ndarray], np.ndarray], low: Scalar, high: Scalar, cut: float) -> np.ndarray:
    """Integral over length, in two pieces where the law's range ends between."""
    low, high = np.broadcast_arrays(np.asarray(low, float), np.asarray(high, float))
    middle, total = np.clip(cut, low, high), np.zeros(low.shape)
    for a, b in ((low, middle), (middle, high)):
        if np.any(a < b):
            total = total + 0.5 * (b - a) * (function(_wide(0.5 * (a + b)) + _wide(0.5 * (b - a)) * NODES) @ WEIGHTS)
    return total


def rising_root(function: Callable[[np.ndarray], np.ndarray], low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Zero of a rising function, or the nearer end of the interval if there is none."""
    for _ in range(54):
        middle = 0.5 * (low + high)
        below = function(middle) < 0.0
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return np.asarray(0.5 * (low + high))


# What a person may set, each declared once; the muscle says more closely what is allowed.
SETTINGS = {
    "pressure": Quantity("Pa", (0.0, 1e8), "gauge pressure of the supply", "P", (1e5, 10e5)),
    "accumulator_pressure": Quantity("Pa", (-1e5, 1e8), "gauge pressure of the accumulator", "Px", (0.0, 5e5)),
    "friction": Quantity("N", (0.0, 1e3), "Coulomb friction while shortening", "Fc", (0.0, 50.0)),
    "stretched_length": Quantity("m", (0.0, 10.0), "length at which each cycle begins", "L2", (0.01, 1.0)),
}


def cycle_muscles(
    spec: Specimen, law: str = "", volume: str = "", changes: Mapping[str, float] | None = None
) -> tuple[str, dict[str, CycleMuscle]]:
    """Name of a specimen's law, and its muscle with each available volume; the requested one is the first.

    Args:
        spec: spec of a McKibben muscle.
        law: where the specimen states several.
        volume: volume of `VOLUMES`; the paper's where the law has it, if left out.
        changes: parameters of the law that are replaced [SI].
    """
    if spec.kind != "mckibben":
        raise InputError("specimen", spec.id, f"must be a McKibben muscle; its kind is {spec.kind}")
    chosen = law or spec.law
    built = law_from_specimen(spec, chosen, changes=dict(changes or {}))
    which = volume or ("paper" if has_paper_volume(built) else "potential")
    order = [which, *(v for v in VOLUMES if v != which and (v == "potential" or has_paper_volume(built)))]
    return chosen, {v: cycle_muscle(built, v) for v in order}


def surroundings(spec: Specimen) -> Environment:
    """Ambient conditions: those of the papers for muscles of the papers, else the standard atmosphere."""
    return _of_the_papers() if spec.source() == "chou1996" else Environment()


@functools.cache
def _of_the_papers() -> Environment:
    return Environment.of_the_papers()


def stretched_length(spec: Specimen, muscle: CycleMuscle) -> float:
    """Length at the start of cycles [m]."""
    known = [n for n in ("stretched_length", "upper_length", "rest_length") if n in spec.properties]
    return spec.property_si(known[0], "m") if known else float(muscle.law.length_range()[1])


def check_threads(spec: Specimen, length: float, *, shown: str = "") -> None:
    """Refuse a length [m] that is not below that of the threads, wherever the specimen states one."""
    for group in spec.laws.values():
        if "thread_length" in group:
            threads = group["thread_length"].si("m", field="thread_length", where=spec.where)
            if isinstance(threads, float) and length >= threads:
                problem = f"must be below {with_unit(threads, 'm')}, the length of its threads"
                raise InputError("stretched_length", shown or with_unit(length, "m"), problem)


def coulomb_friction(spec: Specimen) -> float:
    """Friction as stated by the specimen, or zero [N]."""
    return spec.property_si("coulomb_friction", "N") if "coulomb_friction" in spec.properties else 0.0


def at_threshold(muscle: CycleMuscle, law: str) -> float:
    """Gauge pressure of an accumulator at the threshold [Pa].

    Raises:
        InputError: the law has no threshold; says what is allowed instead.
    """
    if float(muscle.threshold()) <= 0.0:
        cure = "use an accumulator pressure, such as '0.9 bar'"
        problem = f"cannot be used with the law '{law}', which has no threshold pressure; {cure}"
        raise InputError("accumulator", None, problem)
    return float(muscle.threshold())


def pressures(muscle: CycleMuscle, conditions: Conditions, highest: float, points: int) -> np.ndarray:
    """Gauge pressures for a curve, from where cycles begin to be possible up to the highest (points,) [Pa]."""
    low = max(float(muscle.threshold()), conditions.exchange_pressure, 0.0)
    return np.asarray(low + (highest - low) * np.linspace(0.0, 1.0, points + 1)[1:])
