"""Control of angle and stiffness of an antagonist pair by a rig's computer, from set-points to a recording."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from .._jax import jax, jnp
from ..answers import Caution, collect
from ..assembly.accounts import CLOSED, Accounts, accounts, document
from ..assembly.build import antagonist_pair, rig_unit
from ..assembly.loads import MomentArm
from ..assembly.machine import Machine
from ..assembly.muscle_unit import MuscleUnit
from ..assembly.output_names import CONSTANT
from ..assembly.pair_map import NAMES, pair_map
from ..components.paths import resolved
from ..documents import JsonValue
from ..engine import STEP, sampled
from ..engine.native import call_compiled
from ..errors import InputError
from ..muscles.build import rest_length_of
from ..muscles.evidence import about_laws, law_cautions
from ..muscles.plausible import reached_cautions, span_cautions
from ..quantities import random_generator, with_unit
from ..recordings import Channel, Recording
from ..recordings.memory import INTEGRATED, check_memory
from ..recordings.provenance import created, versions
from ..specimens import Specimen, muscle_specimen
from .channels import described
from .hardware.computer import Timing, configure
from .hardware.plant import MOMENT, PRESSURES, RiggedJoint
from .hardware.stand import Encoder
from .rig import Rig
from .rig_file import rig as rig_of
from .segment import CHUNK
from .software.controllers import JointControl, JointSoftware

AXIS = 1.0  # radius at which an encoder's metres are radians [m]
ARM, SPAN = 0.02, 0.126  # of a pair of nylon muscles, whose stroke is 3 cm [m]

Course = float | np.ndarray | Callable[[np.ndarray], Any]
"""A number, its values (n,) at the samples, or a function of their times [s] such as a waveform's `at`."""


@dataclass(frozen=True)
class JointStand:
    """A pair on a joint with the parts of a rig and the controller, ready to run."""

    rig: Rig
    layout: str
    machine: Machine
    encoder: Encoder
    control: JointControl
    specimens: tuple[Specimen | None, Specimen | None] = (None, None)  # of flexor and extensor, where they have one

    def muscles(self) -> Iterator[tuple[str, MuscleUnit, Specimen | None]]:
        """Flexor and extensor by name, each with its specimen, where it has one."""
        return ((n, self.machine.units[n], spec) for n, spec in zip(NAMES, self.specimens, strict=True))

    def plant(self, angle: float) -> RiggedJoint:
        """Build the pair with its converters, at rest at an angle [rad]."""
        load = self.machine.load.replace(start=jnp.asarray(angle, float))
        sensor = self.rig.sensors["pressure"]
        return RiggedJoint(
            machine=self.machine.replace(load=load),
            sensors=dict.fromkeys(PRESSURES.values(), sensor),
            encoder=self.encoder,
            valve_out=self.rig.valve_out,
        )


