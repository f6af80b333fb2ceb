"""A recording of a simulation: its samples once more, with all outputs, the balances, and where the numbers come from."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from .._jax import Scalar, Tree
from ..answers import Caution, collect
from ..assembly.accounts import CLOSED, Accounts, accounts, document
from ..assembly.build import assumption_table
from ..assembly.output_names import CONSTANT, output_meaning
from ..components.paths import resolved
from ..engine import sampled
from ..engine.native import call_compiled
from ..muscles.evidence import about_laws
from ..muscles.plausible import reached_cautions
from ..recordings import Channel, Recording
from ..recordings.provenance import created, versions
from .kernel import RecordingKernel, SteppedSimulation
from .mechanisms import published

if TYPE_CHECKING:
    from .stepping import SimulationState

RENAMED = {
    "load.angle": "joint.angle",
    "load.angular_velocity": "joint.velocity",
    "load.moment": "joint.moment",
    "load.position": "load.position",
    "load.velocity": "load.velocity",
    "load.tip_across": "tip.across",
    "load.tip_height": "tip.height",
}
MEANINGS = {
    "joint.angle": ("rad", "angle of the joint"),
    "joint.velocity": ("rad/s", "angular velocity of the joint"),
    "joint.moment": ("N*m", "moment of the muscles about the joint"),
    "load.position": ("m", "position of the load, the span of its muscle"),
    "load.velocity": ("m/s", "velocity of the load, positive lengthening"),
    "tip.across": ("m", "tip of the chain, across from its first joint"),
    "tip.height": ("m", "tip of the chain, above its first joint"),
}
NUMBERED = ("angle_", "angular_velocity_", "moment_")  # outputs of a chain's joints


class _Ended(NamedTuple):
    """The end of a run, as `accounts` takes it."""

    state: Any
    memory: Any
    integrals: dict[str, float]


def record(
    simulation: SteppedSimulation, start: SimulationState, commands: np.ndarray, sensed: list[list[float]]
) -> Recording:
    """The recording of samples from a start.

    Args:
        simulation: that took them.
        start: from which it did.
        commands: held in each of them, (samples, commands).
        sensed: observations with their noise, one more than samples; empty if there is no noise.
    """
    period, layouts = simulation.period, simulation.programs.layouts
    kernel = RecordingKernel(simulation.programs, simulation.parameters, period, simulation.inner)
    last, sums, outputs = kernel.replay(start.carry, commands, float(start.observed[-2]))
    time = period * np.arange(start.sample, start.sample + len(commands) + 1)
    closed = (
        _accounts(simulation, layouts.carry.unpack(start.carry), layouts.carry.unpack(last), sums) if sums else None
    )
    # a command holds from its sample on; the last one goes on
    held = np.concatenate([commands, commands[-1:]]) if len(commands) else start.commands[None]
    channels = _channels(simulation, outputs, held)
    for k, (name, output) in enumerate(simulation.plant.shown if sensed else ()):
        if name not in simulation.readouts.stated and (simulation.noise is None or simulation.noise[k] == 0.0):
            continue  # the controller saw the true value
        unit, _, meaning = described(output)
        column = np.array([row[k] for row in sensed])
        channels[f"measured.{name}"] = Channel(column, unit, "measured", f"{meaning}, measured")
    said = [str(one) for one in collect(*simulation.cautions, *_reached(simulation, channels))]
    meta = _meta(simulation, closed, start, period / kernel.most_steps) | ({"warnings": said} if said else {})
    return Recording(time, channels, meta)


def _reached(simulation: SteppedSimulation, channels: Mapping[str, Channel]) -> list[Caution | None]:
    """Cautions about the lengths and the highest pressure that each muscle had."""
    return [
        caution
        for name, muscle in simulation.system.muscles.items()
        for caution in reached_cautions(
            channels[f"{name}.length"].values, channels[f"{name}.pressure"].values, simulation.machine.units[name].law,
            published(muscle), name,
        )
    ]  # fmt: skip


def _accounts(simulation: SteppedSimulation, begin: Tree, end: Tree, sums: dict[str, float]) -> Accounts:
    """The accounts of mass and energy over all samples."""
    plant = simulation.plant
    first, last = (
        call_compiled(_inputs, plant, history, np.float64(simulation.period)) for _, _, history in (begin, end)
    )
    ended: Any = _Ended(end[0], end[1], sums)
    return accounts(simulation.machine, begin[:2], ended, first, last)


def _inputs(plant: Tree, history: Any, period: Scalar) -> dict[str, Tree]:
    return sampled.inputs_of(plant, sampled.Carry((), (), (), (), history), None, period)


def _channels(simulation: SteppedSimulation, outputs: dict[str, np.ndarray], held: np.ndarray) -> dict[str, Channel]:
    channels: dict[str, Channel] = {}
    for k, name in enumerate(simulation.commands):
        drive = next(d for d in simulation.drives if d.command == name)
        channels[f"{name}.command"] = Channel(held[:, k], drive.unit, "command", drive.meaning)
    for output, values in outputs.items():
        if output.startswith(CONSTANT):
            continue
        unit, name, meaning = described(output)
        channels[name] = Channel(np.broadcast_to(values, len(held)), unit, "true", meaning)
    return channels


def described(output: str) -> tuple[str, str, str]:
    """Unit, name in a recording, and meaning of an output."""
    owner, _, last = output.rpartition(".")
    if owner == "load" and last.startswith(NUMBERED):
        kind, _, number = last.rpartition("_")
        unit, meaning = output_meaning(f"joint {number}.{kind}")
        return unit, f"joint_{number}.{'velocity' if kind == 'angular_velocity' else kind}", meaning
    name = RENAMED.get(output, output)
    unit, meaning = MEANINGS.get(name) or output_meaning(output)
    return unit, name, meaning


def _meta(
    simulation: SteppedSimulation, closed: Accounts | None, start: SimulationState, shortest_step: float
) -> dict[str, Tree]:
    machine, room = simulation.machine, simulation.machine.environment
    by_name = {name: published(muscle) for name, muscle in simulation.system.muscles.items()}
    specimens = [spec for spec in by_name.values() if spec is not None]
    cites = [key for unit in machine.units.values() for key in unit.law.cites]
    cites += [key for spec in specimens for key in spec.sources]
    return {
        "title": simulation.title,
        "system": repr(simulation.system),
        "air": simulation.air.document,
        "specimen": ", ".join(dict.fromkeys(s.id for s in specimens)) or None,
        "parameters": resolved(machine),
        "mounting": {name: unit.mounting for name, unit in machine.units.items()},
        "assumptions": assumption_table(simulation.assumptions),
        "environment": {"pressure_abs": float(room.pressure_abs), "temperature": float(room.temperature)},
        "balance": {name: float(getattr(closed, name)) for name in CLOSED} if closed else {},
        "friction": {"work": closed.friction, "dissipated": closed.dissipated} if closed else {},
        "energy": document(machine, [closed.energy_parts]) if closed else {},
        "timing": {
            "control_rate": 1.0 / simulation.period,
            "step": simulation.period / simulation.inner,
            "shortest_step": shortest_step,
        },
        "first_sample": start.sample,
        "result": "done",
        "message": "The run reached its end.",
        **about_laws({name: (spec, machine.units[name].law) for name, spec in by_name.items()}),
        "inferred": sorted({key for s in specimens for key in s.inferred()}),
        "versions": versions(),
        "citations": list(dict.fromkeys(cites)),
        "created": created(),
    }
