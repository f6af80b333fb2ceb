"""Protocols on a biological muscle, as on a McKibben muscle in a test machine.

A protocol with stimulation states the excitation itself. Of a protocol for McKibben muscles the set-point of the pressure
over the full pressure is the excitation; span is span, and a tension that the motor holds is a load. There is no valve and
no tube: the way from excitation to activation is the muscle's own. While the span is commanded the muscle follows it
exactly,

    da/dt = rate(a, u)                                      T = muscle(span, a, d span/dt)

and while a tension is held its end carries a mass that is so small that a change of velocity takes about `SETTLE`:

    da/dt = rate(a, u),   dL/dt = v,   m dv/dt = load - muscle(L, a, v),   m = F0 SETTLE / (vmax L0)

Not modelled: the machine's own dynamics, and cross-bridges, whose elasticity a real quick release shows first. Activation
is of first order: the tension of a twitch begins to fall as soon as the excitation ends, earlier than that of a real muscle.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple, cast

import numpy as np

from .. import citations
from .._jax import Tree, jax, jnp
from ..components import Scalar
from ..components.paths import declaration, put, resolved
from ..components.system import Moment, System, Value
from ..documents import JsonValue
from ..engine import held, integrate, ramped
from ..errors import InputError
from ..experiments import read
from ..experiments.amounts import TEST_START, TESTS, advance_test
from ..experiments.commands import Deferred
from ..experiments.protocol import PlannedStep, Protocol
from ..muscles import Muscle
from ..muscles.biological import BiologicalMuscle
from ..muscles.muscle import from_specimen
from ..quantities import parse, quantity
from ..recordings import Channel, Recording
from ..recordings.provenance import created, versions
from ..specimens import Specimen, muscle_specimen
from .prepare import changes_by_owner

SETTLE = 1e-3  # [s]
STEP = 1e-4  # largest step of the integration [s]
FULL_PRESSURE = 5e5  # set-point that stands for full excitation where a protocol commands pressures [Pa]


class BiologicalSubject(NamedTuple):
    """A biological muscle to run: its equations, and its specimen if it has one."""

    muscle: BiologicalMuscle
    specimen: Specimen | None


def biological_subject(muscle: object, *, law: str | None = None) -> BiologicalSubject | None:
    """The biological muscle that a name, file, specimen or `Muscle` stands for; None if it stands for another kind.

    Raises:
        InputError: there is no such specimen, or it does not state the law.
    """
    if isinstance(muscle, BiologicalMuscle):
        return BiologicalSubject(muscle, None)
    if isinstance(muscle, Muscle):
        return BiologicalSubject(cast(Any, muscle.law), muscle.specimen) if muscle.is_biological else None
    if not isinstance(muscle, str | os.PathLike | Specimen):
        return None
    spec = muscle if isinstance(muscle, Specimen) else muscle_specimen(muscle)
    return BiologicalSubject(from_specimen(spec, law), spec) if spec.kind == "biological" else None


def run_biological(
    protocol: Protocol | str | os.PathLike[str],
    subject: BiologicalSubject,
    *,
    full_pressure: float = FULL_PRESSURE,
    **values: JsonValue,
) -> Recording:
    """Run a protocol on a biological muscle and record it, with what a report needs.

    Args:
        protocol: a protocol, the name of a shipped one, or the path of a ``.toml`` file.
        subject: the muscle.
        full_pressure: set-point that stands for full excitation where the protocol commands pressures [Pa].
        **values: of the protocol's parameters: numbers [SI], text with a unit, or lists of them for one case after another.

    Raises:
        InputError: names what is unknown, or what only a test machine has.
    """
    wanted = read.named_protocol(protocol, values)
    spec = subject.specimen
    record = fibre_run(subject.muscle, wanted, full_pressure=full_pressure, name="" if spec is None else spec.id)
    sources = [*subject.muscle.cites, *(spec.sources if spec else ())]
    sources += [key for key in citations.known_keys() if key in wanted.source]
    stimulated = "stimulator" in wanted.required()
    more: dict[str, JsonValue] = {
        "sentence": wanted.sentence(),
        "message": "The run reached its end.",
        "events": [],
        "warnings": [],
        "inferred": spec.inferred() if spec else [],
        "citations": list(dict.fromkeys(sources)),
        "versions": versions(),
        "created": created(),
        "parameters": {f"units.muscle.law.{path}": one for path, one in resolved(subject.muscle).items()},
        "maximum_tension": float(subject.muscle.maximum_tension),
        **({} if stimulated else {"full_pressure": full_pressure}),
    }
    return Recording(record.time, dict(record.channels), {**record.meta, **more})


def changed_biological(
    protocol: Protocol | str | os.PathLike[str], subject: BiologicalSubject, changes: Mapping[str, float | str]
) -> tuple[Protocol, BiologicalSubject]:
    """A protocol and a biological muscle with changes by path, as `bench.prepare.prepare` has them of a test machine."""
    of_rig, of_muscle, of_protocol = changes_by_owner(changes)
    for path, value in of_rig.items():
        problem = "is of a test machine; a biological muscle runs without one"
        raise InputError(f"changes.rig.{path}", value, problem)
    values = {}
    for path, value in of_muscle.items():
        declared, field = declaration(subject.muscle, path.removeprefix("law.")), f"changes.muscle.{path}"
        number = parse(value, declared.unit, field=field) if isinstance(value, str) else value
        declared.check(field, number)
        values[path.removeprefix("law.")] = number
    wanted = read.changed_protocol(protocol, of_protocol)
    return wanted, subject._replace(muscle=put(subject.muscle, values))


def check_protocol(muscle: BiologicalMuscle, protocol: Protocol) -> None:
    """Refuse a protocol that asks a biological muscle for something that only a machine has; raises `InputError`."""
    for group in _groups(protocol.expand(rest_length=float(muscle.rest_length)).steps):
        for step in group:
            if step.until is not None and step.until.channel not in ("span", "tension", "velocity"):
                raise _unknown_condition(step)


class FibreState(NamedTuple):
    """Activation [1]; of a muscle that carries a load its length [m] and velocity [m/s] too."""

    activation: Scalar
    length: Scalar
    velocity: Scalar


class _Fibre(System):
    muscle: BiologicalMuscle

    def integrands(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Tree:
        """Return no integrands."""
        return ()

    def advance_memory(self, memory: Tree, start: Moment, end: Moment, duration: Scalar) -> Tree:
        """Return no memory."""
        return memory

    def _activate(self, state: FibreState, inputs: Mapping[str, Value]) -> Scalar:
        return self.muscle.activation_rate(state.activation, inputs["drive"].value)

    def _seen(self, state: FibreState, length: Scalar, velocity: Scalar, inputs: Mapping[str, Value]) -> dict[str, Any]:
        tension = self.muscle.tension(length, state.activation, velocity)
        named = {"span": length, "tension": tension, "velocity": velocity, "activation": state.activation}
        return {name: value + jnp.zeros(()) for name, value in named.items()} | {"drive": inputs["drive"].value}


class HeldFibre(_Fibre):
    """A fibre with a commanded span: input ``span`` [m] beside ``drive`` [1]."""

    def rate(self, state: FibreState, memory: Tree, inputs: Mapping[str, Value]) -> FibreState:
        """Rate of change of the activation."""
        return FibreState(self._activate(state, inputs), jnp.zeros(()), jnp.zeros(()))

    def outputs(self, state: FibreState, memory: Tree, inputs: Mapping[str, Value]) -> dict[str, Scalar]:
        """Span, tension, velocity, activation and drive."""
        return self._seen(state, inputs["span"].value, inputs["span"].rate, inputs)


class LoadedFibre(_Fibre):
    """A fibre that carries a tension: input ``load`` [N] beside ``drive`` [1]."""

    mass: Scalar = quantity("kg", (1e-12, 1e3), "mass at the moving end", symbol="m")

    def rate(self, state: FibreState, memory: Tree, inputs: Mapping[str, Value]) -> FibreState:
        """Rates of change of activation, length and velocity."""
        pull = self.muscle.tension(state.length, state.activation, state.velocity)
        return FibreState(self._activate(state, inputs), state.velocity, (inputs["load"].value - pull) / self.mass)

    def outputs(self, state: FibreState, memory: Tree, inputs: Mapping[str, Value]) -> dict[str, Scalar]:
        """Span, tension, velocity, activation and drive."""
        return self._seen(state, state.length, state.velocity, inputs)


def fibre_run(muscle: BiologicalMuscle, protocol: Protocol, *, full_pressure: float, name: str = "") -> Recording:
    """Run a protocol on a biological muscle and record it.

    Args:
        muscle: the tested muscle; its rest length is the protocol's ``L0``.
        protocol: with stimulation, or as for a test machine; it may command span and tension.
        full_pressure: set-point that stands for full excitation [Pa].
        name: id of its specimen, for the recording.

    Returns:
        Channels ``span`` [m] and ``tension`` [N] of ideal sensors, ``excitation`` [1], and of the muscle itself
        ``muscle.length`` [m], ``muscle.tension`` [N], ``velocity`` [m/s] and ``activation`` [1] in the recorded steps, which
        the metadata lists as a test machine does.

    Raises:
        InputError: the protocol asks for something that only a machine has.
    """
    rest = float(muscle.rest_length)
    plan = protocol.expand(rest_length=rest)
    period = 1.0 / plan.sample_rate
    mass = float(muscle.maximum_tension) * SETTLE / (float(muscle.maximum_velocity) * rest)
    loaded, held_end = LoadedFibre(muscle=muscle, mass=mass), HeldFibre(muscle=muscle)
    state = FibreState(jnp.zeros(()), jnp.asarray(plan.steps[0].span.low), jnp.zeros(()))
    listed, parts, time, pulled = [], [], 0.0, 0.0
    stimulated = any(s.step.stimulation is not None for s in plan.steps)
    for group in _groups(plan.steps):
        drive = np.concatenate([_drive(s, full_pressure, stimulated) for s in group])
        motor = np.concatenate([_motor(s, float(state.length), pulled, period) for s in group])
        mode, count = group[0].mode, len(drive)
        system: System = held_end if mode == "span" else loaded
        end = np.append(drive, drive[-1])
        goal = np.append(motor, _following(plan.steps, group[-1], motor))
        inputs = {"drive": held(end)} | ({"span": ramped(goal)} if mode == "span" else {"load": held(goal)})
        # a group that a test ends keeps its full length here, so that equal cases are compiled once
        outputs = integrate(system, state, inputs, period=period, step_size=min(STEP, period)).outputs
        last = _ends(group[-1], outputs, rest, period) if group[-1].until is not None else count
        state = FibreState(*(jnp.asarray(outputs[n][last]) for n in ("activation", "span", "velocity")))
        pulled = float(outputs["tension"][last])
        first = 0
        for step in group:
            stop = min(first + step.count, last)
            listed.append(step.entry(time + first * period, time + stop * period))
            if step.record:
                parts.append((time + period * np.arange(first, stop), {n: v[first:stop] for n, v in outputs.items()}))
            first = stop
        time += last * period
    return _recording(parts, listed, protocol, name, rest)


def _groups(steps: Sequence[PlannedStep]) -> Iterator[list[PlannedStep]]:
    """Group steps that can be integrated in one piece: known spans without a test; else one at a time."""
    group: list[PlannedStep] = []
    for step in steps:
        if step.mode not in ("span", "tension"):
            raise InputError(
                f"{step.path}.{step.mode}", None, "cannot be commanded: a biological muscle follows span or tension"
            )
        if step.pressure is None:
            raise InputError(f"{step.path}.pressure", None, "cannot be shut off: a biological muscle has no gas")
        alone = step.mode != "span" or step.until is not None or isinstance(step.motor, Deferred)
        if alone and group:
            yield group
            group = []
        if alone:
            yield [step]
        else:
            group.append(step)
    if group:
        yield group


def _drive(step: PlannedStep, full: float, stimulated: bool) -> np.ndarray:
    channel, values = ("stimulation", step.stimulation) if stimulated else ("pressure", step.pressure)
    if not isinstance(values, np.ndarray):
        raise InputError(f"{step.path}.{channel}", None, "must be stated again after a step that a test may end")
    return np.asarray(values if stimulated else values / full)


def _motor(step: PlannedStep, length: float, pulled: float, period: float) -> np.ndarray:
    if isinstance(step.motor, np.ndarray):
        return step.motor
    return np.asarray(step.motor.at(length if step.mode == "span" else pulled, period * np.arange(step.count)))


def _following(steps: Sequence[PlannedStep], last: PlannedStep, motor: np.ndarray) -> float:
    """Set-point at the end of a group: the start of the next step of the same kind; after all steps a line goes on."""
    if last.index >= len(steps):
        return float(2.0 * motor[-1] - motor[-2]) if len(motor) > 1 else float(motor[-1])
    after = steps[last.index]
    if after.mode != last.mode or not isinstance(after.motor, np.ndarray):
        return float(motor[-1])
    return float(after.motor[0])


def _unknown_condition(step: PlannedStep) -> InputError:
    assert step.until is not None
    demand = "must be span, tension or velocity for a biological muscle"
    return InputError(f"{step.path}.until", step.until.channel, demand)


def _ends(step: PlannedStep, readings: dict[str, Any], rest: float, period: float) -> int:
    """Sample at which the condition of a step ends it; the last one if it never does."""
    test = step.until
    assert test is not None
    if test.channel not in readings:
        raise _unknown_condition(step)
    kind, limit = TESTS.index(test.kind), test.amount.si(rest)

    def one(state: Tree, x: Scalar) -> tuple[Tree, Tree]:
        advanced: tuple[Tree, Tree] = advance_test(kind, state, x, limit, test.lasting, x, period)
        return advanced

    _, holds = jax.lax.scan(one, tuple(jnp.asarray(x) for x in TEST_START), jnp.asarray(readings[test.channel]))
    samples = np.flatnonzero(np.asarray(holds)[: step.count])
    return max(int(samples[0]), 1) if samples.size else step.count


# Channels: the output that they hold, unit, kind and meaning. Sensors are ideal.
_CHANNELS = {
    "span": ("span", "m", "measured", "length between the anchors, of an ideal sensor"),
    "tension": ("tension", "N", "measured", "tension, of an ideal sensor"),
    "excitation": ("drive", "1", "true", "excitation, share of each sample"),
    "activation": ("activation", "1", "true", "activation"),
    "muscle.length": ("span", "m", "true", "length of the muscle"),
    "muscle.tension": ("tension", "N", "true", "tension of the muscle"),
    "velocity": ("velocity", "m/s", "true", "rate of the length"),
}


def _recording(parts: list[Any], listed: list[dict[str, Any]], protocol: Protocol, name: str, rest: float) -> Recording:
    time = np.concatenate([t for t, _ in parts])
    channels = {
        name: Channel(np.concatenate([outputs[of] for _, outputs in parts]), unit, kind, meaning)
        for name, (of, unit, kind, meaning) in _CHANNELS.items()
    }
    meta = {
        "title": protocol.title,
        "protocol": protocol.document(),
        "digest": protocol.digest,
        "specimen": name,
        "rest_length": rest,
        "steps": listed,
        "result": "done",
    }
    return Recording(time, channels, meta)