def joint_stand(
    flexor: MuscleUnit | Specimen | str = "nylon",
    extensor: MuscleUnit | Specimen | str | None = None,
    *,
    rig: Rig | str = "modern",
    layout: str = "direct",
    flexor_arm: MomentArm | None = None,
    extensor_arm: MomentArm | None = None,
    inertia: float = 2e-3,
    joint: Mapping[str, JsonValue] | None = None,
    pressures: tuple[float, float] = (1.4e5, 5e5),
    angles: tuple[float, float] = (-0.5, 0.5),
    gains: Mapping[str, float] | None = None,
) -> JointStand:
    """Build a pair on a joint, with computer, pressure sensors, valves and tubes of a rig, and the map of the pair.

    The muscles pull by cords as those of the test machine (`assembly.build.rig_cord`), unless they are units of one's own.

    Args:
        flexor: turns to positive angles.
        extensor: the same kind where it is left out.
        rig: whose parts are taken: one valve and tube for each muscle.
        layout: name of its plumbing.
        flexor_arm: 2 cm, with a span of 12.6 cm at angle zero, by default.
        extensor_arm: its mirror image by default.
        inertia: about the axis [kg m^2].
        joint: what else `JointLoad` has; 0.01 N m s of damping where it says nothing about it.
        pressures: least and largest gauge pressure of the map [Pa]; the valves go from zero to the largest one.
        angles: first and last of the map [rad].
        gains: gains of `JointControl`, by name.

    Raises:
        InputError: names what does not fit.
    """
    on = rig if isinstance(rig, Rig) else rig_of(rig)
    if "pressure" not in on.sensors:
        raise InputError("rig", on.name, "must be one with a sensor of the pressure")
    if layout not in on.plumbing:
        raise InputError("plumbing", layout, known=on.plumbing, where=on.where)
    parts = on.plumbing[layout]
    bends = flexor_arm or MomentArm(coefficients=jnp.array([ARM]), span=SPAN)
    stretches = extensor_arm or bends.replace(coefficients=-bends.coefficients)
    muscles = flexor, flexor if extensor is None else extensor
    line: dict[str, Any] = {
        "valve": parts.valve,
        "tube": parts.tube,
        "port_volume": float(parts.port_volume),
        "heat": parts.heat,
    }
    machine = antagonist_pair(
        *map(rig_unit, muscles), supply=float(parts.supply_pressure), flexor_arm=bends, extensor_arm=stretches,
        inertia=inertia, joint={"damping": 0.01, "signal": MOMENT, **(joint or {})}, environment=on.environment, **line,
    )  # fmt: skip
    lowest, highest = pressures
    top = min(float(on.valve_out.top), float(parts.supply_pressure))
    if not highest <= top:
        raise InputError("pressures", highest, f"must be at most {top:.6g} Pa, what the valves give", where=on.name)
    control = JointControl(
        pair=pair_map(machine, lowest=lowest, highest=highest, angles=angles),
        motion=on.motion,
        valve=on.pressure.replace(low=0.0, high=highest),
        **(gains or {}),
    )
    if on.encoder is None:
        raise InputError("rig", on.name, "must be one with an encoder")
    encoder = dataclasses.replace(on.encoder, pulley_radius=AXIS)
    named = (muscle_specimen(muscle) if isinstance(muscle, str) else muscle for muscle in muscles)
    first, second = (one if isinstance(one, Specimen) else None for one in named)  # a unit may be of no specimen
    return JointStand(on, layout, machine, encoder, control, (first, second))


def run_joint(
    stand: JointStand,
    *,
    duration: float,
    angle: Course,
    stiffness: Course,
    moment: Course = 0.0,
    active: Course = 1.0,
    sample_rate: float = 1000.0,
    step: float = STEP,
    seed: int = 0,
    title: str = "Angle and stiffness of a joint",
) -> Recording:
    """Control a joint for a time, from rest at the first set-points; the same seed gives the same bits.

    Channels: measured ``angle`` and two pressures; commands, with ``approach.`` the set-points on their way; true ones of
    the joint, both muscles and the air, ``joint.stiffness`` among them. The meta has the accounts under ``balance``, and
    under ``warnings`` what is said of the muscles and of set-points that the map of the pair does not have.

    Args:
        stand: joint stand of the run.
        duration: duration of the run [s].
        angle: set-point [rad].
        stiffness: set-point [N m/rad].
        moment: from outside [N m], positive towards positive angles.
        active: 1 while the angle is fed back, else 0.
        sample_rate: sample rate of the computer [1/s].
        step: largest step of the physics [s].
        seed: seed of the sensors' noise.
        title: title of the recording.

    Raises:
        InputError: names the set-point that has no number for a sample or is beyond a stop, or the rate that the computer
            cannot do.
        ConvergenceError: if the physics failed; says why.
    """
    rig = stand.rig
    dead = float(rig.plumbing[stand.layout].valve.delay() or 0.0)
    timing = configure(rig.computer, sample_rate, dead_time=dead, step=step)
    courses = {"angle": angle, "stiffness": stiffness, "moment": moment, "active": active}
    time, set_points = _clocked(courses, duration, timing.period)
    said = _set_point_cautions(stand, set_points)
    begin = {n: float(v[0]) for n, v in set_points.items()}
    plant = stand.plant(begin["angle"])
    software = JointSoftware(stand.control, jnp.asarray(begin["angle"]), jnp.asarray(begin["stiffness"]))
    point = stand.control.pair.at(begin["angle"], begin["stiffness"])
    common, difference = float(point.common), float(point.difference)
    commands = {"flexor": common + difference, "extensor": common - difference, "moment": begin["moment"]}
    start = plant.at_rest(commands, {node: commands[n] for n in NAMES for node in (n, f"{n}.port")})
    # rows of every sample up to the end of the last chunk, where the last set-points stay
    whole, channels = CHUNK * math.ceil(len(time) / CHUNK), list(PRESSURES.values())
    draws = random_generator(seed).standard_normal((len(channels), whole))
    rows: Any = {n: np.concatenate([v, np.full(whole - len(time), v[-1])]) for n, v in set_points.items()}
    rows |= {"draws": dict(zip(channels, draws, strict=True))}
    row = jax.tree.map(lambda v: v[0], rows)
    carry = call_compiled(sampled.begin, plant, software, start, commands, row, depth=timing.depth)
    first = call_compiled(sampled.inputs_of, plant, carry, timing.latency, timing.period)
    parts, finest = [], timing.inner
    for k in range(0, len(rows["angle"]), CHUNK):
        chunk = jax.tree.map(lambda v, k=k: v[k : k + CHUNK], rows)
        carry, results, inner = sampled.advance(
            plant, software, carry, chunk, period=timing.period, inner=timing.inner, latency=timing.latency
        )
        parts.append(results)
        finest = max(finest, inner)
    last = call_compiled(sampled.inputs_of, plant, carry, timing.latency, timing.period)
    ended: Any = carry._replace(state=carry.state["machine"])
    closed = accounts(plant.machine, (start[0]["machine"], start[1]), ended, first, last)
    results = jax.tree.map(lambda *v: np.concatenate(v)[: len(time)], *parts)
    about = _about(stand, plant, timing, closed, seed) | {"title": title}
    about["timing"]["step"] = timing.period / finest
    for name, unit, spec in stand.muscles():
        lengths, gauges = results.outputs[f"{name}.length"], results.outputs[f"{name}.pressure"]
        said += reached_cautions(lengths, gauges, unit.law, spec, name)
    about["warnings"] = [one.text for one in collect(*said)]
    return Recording(time, _channels(results, len(time)), about)


