"""Simulation of a machine and its software on one clock: the software acts once per sample.

`sample` is one sample as a pure function. A simulation scans it, a loop by the wall clock calls it. Commands are held; they
act `latency` after the sample that computed them, and parts with dead time see them later still: a short history of each
command is kept on the sample clock, of which every step sees the mean over itself (see `Signal.within`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from .._jax import Scalar, Tree, jax, jnp
from ..components.module import map_leaves
from ..components.system import Plant, Software
from ..errors import ConvergenceError
from .integration import MOST_PARTS, ROS2_LIMIT
from .native import call_compiled
from .rates import RK4_LIMIT
from .signals import Signal, Value
from .soundness import PLACING, SOUND, SWITCHED, Soundness, overloaded_parts, possible, unsound_sentence
from .step import Integrands, integrands_of, step, zero_integrals

MOST_BLIND = 64  # parts of a step that are tried where the system no longer says how many it needs
MOST_SPLIT = 8  # parts of a step up to which Runge-Kutta is cheaper than the stiff method
MOST_HALVED = 64  # parts of a step that are tried where a balance does not close


class Carry(NamedTuple):
    """State that is passed from one sample to the next.

    Attributes:
        state: state of the plant.
        memory: memory of the plant.
        integrals: independent integrals of the plant since the start.
        software: state of the software.
        history: history of each input, oldest first, (n,); the last one is the newest command.
    """

    state: Any
    memory: Any
    integrals: Any
    software: Any
    history: dict[str, Any]


class SampleResult(NamedTuple):
    """Result of a sample: true, measured, commanded and reported values.

    Attributes:
        outputs: outputs of the plant, true.
        measured: channels that the software saw.
        commands: inputs that its commands became.
        shown: by the software.
        rate_bound: the plant's own bound of its fastest mode [1/s].
        sound: whether the state can be at all and is finite (bool).
    """

    outputs: dict[str, Any]
    measured: dict[str, Any]
    commands: dict[str, Any]
    shown: dict[str, Any]
    rate_bound: Any
    sound: Any


def begin(
    plant: Plant, software: Software, start: tuple[Tree, Tree], commands: Mapping[str, float], row: Tree, depth: int
) -> Carry:
    """State at the first sample.

    Args:
        plant: the machine.
        software: the software that commands it.
        start: state and memory of the plant.
        commands: by name, in force until the first sample's act [SI].
        row: as the first sample's.
        depth: depth of the history, in samples: enough for latency and dead times, at least 2.
    """
    return with_software(plant, software, rest(plant, start, commands, depth), row)


def with_software(plant: Plant, software: Software, carry: Carry, row: Tree) -> Carry:
    """A machine at rest with the software that is to command it, at the first sample's row."""
    now = _inputs(plant, carry.history, 0.0, 1.0, 1.0)
    return carry._replace(software=software.initial(plant.sense(carry.state, carry.memory, now, row)))


def rest(plant: Plant, start: tuple[Tree, Tree], commands: Mapping[str, Scalar], depth: int) -> Carry:
    """State at the first sample of a machine that is commanded from outside; see `begin`."""
    history = {name: jnp.full((depth,), value) for name, value in plant.convert(commands).items()}
    now = _inputs(plant, history, 0.0, 1.0, 1.0)
    sums = zero_integrals(plant, *start, now)
    return Carry(*start, sums, (), history)


class Observation(NamedTuple):
    """A plant at a sample: true outputs, its bound of the fastest mode [1/s], and whether its state can be (bool)."""

    outputs: dict[str, Any]
    rate_bound: Any
    sound: Any


def observe(
    plant: Plant, carry: Carry, row: Tree, *, period: Scalar, latency: Scalar | None
) -> tuple[dict[str, Scalar], Observation]:
    """Measure a sample: values for the software, and values of the plant to record."""
    now = _inputs(plant, carry.history, latency, 1.0, period)
    outputs = plant.outputs(carry.state, carry.memory, now)
    look = Observation(
        outputs,
        plant.max_rate_bound(carry.state, carry.memory, now),
        possible(plant, carry.state, carry.memory) & jnp.logical_not(plant.broken(outputs)),
    )
    return plant.sense(carry.state, carry.memory, now, row), look


def act(
    plant: Plant,
    carry: Carry,
    commands: Mapping[str, Scalar],
    *,
    period: Scalar,
    inner: Scalar,
    latency: Scalar | None,
    stiff: bool,
    integrands: Integrands = integrands_of,
) -> tuple[Carry, dict[str, Scalar]]:
    """New commands to the converters, and the physics until the next sample: the carry, and what the converters hold."""
    newest = plant.convert(commands)
    history = {name: jnp.append(past[1:], newest[name]) for name, past in carry.history.items()}
    signals = _signals(plant, history, latency)
    last = len(next(iter(history.values()))) - 1
    h = period / inner

    def one(i: Any, physics: Any) -> Any:
        first, then = i / inner, (i + 1) / inner

        def inputs(share: Scalar) -> dict[str, Tree]:
            return {n: s.within(last, first, then, share, period) for n, s in signals.items()}

        return step(plant, physics, inputs, h, stiff, integrands)

    state, memory, sums = jax.lax.fori_loop(0, inner, one, (carry.state, carry.memory, carry.integrals))
    return Carry(state, memory, sums, carry.software, history), newest


