"""Gas sources of a sizing: cycles of a filling or a battery, energy of a cycle and of a day.

    bottle       work of filling it for the gas that a cycle takes; what is left below the supply's pressure is lost
    compressor   isothermal R T ln r at best; adiabatic, and with its efficiency, as the compressor of the circuits
    heated       a closed gas between a cold low pressure and the hot high one, with a reservoir beside the muscle:
                 Th = T0 P (V1 + Vr)/(Px (V2 + Vr)),   Q = m cv (Th - T0) + P (V1 - V2)

V2 and V1 are the muscle's volumes at both ends, P and Px absolute. The work of a cycle is the wished force times the stroke.
Range: ideal gases; bottles at the temperature of the room, though a fast draught of CO2 cools them. The heated reservoir
gives all its heat back to the room each cycle. Source of the choice: the discussion of C.-P. Chou and B. Hannaford, 1996,
doi:10.1109/70.481753; the formulas are those of an ideal gas.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..._jax import Scalar
from ...answers import brief
from ...components.flow import GasState
from ...components.gas import AIR, REFERENCE_DENSITY
from ...engine.native import call_compiled
from ...pneumatics.compressor import Compressor
from ...quantities import with_unit
from ...specimens.parts import CataloguePart, parts
from .candidate import Judged, LawAtPressure
from .lines import LineResult
from .own_parts import OWN_BATTERY
from .requirements import Requirements
from .spread import InferredRanges, at_end


@dataclass(frozen=True)
class SourceResult:
    """Performance of a gas source.

    Attributes:
        id: of the part.
        title: description.
        form: ``bottle``, ``compressor`` or ``heated``.
        energy: that a cycle costs at the source [J].
        isothermal: what it would cost with an ideal compressor of constant temperature [J].
        adiabatic: the same without heat exchange [J]; None if there is no compressor.
        efficiency: force times stroke over `energy` [1].
        gas: mass that a cycle takes [kg].
        cycles: cycles of one filling or battery; None if it does not end.
        run_time: at the wished frequency [s]; None if neither is known.
        mass: mass of the source [kg]; None if unknown.
        able: whether it can do it at the wished frequency.
        note: why not, or what to know.
        temperature: highest of the gas [K]; None if it is that of the room.
        inferred: numbers that no source prints.
        energy_range: of `energy`, that inferred numbers leave [J].
        cycles_range: of `cycles`.
        run_time_range: of `run_time` [s].
        daily: energy or heat of a day [J]; None without a frequency and a working time.
        daily_range: of `daily` [J].
        fillings: fillings or charges of a day; None if it does not end.
        fillings_range: of `fillings`.
        duty: share of the time for which a compressor runs; None if the frequency is not known.
        surely: whether it can do it with its inferred numbers at their poor ends too.
    """

    id: str
    title: str
    form: str
    energy: float
    isothermal: float | None
    adiabatic: float | None
    efficiency: float
    gas: float
    cycles: int | None
    run_time: float | None
    mass: float | None
    able: bool
    note: str
    temperature: float | None
    inferred: tuple[str, ...]
    energy_range: tuple[float, float] | None = None
    cycles_range: tuple[int, int] | None = None
    run_time_range: tuple[float, float] | None = None
    daily: float | None = None
    daily_range: tuple[float, float] | None = None
    fillings: float | None = None
    fillings_range: tuple[float, float] | None = None
    duty: float | None = None
    surely: bool = True

    __repr__ = brief


@dataclass(frozen=True)
class DailyUse:
    """What a day takes.

    Attributes:
        working_time: time at work [s].
        cycles: cycles.
        air: mass of air or gas as air [kg].
        air_range: that inferred numbers leave [kg].
        volume: of that air at the reference atmosphere (ANR) [m^3].
        valve_energy: electrical energy of the valve, held all the time [J]; None if no valve was looked for.
    """

    working_time: float
    cycles: float
    air: float
    air_range: tuple[float, float]
    volume: float
    valve_energy: float | None


def daily_use(
    wish: Requirements, air: float, air_range: tuple[float, float], line: LineResult | None
) -> DailyUse | None:
    """Air and electrical energy of a day; None without a frequency and a working time."""
    if wish.frequency is None or wish.working_time is None:
        return None
    cycles = wish.frequency * wish.working_time
    low, high = (cycles * end for end in air_range)
    power = None if line is None or "power" in line.not_stated else line.power * wish.working_time
    return DailyUse(wish.working_time, cycles, cycles * air, (low, high), cycles * air / REFERENCE_DENSITY, power)


def sources_for(
    muscle: Judged,
    wish: Requirements,
    line: LineResult | None,
    *,
    own: Sequence[CataloguePart] = (),
    spread: InferredRanges | None = None,
) -> list[SourceResult]:
    """Evaluate every shipped source for the air that muscle and line take; sufficient ones first, by their energy.

    Args:
        muscle: which.
        wish: the requirements.
        line: valve and tube; None if they were not looked for.
        own: a battery or a tank of the user's own, which come first.
        spread: range of the air of a cycle; that of the air itself by default.
    """
    air, pressure = (muscle.air, wish.pressure) if line is None else (line.air, line.supply)
    ends = (air, air) if spread is None else spread.air
    results = [_ranged(p, muscle, wish, air, ends, pressure, line) for p in (*own, *parts("gas_source"))]
    first = [p.id for p in own]
    return sorted(results, key=lambda s: (s.id not in first, not s.able, s.energy))


Evaluation = Callable[[CataloguePart, Judged, Requirements, float, float], SourceResult]


def _ranged(
    part: CataloguePart,
    muscle: Judged,
    wish: Requirements,
    air: float,
    ends: tuple[float, float],
    pressure: float,
    line: LineResult | None,
) -> SourceResult:
    """A source with the ranges that its inferred numbers and those of the muscle leave, and what a day takes."""
    make: Evaluation = {"bottle": _bottle, "compressor": _compressor, "heated": _heated}[part.form]

    def at(one: CataloguePart, gas: float) -> SourceResult:
        return _with_valve(one, make(one, muscle, wish, gas, pressure), wish, line)

    usual, poor, good = at(part, air), at(at_end(part, good=False), ends[1]), at(at_end(part, good=True), ends[0])
    energies = (min(good.energy, usual.energy), max(poor.energy, usual.energy))
    cycles = None if usual.cycles is None else (poor.cycles or 0, good.cycles or 0)
    times = None if usual.run_time is None else (poor.run_time or 0.0, good.run_time or 0.0)
    result = replace(usual, energy_range=energies, cycles_range=cycles, run_time_range=times, surely=poor.able)
    if wish.frequency is None or wish.working_time is None:
        return result
    number = wish.frequency * wish.working_time
    fillings = [None if not one.cycles else number / one.cycles for one in (usual, good, poor)]
    low, high = fillings[1], fillings[2]
    return replace(
        result,
        daily=number * usual.energy,
        daily_range=(number * energies[0], number * energies[1]),
        fillings=fillings[0],
        fillings_range=None if low is None or high is None else (low, high),
    )


def _with_valve(part: CataloguePart, one: SourceResult, wish: Requirements, line: LineResult | None) -> SourceResult:
    """A battery of the user's own, which feeds the valve too, at a known frequency."""
    if part.id != OWN_BATTERY or line is None or wish.frequency is None:
        return one
    energy = one.energy + line.power / wish.frequency
    cycles = int(part.values["stored_energy"] / energy)
    guessed = ", which is usual and was not given" if "power" in line.not_stated else ""
    note = f"{one.note}; feeds the valve too, {with_unit(line.power, 'W', 3)}{guessed}"
    share = wish.force * wish.stroke / energy
    return replace(one, energy=energy, efficiency=share, cycles=cycles, run_time=cycles / wish.frequency, note=note)


