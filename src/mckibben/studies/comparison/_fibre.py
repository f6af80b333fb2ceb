"""Protocols on a biological muscle, as on a McKibben muscle in a test machine.

The mapping: the set-point of the pressure over the full pressure is the excitation, span is span, and a tension that the
motor holds is a load. There is no valve and no tube: the way from excitation to activation is the muscle's own. While the
span is commanded the muscle follows it exactly,

    da/dt = rate(a, u)                                      T = muscle(span, a, d span/dt)

and while a tension is held its end carries a mass that is so small that a change of velocity takes about `SETTLE`:

    da/dt = rate(a, u),   dL/dt = v,   m dv/dt = load - muscle(L, a, v),   m = F0 SETTLE / (vmax L0)

Not modelled: the machine's own dynamics, and cross-bridges, whose elasticity a real quick release shows first.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..._jax import Tree, jax, jnp
from ...components import Scalar
from ...components.system import Moment, System, Value
from ...documents import JsonValue
from ...engine import held, integrate, ramped
from ...errors import InputError
from ...experiments.commands import Deferred
from ...experiments.plan import PlannedStep
from ...experiments.protocol import Protocol
from ...experiments.until import KINDS, START, advance
from ...muscles.biological import BiologicalMuscle
from ...quantities import quantity
from ...recordings import Channel, Recording

SETTLE = 1e-3  # [s]
STEP = 1e-4  # largest step of the integration [s]


class FibreState(NamedTuple):
    """Activation [1]; of a muscle that carries a load its length [m] and velocity [m/s] too."""

    activation: Scalar
    length: Scalar
    velocity: Scalar


class _Fibre(System):
    """Common part of fibres whose end is held in two ways."""

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
        protocol: as for a test machine; it may command span and tension.
        full_pressure: set-point that stands for full excitation [Pa].
        name: id of its specimen, for the recording.

    Returns:
        Channels ``span`` [m], ``tension`` [N], ``velocity`` [m/s], ``activation`` and ``drive`` [1] of the recorded steps,
        which the metadata lists as a test machine does.

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
    for group in _groups(plan.steps):
        drive = np.concatenate([_drive(s, full_pressure) for s in group])
        motor = np.concatenate([_motor(s, float(state.length), pulled, period) for s in group])
        mode, count = group[0].mode, len(drive)
        system: System = held_end if mode == "span" else loaded
        end = np.append(drive, drive[-1])
        goal = np.append(motor, _following(plan.steps, group[-1], motor[-1]))
        inputs = {"drive": held(end)} | ({"span": ramped(goal)} if mode == "span" else {"load": held(goal)})
        # a group that a test ends keeps its full length here, so that equal cases are compiled once
        outputs = integrate(system, state, inputs, period=period, step_size=min(STEP, period)).outputs
        last = _ends(group[-1], outputs, rest, period) if group[-1].until is not None else count
        state = FibreState(*(jnp.asarray(outputs[n][last]) for n in ("activation", "span", "velocity")))
        pulled = float(outputs["tension"][last])
        first = 0
        for step in group:
            stop = min(first + step.count, last)
            listed.append(_listed(step, time + first * period, time + stop * period))
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


def _drive(step: PlannedStep, full: float) -> np.ndarray:
    assert isinstance(step.pressure, np.ndarray)  # nothing but a person's hand makes a pressure unknown beforehand
    return step.pressure / full


def _motor(step: PlannedStep, length: float, pulled: float, period: float) -> np.ndarray:
    if isinstance(step.motor, np.ndarray):
        return step.motor
    return np.asarray(step.motor.at(length if step.mode == "span" else pulled, period * np.arange(step.count)))


def _following(steps: Sequence[PlannedStep], last: PlannedStep, value: float) -> float:
    """Set-point at the end of a group: the start of the next step of the same kind."""
    after = steps[last.index] if last.index < len(steps) else None
    if after is None or after.mode != last.mode or not isinstance(after.motor, np.ndarray):
        return float(value)
    return float(after.motor[0])


def _ends(step: PlannedStep, seen: dict[str, Any], rest: float, period: float) -> int:
    """Sample at which the condition of a step ends it; the last one if it never does."""
    test = step.until
    assert test is not None
    if test.channel not in seen:
        raise InputError(
            f"{step.path}.until", test.channel, "must be span, tension or velocity for a biological muscle"
        )
    kind, limit = KINDS.index(test.kind), test.amount.si(rest)

    def one(state: Tree, x: Scalar) -> tuple[Tree, Tree]:
        return advance(kind, state, x, limit, test.lasting, x, period)

    _, holds = jax.lax.scan(one, tuple(jnp.asarray(x) for x in START), jnp.asarray(seen[test.channel]))
    samples = np.flatnonzero(np.asarray(holds)[: step.count])
    return max(int(samples[0]), 1) if samples.size else step.count


def _listed(step: PlannedStep, start: float, end: float) -> dict[str, JsonValue]:
    case = {k: v if isinstance(v, str) else str(v) for k, v in step.case.items()}
    return {
        "index": step.index,
        "path": step.path,
        "label": step.step.label,
        "case": case,
        "start": start,
        "end": end,
        "ended_by": "time",
        "recorded": step.record,
        "sentence": step.step.sentence(),
    }


_UNITS = {
    "span": ("m", "length between the anchors"),
    "tension": ("N", "tension"),
    "velocity": ("m/s", "rate of the span"),
    "activation": ("1", "activation"),
    "drive": ("1", "excitation"),
}


def _recording(parts: list[Any], listed: list[dict[str, Any]], protocol: Protocol, name: str, rest: float) -> Recording:
    time = np.concatenate([t for t, _ in parts])
    channels = {
        n: Channel(np.concatenate([c[n] for _, c in parts]), unit, "command" if n == "drive" else "true", meaning)
        for n, (unit, meaning) in _UNITS.items()
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
