"""The exergy account of a stretch of a simulated recording, from the samples of its true channels.

A valve may open and close between two samples. So the mass that passed in an interval is taken from what the volumes hold at
its ends, wherever the network allows it, and from the sampled flows only where it does not; what it was worth is the mean of
both ends. The error of such sums stands as a remainder and is folded into no part: below a thousandth of the supply for
intervals of 1 ms. Where a whole run is requested, its own integrals are better.

The machine of the recording is rebuilt from its resolved parameters: environment, gas, and muscles.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .._jax import Scalar
from ..assembly.muscle_unit import BraidMotion, MuscleUnit
from ..components import Environment
from ..components.gas import Gas
from ..documents import JsonValue
from ..errors import InputError
from ..muscles.build import construct
from ..muscles.elements import Tendon
from ..muscles.law import TensionLaw, stored_along
from ..muscles.laws import LAWS, law_type
from ..pneumatics.circuit import DeadState, Seen
from ..quantities import declared
from ..recordings import Recording
from .channels import known

GAP = 1.5  # periods between two samples from which something was not recorded


def whole_pieces(record: Recording) -> list[slice]:
    """The samples between gaps of the clock, each a slice of at least two."""
    if len(record) < 2:
        return []
    cuts = np.flatnonzero(np.diff(record.time) > GAP * record.period) + 1
    edges = [0, *(int(c) for c in cuts), len(record)]
    return [slice(a, b) for a, b in zip(edges, edges[1:], strict=False) if b - a > 1]


def middle(values: Scalar) -> np.ndarray:
    """Means of neighbouring samples (n - 1,)."""
    both = np.asarray(values, float)
    return np.asarray(0.5 * (both[1:] + both[:-1]))


class Flows:
    """Cumulative parts (n,) [J], and what is stored, of one stretch without gaps.

    Attributes:
        into: by name.
        out: by name.
        stored: by name.
        air: drawn from supplies (n,) [kg].
        work_out: work out of the shaft where it is positive (n,) [J].
        vented: to the room, by path: upstream absolute pressure (n - 1,) [Pa] and mass (n - 1,) [kg] of every interval.
    """

    def __init__(self, record: Recording) -> None:
        self.time, self.machine = record.time, RecordedMachine(record)
        self.record = record
        about = record.meta["energy"]
        self.paths: Mapping[str, list[str]] = about["paths"]
        self.nodes: Mapping[str, str] = about["nodes"]
        self.lines = [set(line) for line in about["lines"]]
        self.dead = DeadState.of(self.machine.gas, self.machine.room)
        zero = np.zeros(len(record))
        self.into = {"supply": zero, "machines": zero, "walls": zero}
        names = ("valve", "tube", "dead_volume", "exhaust", "leak", "machine", "mixing", "heat")
        self.out = dict.fromkeys((*names, "friction", "viscous", "shaft_work"), zero)
        self.stored = dict.fromkeys(("gas", "muscle", "tendon"), zero)
        self.air, self.work_out = zero, zero
        self.vented: list[tuple[np.ndarray, np.ndarray]] = []
        self.seen = {name: self._seen(name) for name in self.nodes}
        self.volumes: dict[str, np.ndarray] = {}
        for name in (n for n, kind in self.nodes.items() if kind == "chamber"):
            at, mass = self.seen[name], known(record, f"{name}.mass")
            self.volumes[name] = np.asarray(mass * self.dead.gas.gas_constant * at.temperature / at.pressure_abs)
        self.passed = self._passed()
        for name, (kind, a, b) in self.paths.items():
            for ends, mass in (((a, b), self.passed[name]), ((b, a), -self.passed[name])):
                self._way(kind, ends, np.where(mass > 0.0, mass, 0.0))
        for name in self.volumes:
            self._chamber(name)
        for muscle in self.machine.muscles():
            self._muscle(muscle)

    def _sum(self, power: Any) -> np.ndarray:
        """Integral from the first sample to every one, by trapezoids."""
        values = np.broadcast_to(np.asarray(power, float), self.time.shape)
        steps = 0.5 * (values[1:] + values[:-1]) * np.diff(self.time)
        return np.concatenate([[0.0], np.cumsum(steps)])

    def supply_pressure(self) -> float:
        """Highest absolute pressure of the supplies [Pa]; NaN without one."""
        pressures = [float(np.max(self.seen[n].pressure_abs)) for n, kind in self.nodes.items() if kind == "supply"]
        return max(pressures, default=float("nan"))

    def _seen(self, node: str) -> Seen:
        if f"{node}.pressure_abs" in self.record and f"{node}.temperature" in self.record:
            return self.dead.see(known(self.record, f"{node}.pressure_abs"), known(self.record, f"{node}.temperature"))
        both = [self.machine.find(f"circuit.nodes.{node}.{quantity}") for quantity in ("pressure_abs", "temperature")]
        if self.nodes[node] == "chamber" or None in both:
            problem = "is missing: the account needs pressure and temperature of every volume"
            raise InputError(f"channel {node}.pressure_abs", None, problem)
        return self.dead.see(np.full(self.time.shape, both[0]), np.full(self.time.shape, both[1]))

    def _passed(self) -> dict[str, np.ndarray]:
        """Mass through every path in every interval (n - 1,) [kg]."""
        sampled = {
            n: 0.5 * np.diff(self.time) * (flow[1:] + flow[:-1])
            for n in self.paths
            for flow in (known(self.record, f"{n}.mass_flow"),)
        }
        masses = {n: sampled[n] for n, (kind, *_) in self.paths.items() if kind == "leak"}
        left = {n: np.diff(known(self.record, f"{n}.mass")) for n in self.volumes}
        while left:
            # a volume with one path that is not known yet tells it; one with two says which of them it was
            open_paths = {n: [p for p, (_, *ends) in self.paths.items() if n in ends and p not in masses] for n in left}
            node = min(left, key=lambda n: len(open_paths[n]))
            own, known_ones = open_paths[node], [p for p in self._at(node) if p in masses]
            needed = left.pop(node) - sum(masses[p] * self._sign(p, node) for p in known_ones)
            vents = [p for p in own if any(self.nodes[end] == "room" for end in self.paths[p][1:])]
            fills = [p for p in own if p not in vents]
            masses |= {p: sampled[p] for p in own}
            if len(own) == 1:
                masses[own[0]] = needed * self._sign(own[0], node)
            elif len(vents) == len(fills) == 1:
                came = sampled[fills[0]] * self._sign(fills[0], node)
                left_it = -sampled[vents[0]] * self._sign(vents[0], node)
                # the larger of both is put right, but not beyond zero
                fill = np.where(came >= left_it, needed + left_it, came)
                fill = np.where(fill < 0.0, 0.0, np.where(fill < needed, needed, fill))
                masses[fills[0]] = fill * self._sign(fills[0], node)
                masses[vents[0]] = (needed - fill) * self._sign(vents[0], node)
        return {**sampled, **masses}

    def _at(self, node: str) -> list[str]:
        return [p for p, (_, *ends) in self.paths.items() if node in ends]

    def _sign(self, path: str, node: str) -> float:
        return 1.0 if self.paths[path][2] == node else -1.0

    def _add(self, table: dict[str, np.ndarray], name: str, amounts: Any) -> None:
        """Add the amounts of every interval (n - 1,) to a part."""
        table[name] = table[name] + np.concatenate([[0.0], np.cumsum(np.asarray(amounts, float))])

    def _way(self, kind: str, ends: tuple[str, str], mass: np.ndarray) -> None:
        """Add the mass (n - 1,) [kg] that flows from the first end of a path to the second."""
        source, target = ends
        taken, there = self.seen[source], self.seen[target]
        lost = mass * middle(self.dead.throttled(1.0, taken, there))
        arrives = Seen(there.pressure_abs, taken.temperature, there.squeeze, taken.warmth)
        worth = mass * middle(self.dead.flowing(taken if self.nodes[source] != "chamber" else arrives))
        if self.nodes[target] == "chamber":
            self._add(self.out, "mixing", mass * middle(self.dead.mixed(1.0, taken, there)))
        for end, sign in ((source, 1.0), (target, -1.0)):
            if self.nodes[end] == "supply":
                self._add(self.into, "supply", sign * worth)
                self.air = self.air + np.concatenate([[0.0], np.cumsum(sign * mass)])
            elif self.nodes[end] == "room":
                lost = lost - sign * worth
        if self.nodes[target] == "room":
            self.vented.append((middle(taken.pressure_abs), mass))
        where = kind if kind in ("tube", "leak", "machine") else "valve"
        if where == "valve" and "room" in map(self.nodes.get, ends):
            where = "exhaust"
        line = next((g for g in self.lines if len(g & set(ends)) == 1), None)
        if where == "exhaust" and line is not None:
            whole = sum(self.volumes[n] for n in line)
            working = sum(known(self.record, f"{n}.volume") for n in line if n in self.machine.muscles())
            idle = lost * middle(np.asarray(1.0 - working / whole))  # the share of volumes that never change
            self._add(self.out, "dead_volume", idle)
            lost = lost - idle
        self._add(self.out, where, lost)

    def _chamber(self, node: str) -> None:
        at, volume = self.seen[node], self.volumes[node]
        self.stored["gas"] = self.stored["gas"] + np.asarray(
            self.dead.stored(at.pressure_abs, volume, known(self.record, f"{node}.mass"))
        )
        conductance = self.machine.find(f"circuit.nodes.{node}.heat.conductance")
        wall = self.machine.find(f"circuit.nodes.{node}.heat.wall_temperature")
        if conductance is None:  # kept at its temperature, or on a polytrope: what the first law then asks for
            wall, heat = float(self.dead.temperature), np.gradient(self._heat(node), self.time)
        else:
            heat = conductance * (wall - np.asarray(at.temperature))
        self.out["heat"] = self.out["heat"] + self._sum(self.dead.by_heat(heat, at.temperature, wall))
        self.into["walls"] = self.into["walls"] + self._sum(heat * (1.0 - float(self.dead.temperature) / wall))

    def _heat(self, node: str) -> np.ndarray:
        """Heat into a volume since the first sample, by the first law [J]."""
        at, volume, gas = self.seen[node], self.volumes[node], self.dead.gas
        pressure = np.asarray(at.pressure_abs)
        pushed = np.concatenate([[0.0], np.cumsum(0.5 * (pressure[1:] + pressure[:-1]) * np.diff(volume))])
        brought = np.zeros(len(pressure) - 1)
        for name in self._at(node):
            _, a, b = self.paths[name]
            for source, mass in ((a, self.passed[name]), (b, -self.passed[name])):
                hot = middle(self.seen[source].temperature) * float(gas.cp)
                brought = brought + self._sign(name, node) * np.sign(mass) * np.where(mass > 0.0, mass, 0.0) * hot
        stored = pressure * volume / (float(gas.heat_ratio) - 1.0)
        return np.asarray(stored - stored[0] + pushed - np.concatenate([[0.0], np.cumsum(brought)]))

    def _muscle(self, name: str) -> None:
        unit, record = self.machine.unit(name), self.record
        length, gauge, rubbing = (known(record, f"{name}.{what}") for what in ("length", "pressure", "friction"))
        span, speed = known(record, f"{name}.span"), known(record, f"{name}.span_velocity")
        inner = np.asarray(unit.law.braid_tension(length, gauge)) + rubbing
        at = BraidMotion(length, known(record, f"{name}.velocity"), inner, known(record, f"{name}.tension"))
        power = -known(record, f"{name}.load_tension") * speed
        taken = rubbing * at.velocity
        # over a bone, the load feels another tension than the muscle
        taken = taken + (known(record, f"{name}.load_tension") - known(record, f"{name}.tension")) * speed
        slip = known(record, f"{name}.slip") if unit.clamp is not None else np.zeros(())
        if slip.ndim:  # the clamp turns the tension's work on what slips into heat
            taken = taken + known(record, f"{name}.tension") * np.gradient(slip, self.time)
        parts = {"viscous": unit.lost(at, span - slip, speed), "friction": taken, "shaft_work": power}
        for part, value in parts.items():
            self.out[part] = self.out[part] + self._sum(value)
        self.work_out = self.work_out + self._sum(np.where(power > 0.0, power, 0.0))
        self.stored["muscle"] = self.stored["muscle"] + stored_along(unit.law, np.asarray(at.length), gauge)
        self.stored["tendon"] = self.stored["tendon"] + np.asarray(unit.kinetic_and_elastic(at, span - slip))


PREFIXES = ("", "machine.")  # of the paths to a machine, where other things are written down beside it


class RecordedMachine:
    """The parameters of a recording by dotted path.

    Raises:
        InputError: if the recording has none.
    """

    def __init__(self, record: Recording) -> None:
        stated = record.meta.get("parameters")
        if not isinstance(stated, Mapping) or not stated:
            raise InputError("parameters", None, "must be in the recording: the resolved parameters of its machine")
        self._values = {k: v.get("value") if isinstance(v, Mapping) else v for k, v in stated.items()}
        room = record.meta.get("environment") or {}
        self.room = Environment(**{k: float(room[k]) for k in ("pressure_abs", "temperature") if k in room})
        self._laws: Mapping[str, str] = (record.meta.get("energy") or {}).get("laws", {})

    def find(self, path: str) -> JsonValue:
        """The value at a path [SI], None if it is not stated."""
        return next((self._values[p + path] for p in PREFIXES if p + path in self._values), None)

    def below(self, path: str) -> dict[str, JsonValue]:
        """The values of which the path begins with one, by the rest of their path."""
        for prefix in PREFIXES:
            whole = f"{prefix}{path}."
            values = {k.removeprefix(whole): v for k, v in self._values.items() if k.startswith(whole)}
            if values:
                return values
        return {}

    @property
    def gas(self) -> Gas:
        """Working gas."""
        return Gas(**self.below("circuit.gas"))

    def muscles(self) -> list[str]:
        """Their names."""
        return list(dict.fromkeys(path.split(".law.")[0] for path in self.below("units") if ".law." in path))

    def law(self, muscle: str) -> TensionLaw:
        """The tension law of a muscle.

        Raises:
            InputError: if the parameters are those of no law that is known.
        """
        parameters = self.below(f"units.{muscle}.law")
        alike = (n for n in LAWS if set(declared(law_type(n))) == set(parameters))
        names = [self._laws[muscle]] if muscle in self._laws else [*alike]
        if len(names) != 1 or not parameters:
            problem = f"must be the parameters of {', '.join(LAWS)}"
            raise InputError(f"law of {muscle}", ", ".join(parameters) or None, problem, where="parameters")
        known = {k: v for k, v in parameters.items() if v == v}  # an unknown volume is no number
        return construct(law_type(names[0]), known)

    def unit(self, muscle: str) -> MuscleUnit:
        """A muscle with its dampers, and its tendon if it has one; without friction, which the recording shows itself."""
        values = {k: v for k, v in self.below(f"units.{muscle}").items() if "." not in k}
        cord = self.below(f"units.{muscle}.tendon")
        return MuscleUnit(law=self.law(muscle), tendon=Tendon(**cord) if cord else None, **values)