def _isothermal(part: CataloguePart, wish: Requirements, pressure: float) -> float:
    """Least work to compress gas from atmospheric to a gauge pressure [J/kg]."""
    room = float(wish.environment.pressure_abs)
    return part.values["gas_constant"] * float(wish.environment.temperature) * math.log1p(pressure / room)


def _result(part: CataloguePart, wish: Requirements, energy: float, **more: Any) -> SourceResult:
    """A source that spends an energy in a cycle [J]; what is not stated does not apply to it."""
    efficiency, inferred = wish.force * wish.stroke / energy, tuple(part.inferred())
    none = dict.fromkeys(("isothermal", "adiabatic", "cycles", "run_time", "mass", "temperature"))
    known: dict[str, Any] = {**none, **more}
    return SourceResult(part.id, part.title, part.form, energy, efficiency=efficiency, inferred=inferred, **known)


def _bottle(part: CataloguePart, muscle: Judged, wish: Requirements, air: float, pressure: float) -> SourceResult:
    v = part.values
    room, warm = float(wish.environment.pressure_abs), float(wish.environment.temperature)
    gas = air * float(AIR.gas_constant) / v["gas_constant"]
    left = (pressure + room) * v["volume"] / (v["gas_constant"] * warm)
    cycles = max(0, int((v["filling"] - left) / gas))
    energy = gas * v["filling_work"]
    enough = v["pressure"] > pressure and cycles > 0
    lost = "throttled from its pressure: most of the filling's work is lost"
    return _result(
        part,
        wish,
        energy,
        isothermal=gas * _isothermal(part, wish, pressure),
        gas=gas,
        cycles=cycles,
        run_time=None if wish.frequency is None else cycles / wish.frequency,
        mass=v.get("mass"),
        able=enough,
        note=lost if enough else "empty before a cycle is done",
    )