def _set_point_cautions(stand: JointStand, set_points: Mapping[str, np.ndarray]) -> list[Caution]:
    """Cautions about muscles and set-points that the map of the pair does not have.

    Raises:
        InputError: an angle is beyond a stop, or one at the start is none that a muscle can take.
    """
    load: Any = stand.machine.load
    pair = stand.control.pair
    angles, wanted = set_points["angle"], set_points["stiffness"]
    stops = float(load.lower_stop), float(load.upper_stop)
    said: list[Caution] = []
    for name, values, (low, high), hard in (
        ("angle", angles, stops, True),
        ("angle", angles, (float(pair.angles[0]), float(pair.angles[-1])), False),
        ("stiffness", wanted, jax.vmap(pair.stiffness_range)(angles), False),
    ):
        far = np.maximum(np.asarray(low) - values, values - np.asarray(high))
        at = int(np.argmax(far))
        if not far[at] > 0.0:
            continue
        unit = JOINT[f"command.{name}"][0]
        ends = (float(np.broadcast_to(end, values.shape)[at]) for end in (low, high))
        shown, most = with_unit(float(values[at]), unit), " to ".join(with_unit(end, unit) for end in ends)
        if hard:
            raise InputError(name, shown, f"must be within the stops, {most}")
        holds = f"the pressures of its end are fed forward{', and the feedback does the rest' * (name == 'angle')}"
        where = f" at {with_unit(float(angles[at]), 'rad')}" * (name == "stiffness")
        said.append(Caution(f"a set-point of {shown} is beyond the map of the pair, {most}{where}: {holds}", name))
    start = load.spans(load.initial()._replace(angle=angles[0]), {})
    for muscle, held, spec in stand.muscles():
        called = f"span of {muscle} at the first angle of {with_unit(float(angles[0]), 'rad')}"
        said += span_cautions(float(start[muscle].span), held.law, rest_length_of(spec, held.law), spec, name=called)
        said += law_cautions(spec, held.law)
    return said


