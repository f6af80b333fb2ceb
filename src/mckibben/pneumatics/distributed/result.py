"""Results of a distributed tube, with balances of mass and energy."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from .ends import End, EndState
from .equations import Primitive
from .openings import TubeFace
from .tube import DistributedTube, TubeState


class Sample(NamedTuple):
    """State at a recorded moment, as arrays on the device."""

    cells: Primitive
    faces: tuple[TubeFace, TubeFace]
    behind: tuple[Primitive, Primitive]
    ends: tuple[EndState, EndState]
    heat: Any


class EndRecord(NamedTuple):
    """An end over time; arrays of shape (samples,). Flow and velocity are positive in the direction of x at both ends."""

    pressure: np.ndarray  # absolute, static, at the end of the tube [Pa]
    temperature: np.ndarray  # there [K]
    velocity: np.ndarray  # there [m/s]
    mass_flow: np.ndarray  # [kg/s]
    enthalpy_flow: np.ndarray  # total [W]
    outside_pressure: np.ndarray  # in the reservoir or the vessel [Pa]; nan behind a closed end
    outside_temperature: np.ndarray  # there [K]
    mass: np.ndarray  # content of the vessel, or what a reservoir has received [kg]
    energy: np.ndarray  # likewise [J]
    heat: np.ndarray  # from the vessel's wall since the start [J]


class TubeBalance(NamedTuple):
    """Balances of the whole run: change of contents against independently integrated fluxes.

    The heat of an isothermal wall (or vessel) is what its temperature asks for: there the energy balance proves nothing
    about the heat, and `heat_is_remainder` says so.
    """

    mass_error: float  # gain of tube and ends, over content at the start and throughput [1]
    energy_error: float  # likewise less heat [1]
    mass_throughput: float  # through both ends, without regard to direction [kg]
    energy_throughput: float  # [J]
    heat: float  # from the tube's wall [J]
    heat_is_remainder: bool


class TubeResult(NamedTuple):
    """A simulated tube."""

    times: np.ndarray  # (samples,) [s]
    positions: np.ndarray  # centres of the cells, (cells,) [m]
    pressure: np.ndarray  # absolute, (samples, cells) [Pa]
    velocity: np.ndarray  # (samples, cells) [m/s]
    temperature: np.ndarray  # (samples, cells) [K]
    left: EndRecord
    right: EndRecord
    heat: np.ndarray  # from the tube's wall since the start, (samples,) [J]
    balance: TubeBalance
    steps: int


def assemble(
    tube: DistributedTube,
    ends: tuple[End, End],
    states: tuple[TubeState, TubeState],
    recorded: Sample,
    times: np.ndarray,
    steps: int,
) -> TubeResult:
    """The result from what lies at the ends, the states at the start and the end of the run, and the samples."""
    centres = (np.arange(tube.cells) + 0.5) * float(tube.cell_length)
    area = float(tube.area)
    at_left, at_right = (
        _end_record(area, sign, recorded.faces[k], recorded.behind[k], recorded.ends[k])
        for k, sign in enumerate((-1.0, 1.0))
    )
    pressure, velocity, temperature = (np.asarray(values) for values in recorded.cells)
    return TubeResult(
        times=times,
        positions=centres,
        pressure=pressure,
        velocity=velocity,
        temperature=temperature,
        left=at_left,
        right=at_right,
        heat=np.asarray(recorded.heat),
        balance=_balance(tube, ends, *states),
        steps=steps,
    )


def _end_record(area: float, sign: float, face: TubeFace, behind: Primitive, state: EndState) -> EndRecord:
    columns = (
        face.state.pressure,
        face.state.temperature,
        sign * face.state.velocity,
        sign * area * face.mass,
        sign * area * face.energy,
        behind.pressure,
        behind.temperature,
        *state,
    )
    return EndRecord(*(np.asarray(column) for column in columns))


def _balance(tube: DistributedTube, ends: tuple[End, End], start: TubeState, end: TubeState) -> TubeBalance:
    def content(state: TubeState) -> np.ndarray:
        """Mass and energy of the tube and behind either end, shape (3, 2)."""
        tube_content = [float(x) for x in tube.content(state.cells)]
        return np.array([tube_content, *([float(e.mass), float(e.energy)] for e in (state.left, state.right))])

    heat = float(end.heat)
    received = np.array([0.0, heat + float(end.left.heat) + float(end.right.heat)])
    before, after, passed = content(start), content(end), np.array(end.passed, float)
    error = (np.sum(after - before, axis=0) - received) / (np.sum(before, axis=0) + passed)
    remainder = tube.wall == "isothermal" or any(e.heat_is_remainder() for e in ends)
    return TubeBalance(float(error[0]), float(error[1]), float(passed[0]), float(passed[1]), heat, remainder)