def _compressor(part: CataloguePart, muscle: Judged, wish: Requirements, air: float, pressure: float) -> SourceResult:
    v = part.values
    ideal = air * adiabatic_work(wish, pressure)
    energy = ideal / v["efficiency"]
    stored = v.get("stored_energy")
    cycles = None if stored is None else int(stored / energy)
    drawn = None if wish.frequency is None else air * wish.frequency / REFERENCE_DENSITY
    able = drawn is None or drawn <= v["free_flow"]
    share = "" if drawn is None else f"runs {drawn / v['free_flow']:.0%} of the time"
    run_time = None if cycles is None or wish.frequency is None else cycles / wish.frequency
    return _result(
        part,
        wish,
        energy,
        isothermal=air * _isothermal(part, wish, pressure),
        adiabatic=ideal,
        gas=air,
        cycles=cycles,
        run_time=run_time,
        mass=v.get("mass"),
        able=able,
        note=share if able else "delivers too little for that frequency",
        duty=None if drawn is None else drawn / v["free_flow"],
    )


def adiabatic_work(wish: Requirements, pressure: float) -> float:
    """Work to compress ambient air to a gauge pressure without heat exchange and losses [J/kg]."""
    machine = Compressor(displacement=1e-5, speed=150.0, clearance=0.0, efficiency=1.0)
    room, warm = wish.environment.pressure_abs, wish.environment.temperature
    numbers = (np.float64(x) for x in (room, pressure + room, warm))
    return float(call_compiled(_specific_work, machine, *numbers, mode="strict"))


def _specific_work(machine: Compressor, inlet: Scalar, outlet: Scalar, warm: Scalar) -> Scalar:
    gas = (GasState(inlet, warm), GasState(outlet, warm))
    (flow,) = machine.flows(gas, (), 1.0, 1.0)
    return machine.shaft_power(gas, (), 1.0, 1.0) / flow


def _heated(part: CataloguePart, muscle: Judged, wish: Requirements, air: float, pressure: float) -> SourceResult:
    v, p = part.values, wish.pressure
    room, cold = float(wish.environment.pressure_abs), float(wish.environment.temperature)
    ends = LawAtPressure(muscle.muscle.law, p)
    long_, short = muscle.muscle.longest, muscle.muscle.longest - wish.stroke
    low = min(v["low_pressure"], 0.5 * p)
    v2, v1 = ends.volume(long_, low), ends.volume(short)
    reservoir = v1  # as large as the muscle; a larger one is cooler and wastes more heat
    gas = (low + room) * (v2 + reservoir) / (v["gas_constant"] * cold)
    hot = cold * (p + room) * (v1 + reservoir) / ((low + room) * (v2 + reservoir))
    heat = gas * v["gas_constant"] / (v["heat_ratio"] - 1.0) * (hot - cold) + (p + room) * (v1 - v2)
    able = hot <= v["hottest"]
    reach = v["hottest"] / cold * (low + room) * (v2 + reservoir) / (v1 + reservoir) - room
    note = "closed: no gas is used up"
    if not able:
        least, most = with_unit(low, "Pa", 3), with_unit(reach, "Pa", 2)
        note = f"{hot:.0f} K is needed, {v['hottest']:.0f} K is borne: that makes {most} of {least}"
    return _result(part, wish, heat, gas=0.0, able=able, note=note, temperature=hot)