def sample(
    plant: Plant,
    software: Software,
    carry: Carry,
    row: Tree,
    *,
    period: Scalar,
    inner: Scalar,
    latency: Scalar | None,
    stiff: bool,
) -> tuple[Carry, SampleResult]:
    """Compute one sample, and the physics until the next one.

    Args:
        plant: the machine.
        software: the software that commands it.
        carry: from the sample before.
        row: what the sample brings from outside.
        period: period of the samples [s].
        inner: whole steps of the physics per sample.
        latency: from a sample to the action of its commands [s]; None for none at all.
        stiff: use the Rosenbrock method.
    """
    measured, look = observe(plant, carry, row, period=period, latency=latency)
    software_state, commands, shown = software.step(carry.software, measured, row, period)
    after, newest = act(plant, carry, commands, period=period, inner=inner, latency=latency, stiff=stiff)
    return after._replace(software=software_state), SampleResult(
        look.outputs, measured, newest, shown, look.rate_bound, look.sound
    )


def march(
    plant: Plant,
    software: Software,
    carry: Carry,
    rows: Tree,
    period: Scalar,
    inner: Scalar,
    latency: Scalar | None,
    stiff: bool,
) -> tuple[Carry, SampleResult]:
    """Compute many samples, one per row: the carry afterwards, and the result of every sample."""

    def one(carry: Carry, row: Tree) -> tuple[Carry, SampleResult]:
        return sample(plant, software, carry, row, period=period, inner=inner, latency=latency, stiff=stiff)

    return jax.lax.scan(one, carry, rows)


class Steps(NamedTuple):
    """Integration steps: number of parts of each usual step, and whether by the stiff method."""

    split: int = 1
    stiff: bool = False

    def short(self, fastest: float, usual: float) -> bool:
        """Whether a mode [1/s] allows them; `usual` is the step before it is split [s]. NaN allows none."""
        return fastest * usual / self.split <= (ROS2_LIMIT if self.stiff else RK4_LIMIT) * (1.0 + 1e-9)

    def shorter(self, fastest: float, usual: float) -> Steps | None:
        """Shorter steps to try next, for a mode that may be unknown (not finite); None if no step is short enough."""
        known = math.isfinite(fastest)
        if self.split >= (MOST_PARTS if known else MOST_BLIND):
            return None
        explicit = math.ceil(fastest * usual / RK4_LIMIT) if known else 2 * self.split
        if not self.stiff and explicit <= MOST_SPLIT:
            return Steps(max(explicit, self.split + 1), False)
        wanted = math.ceil(fastest * usual / ROS2_LIMIT) if known else 2 * self.split
        return Steps(min(max(wanted, self.split + 1 if self.stiff else 1), MOST_PARTS), True)

    def after(self, fastest: float, code: float, usual: float) -> Steps | None:
        """Steps for a sample that was taken with these: the same if it stands, else those with which to repeat it.

        Args:
            fastest: bound of the fastest mode at its end [1/s].
            code: its soundness.
            usual: the step before it is split [s].

        Returns:
            None where no step is short enough: a mode is too fast, or halving the step does not help.
        """
        if not self.short(fastest, usual):
            return self.shorter(fastest, usual)
        if code == SOUND or (code == SWITCHED and self.split >= PLACING):
            return self
        if code == SWITCHED:
            return self._replace(split=PLACING)
        return self._replace(split=2 * self.split) if 2 * self.split <= MOST_HALVED else None


def advance(
    plant: Plant, software: Software, carry: Carry, rows: Tree, *, period: float, inner: int, latency: float
) -> tuple[Carry, SampleResult, int]:
    """Many samples with steps that the plant's own rates allow.

    Conservation does not show an unstable step that a saturation hides, so the plant's bound is watched at every sample;
    where the steps were too long, the samples are done again with shorter ones, or by the stiff method.

    Returns:
        The carry afterwards, what was seen as NumPy arrays, and the steps per sample that were taken.

    Raises:
        ConvergenceError: if a state is not finite or impossible, or no step is short enough.
    """
    steps = Steps()
    carry = map_leaves(np.asarray, carry)  # as it comes back, so that nothing is compiled twice
    while True:
        inner_now = inner * steps.split
        now = np.float64(period), np.int64(inner_now), np.float64(latency)
        # every operation as it is written, so that samples that come one by one are these, bit for bit
        after, results = call_compiled(march, plant, software, carry, rows, *now, mode="strict", stiff=steps.stiff)
        results = map_leaves(np.asarray, results)
        h, fastest = period / inner_now, float(np.max(results.rate_bound))
        if steps.short(fastest, period / inner):
            if not bool(results.sound.all()):
                parts = overloaded_parts(plant, results.outputs)
                code = Soundness.BROKEN if parts else Soundness.IMPOSSIBLE
                raise ConvergenceError(unsound_sentence(code, 0.0, h, parts))
            return after, results, inner_now
        shorter = steps.shorter(fastest, period / inner)
        if shorter is None:
            raise ConvergenceError(f"A mode of the system is too fast ({fastest:.3g} 1/s) for steps of {h:.3g} s.")
        steps = shorter


def inputs_of(plant: Plant, carry: Carry, latency: Scalar | None, period: Scalar) -> dict[str, Value]:
    """The inputs in force at the end of the sample before."""
    return _inputs(plant, carry.history, latency, 1.0, period)


def _signals(plant: Plant, history: Mapping[str, Any], latency: Scalar | None) -> dict[str, Signal]:
    straight, signals = plant.straight(), {}
    for name, past in history.items():
        # what goes straight reaches its newest value at the end of the sample
        by_line = Signal(jnp.concatenate([past[:1], past]), straight=True, delay=latency)
        signals[name] = by_line if name in straight else Signal(past, delay=latency)
    return plant.commands(signals)


def _inputs(
    plant: Plant, history: Mapping[str, Any], latency: Scalar | None, share: Scalar, period: Scalar
) -> dict[str, Value]:
    last = len(next(iter(history.values()))) - 1
    return {n: s.at(last, share, period) for n, s in _signals(plant, history, latency).items()}