def _clocked(courses: Mapping[str, Course], duration: float, period: float) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    if not (math.isfinite(duration) and duration >= period):
        raise InputError("duration", duration, f"must be a time of at least one sample, {period:g} s")
    check_memory(duration, period, bytes_per_sample=INTEGRATED)
    time = period * np.arange(round(duration / period) + 1)
    sampled = {}
    for name, course in courses.items():
        values = np.asarray(course(time) if callable(course) else course, float)
        if values.shape not in ((), time.shape):
            raise InputError(name, None, f"must be a number or {len(time)} values, got shape {values.shape}")
        if not np.isfinite(values).all():
            raise InputError(name, None, "must be a finite number for every sample")
        sampled[name] = np.broadcast_to(values, time.shape)
    return time, sampled


# unit and meaning of what a joint has and other test machines have not
JOINT = {
    "angle": ("rad", "measured", "angle of the joint by the encoder, measured"),
    "flexor_pressure": ("Pa", "measured", "gauge pressure in the flexor, measured"),
    "extensor_pressure": ("Pa", "measured", "gauge pressure in the extensor, measured"),
    "command.angle": ("rad", "command", "set-point of the angle"),
    "command.stiffness": ("N*m/rad", "command", "set-point of the stiffness"),
    "approach.angle": ("rad", "command", "set-point of the angle on its way"),
    "approach.stiffness": ("N*m/rad", "command", "set-point of the stiffness on its way, within its range"),
    "command.flexor_pressure": ("Pa", "command", "gauge pressure that the flexor shall have"),
    "command.extensor_pressure": ("Pa", "command", "gauge pressure that the extensor shall have"),
    "loop.active": ("1", "command", "1 while the angle is fed back"),
    "flexor.valve.command": ("Pa", "command", "pressure asked of the flexor's valve"),
    "extensor.valve.command": ("Pa", "command", "pressure asked of the extensor's valve"),
    "moment.command": ("N*m", "command", "moment from outside"),
    "joint.angle": ("rad", "true", "angle of the joint"),
    "joint.velocity": ("rad/s", "true", "angular velocity of the joint"),
    "joint.moment": ("N*m", "true", "moment of both muscles"),
    "joint.stiffness": ("N*m/rad", "true", "stiffness of the joint against a slow push, friction relaxed"),
    "joint.quick_stiffness": ("N*m/rad", "true", "stiffness against a short, quick push, air shut in"),
}
RENAMED = {"load.angle": "joint.angle", "load.angular_velocity": "joint.velocity", "load.moment": "joint.moment"}


def _channels(results: Any, count: int) -> dict[str, Channel]:
    arrays = {n: v for n, v in results.measured.items() if not n.endswith(".code")} | dict(results.shown)
    arrays |= {f"{n}.command": v for n, v in results.commands.items()}
    arrays |= {RENAMED.get(n, n): v for n, v in results.outputs.items() if not n.startswith(CONSTANT)}
    channels = {}
    for name in sorted(arrays, key=lambda n: (list(JOINT).index(n) if n in JOINT else len(JOINT), n)):
        unit, meaning = described(name)
        known = JOINT.get(name, (unit, "true", meaning))
        channels[name] = Channel(np.broadcast_to(arrays[name], (count,)), *known)
    return channels


def _about(stand: JointStand, plant: RiggedJoint, timing: Timing, closed: Accounts, seed: int) -> dict[str, JsonValue]:
    rig, room = stand.rig, stand.rig.environment
    cites = [key for unit in plant.machine.units.values() for key in unit.law.cites]
    owners = {"machine": plant.machine, "control": stand.control}
    return {
        "rig": rig.name,
        "plumbing": stand.layout,
        "parameters": resolved(owners),
        **about_laws({name: (spec, unit.law) for name, unit, spec in stand.muscles()}),
        "mounting": {name: unit.mounting for name, unit in stand.machine.units.items()},
        "inferred": list(rig.inferred),
        "environment": {"pressure_abs": float(room.pressure_abs), "temperature": float(room.temperature)},
        "balance": {name: float(getattr(closed, name)) for name in CLOSED},
        "friction": {"work": closed.friction, "dissipated": closed.dissipated},
        "energy": document(plant.machine, [closed.energy_parts]),
        "timing": {"control_rate": timing.sample_rate, "latency": timing.latency},
        "seed": seed,
        "result": "done",
        "message": "The run reached its end.",
        "versions": versions(),
        "citations": list(dict.fromkeys(cites)),
        "created": created(),
    }
