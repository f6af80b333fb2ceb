"""Compilation and calls of functions over lanes, and their integration chunk by chunk.

A lane is the machine and its software of one variant: arrays of a tree whose structure all lanes share. What is equal in
all lanes is passed once. Two pure functions are mapped over the lanes: the beginning of a part, and a chunk of its samples,
which is `engine.sampled.sample` scanned, with the running outputs made of what it saw. Neither branches on a value.

A part is marched (`march_part`) with step sizes that the rates of the group permit. The decisions are those of
`engine.sampled.advance`, lane by lane: every chunk is tried with the usual steps; lanes whose modes are too fast for them
do it again with shorter ones or by the stiff method, among themselves. A lane that fails leaves the others alone: it gets a
result code and a sentence.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from .._jax import Scalar, Tree, jax, jnp
from ..assembly.output_names import CONSTANT
from ..bench import channels
from ..bench.hardware.plant import InstrumentedPlant
from ..bench.segment import AFTER_STOP, CHUNK, SensorNoise
from ..engine import sampled
from ..engine.native import EngineFunction, compile_function
from ..engine.sampled import Steps
from ..engine.signals import Signal, Value
from ..engine.soundness import Soundness, unsound_sentence
from .outputs import CountedSamples, Output, RunningTotals, VariantOutcome, add_samples, count_samples

SHOWN = ("running", "record", "code", "missed", "step")


class PlantWithoutAccounts(InstrumentedPlant):
    """A plant without the integrals of the balances, which is three times as fast."""

    def integrands(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Tree:
        """Return no integrands."""
        return {}


class ChunkResult(NamedTuple):
    """Result of a chunk, for every lane: the state that decides how it continues, and the requested samples.

    Attributes:
        fastest: bound of the fastest mode [1/s].
        sound: whether every state can be and is finite (bool).
        finite: whether it is finite (bool).
        broken: whether a muscle was longer than its threads bear (bool).
        counted: which samples count.
        stop: what was measured and shown at the sample at which the machine stopped.
        samples: the channels asked for, each (n,).
        step: index of the step of every sample (n,).
    """

    fastest: Any
    sound: Any
    finite: Any
    broken: Any
    counted: CountedSamples
    stop: dict[str, Any]
    samples: dict[str, Any]
    step: Any


class KernelKey(NamedTuple):
    """Properties on which a compiled function depends.

    Attributes:
        structure: structure of the tree of a lane's part.
        shared: whether all lanes have the same, for every array.
        depth: depth of the history of commands, in samples.
        every: samples of the loop per sample of the protocol.
        outputs: outputs of the sweep.
        kept: channels whose samples are given back.
        accounts: whether the engine's integrals are wanted.
        seeds: whether every lane has noise of its own.
        engine: that compiles it.
        threads: threads of native kernels; all cores where 0.
    """

    structure: Any
    shared: tuple[bool, ...]
    depth: int
    every: int
    outputs: tuple[Output, ...]
    kept: tuple[str, ...]
    accounts: bool
    seeds: bool
    engine: str
    threads: int = 0


class ChunkPhysics(NamedTuple):
    """A chunk of samples of a lane, before outputs are computed.

    Attributes:
        carry: after it.
        channels: that outputs need, each (n,).
        shown: by the software, of `SHOWN` (n,).
        stop: what the software saw and showed at the sample after which it runs no more; else at the last one.
        fastest: bound of the fastest mode [1/s].
        sound: whether every state can be and is finite (bool).
        finite: whether the last state is finite (bool).
        broken: whether a muscle was longer than its threads bear (bool).
    """

    carry: Any
    channels: dict[str, Any]
    shown: dict[str, Any]
    stop: dict[str, Any]
    fastest: Any
    sound: Any
    finite: Any
    broken: Any


class LaneKernels:
    """Compiled functions of one kind, with lanes as the first axis.

    The chunk of samples runs in native kernels where it can be lowered; by XLA else. What is made of its samples, and the
    beginning of a part, always is XLA's.
    """

    def __init__(self, kind: KernelKey) -> None:
        self.kind = kind
        self._leaves = tuple(None if s else 0 for s in kind.shared)
        self._rows = 0 if kind.seeds else None
        self._native: dict[bool, EngineFunction] = {}  # by whether the method is the stiff one
        self._begin = jax.jit(jax.vmap(self._begin_lane, in_axes=(self._leaves, None, 0)))
        self._count = jax.jit(jax.vmap(self._counted_lane, in_axes=(self._leaves, 0, -1, None)))
        self._by_xla = jax.jit(self._all, static_argnums=(6,))

    def begin(self, leaves: Sequence[Tree], row: Tree, width: int) -> sampled.Carry:
        """Put `width` lanes at the first sample of the part."""
        carry: sampled.Carry = jax.tree.map(np.asarray, self._begin(tuple(leaves), row, np.arange(width)))
        return carry

    def march(
        self, leaves: Sequence[Tree], carry: Tree, sums: Tree, rows: Tree, *, period: float, inner: int, stiff: bool
    ) -> tuple[Tree, Tree, ChunkResult]:
        """Compute a chunk of samples of every lane: the carry and the totals afterwards, and the result."""
        native = self._lowered(leaves, carry, rows, period, inner, stiff)
        if native is None:
            after, new, result = self._by_xla(tuple(leaves), carry, sums, rows, period, inner, stiff)
        else:  # native kernels have the lanes last
            last = [x if s else np.moveaxis(x, 0, -1) for x, s in zip(leaves, self.kind.shared, strict=True)]
            carried = jax.tree.map(lambda x: np.moveaxis(np.asarray(x), 0, -1), carry)
            columns = jax.tree.map(lambda x: np.moveaxis(x, 0, -1), rows) if self.kind.seeds else rows
            lanes, threads = jax.tree.leaves(carry)[0].shape[0], self.kind.threads or None
            done: ChunkPhysics = native(
                tuple(last), carried, columns, np.float64(period), np.int64(inner), lanes=lanes, threads=threads
            )
            after = jax.tree.map(lambda x: np.moveaxis(x, -1, 0), done.carry)
            new, result = self._count(tuple(leaves), sums, done._replace(carry=()), period)
        return jax.tree.map(np.asarray, after), jax.tree.map(np.array, new), jax.tree.map(np.asarray, result)

    def tree(self, leaves: Sequence[Tree]) -> dict[str, Tree]:
        """Rebuild the tree of a lane, or of many."""
        return _tree(self.kind, leaves)

    def _lowered(
        self, leaves: Sequence[Tree], carry: Tree, rows: Tree, period: float, inner: int, stiff: bool
    ) -> EngineFunction | None:
        if self.kind.engine != "xla" and stiff not in self._native:
            one = tuple(x if s else x[0] for x, s in zip(leaves, self.kind.shared, strict=True))
            row = jax.tree.map(lambda x: x[0], rows) if self.kind.seeds else rows
            first = jax.tree.map(lambda x: x[0], carry)
            self._native[stiff] = compile_function(
                functools.partial(physics, self.kind._replace(engine="", threads=0), stiff=stiff),
                one,
                first,
                row,
                np.float64(period),
                np.int64(inner),
                engine=self.kind.engine,
                title="a lane of a batch",
            )
        kernel = self._native.get(stiff)
        return kernel if kernel is not None and kernel.engine != "xla" else None

    def _begin_lane(self, leaves: Tree, row: Tree, lane: Any) -> Any:
        tree = self.tree(leaves)
        return at_rest(tree["plant"], tree["software"], tree["pressure"], self.kind.depth, row)

    def _all(
        self, leaves: Tree, carry: Tree, sums: Tree, rows: Tree, period: Scalar, inner: Scalar, stiff: bool
    ) -> Any:
        def one(own: Any, before: Scalar, so_far: Any, arguments: Any) -> Any:
            done = physics(self.kind, own, before, arguments, period, inner, stiff)
            return done.carry, *self._counted_lane(own, so_far, done, period)

        return jax.vmap(one, in_axes=(self._leaves, 0, 0, self._rows))(leaves, carry, sums, rows)

    def _counted_lane(
        self, leaves: Tree, sums: RunningTotals, done: ChunkPhysics, period: Scalar
    ) -> tuple[RunningTotals, ChunkResult]:
        windows, kind, shown = self.tree(leaves)["windows"], self.kind, done.shown
        new, counted = count_samples(sums, shown, kind.every)
        new = add_samples(new, kind.outputs, done.channels, shown["step"], windows, counted.kept, period, kind.every)
        stop = {**done.stop, "code": jnp.max(shown["code"])}
        kept = {n: done.channels[n] for n in kind.kept}
        return new, ChunkResult(
            done.fastest, done.sound, done.finite, done.broken, counted, stop, kept, shown["step"].astype(int)
        )


def physics(
    kind: KernelKey, leaves: Tree, carry: Tree, rows: Tree, period: Scalar, inner: Scalar, stiff: bool
) -> ChunkPhysics:
    """Compute a chunk of samples of one lane, straight-line but for its counted loops."""
    tree = _tree(kind, leaves)
    sampled_ = (c for o in kind.outputs if o.sampled for c in (o.channel, o.over) if c)
    names = tuple(dict.fromkeys([*kind.kept, *sampled_]))

    def sample(before: Any, row: Any) -> tuple[Any, sampled.SampleResult]:
        plant, software, latency = tree["plant"], tree["software"], tree["latency"]
        return sampled.sample(plant, software, before, row, period=period, inner=inner, latency=latency, stiff=stiff)

    def one(before: Any, row: Any) -> tuple[Tree, Tree]:
        state, ran, last = before
        after, result = sample(state, row)
        now, known = _told(result), channels_of(result)
        last = {n: jnp.where(ran, now[n], old) for n, old in last.items()}
        shown = {n: result.shown[n] for n in SHOWN}
        return (after, ran & result.shown["running"], last), (
            {name: jnp.asarray(known[name], float) for name in names},
            shown,
            result.rate_bound,
            result.sound,
            tree["plant"].broken(result.outputs),
        )

    row = jax.tree.map(lambda x: x[0], rows)
    nothing = {n: jnp.zeros(x.shape) for n, x in jax.eval_shape(lambda: _told(sample(carry, row)[1])).items()}
    begun = carry, jnp.asarray(True), nothing
    (after, _, stop), (results, shown, rate_bound, sound, broken) = jax.lax.scan(one, begun, rows)
    finite = [jnp.isfinite(x).all() for x in jax.tree.leaves((after.state, after.memory))]
    return ChunkPhysics(
        after, results, shown, stop, jnp.max(rate_bound), jnp.all(sound), jnp.stack(finite).all(), jnp.any(broken)
    )


def _tree(kind: KernelKey, leaves: Sequence[Tree]) -> dict[str, Tree]:
    tree: dict[str, Any] = jax.tree.unflatten(kind.structure, leaves)
    if not kind.accounts:
        plant = tree["plant"]
        tree["plant"] = PlantWithoutAccounts(
            machine=plant.machine, sensors=plant.sensors, tested=plant.tested, converters=plant.converters
        )
    return tree


def _told(results: sampled.SampleResult) -> dict[str, Tree]:
    told = {n: v for n, v in results.measured.items() if not n.endswith(".code")}
    told |= {name: results.shown[name] for name in ("velocity", "step")}
    return {n: jnp.asarray(v, float) for n, v in told.items()}


def channels_of(results: sampled.SampleResult) -> Mapping[str, Scalar]:
    """All channels of a sample, named as `bench.run` does."""
    by_name = {n: v for n, v in results.measured.items() if not n.endswith(".code")}
    by_name |= {n: v for n, v in results.shown.items() if n.startswith("command.")}
    by_name |= {channels.INPUTS[n]: v for n, v in results.commands.items()}
    true = {channels.RENAMED.get(n, n): v for n, v in results.outputs.items() if not n.startswith(CONSTANT)}
    return by_name | true


def at_rest(plant: InstrumentedPlant, software: Tree, pressure: Scalar, depth: int, row: Tree) -> sampled.Carry:
    """State at the first sample of a part, after a gauge pressure [Pa] has lasted; as `bench.segment` begins one.

    Args:
        plant: the machine behind its converters.
        software: the software that commands it.
        pressure: in every volume, and asked of the valve [Pa].
        depth: depth of the history of commands, in samples.
        row: row of a sample without noise.
    """
    commands = {"valve": pressure, "motor": jnp.zeros(()), "open": jnp.ones(())}
    held = {n: Signal(jnp.full((2,), v)) for n, v in plant.convert(commands).items()}
    inputs = {n: Value(s.values[0], jnp.zeros(())) for n, s in plant.commands(held).items()}
    room = plant.machine.environment.pressure_abs
    state, memory = plant.machine.at_rest(dict.fromkeys(plant.machine.circuit.chambers, room + pressure), inputs)
    signals = plant.seen(state, memory, inputs)
    whole = {"machine": state, "sensors": {n: s.initial(signals[n]) for n, s in plant.sensors.items()}}
    carry = sampled.rest(plant, (whole, memory), commands, depth)
    return sampled.with_software(plant, software, carry, row)


LEAST_LANES = 8  # of a call: fewer cost as much


class LaneFailure(NamedTuple):
    """Failure of a lane: code, time and reason."""

    outcome: VariantOutcome
    message: str


class MarchedPart(NamedTuple):
    """Result of a part of all lanes.

    Attributes:
        begun: carries at its beginning.
        carry: carries at its end.
        totals: afterwards.
        failed: by lane.
        stopped: by lane: what was seen at the sample at which the machine stopped, with its time [s].
        samples: kept channels, each (lanes, samples).
        counted: which of them count (lanes, samples).
        step: index of the step of each (lanes, samples).
    """

    begun: Any
    carry: Any
    totals: RunningTotals
    failed: dict[int, LaneFailure]
    stopped: dict[int, dict[str, float]]
    samples: dict[str, np.ndarray]
    counted: np.ndarray
    step: np.ndarray


class NoiseRows:
    """Sensor noise of every sample: one for all lanes, or one for each."""

    def __init__(self, draws: Sequence[SensorNoise]) -> None:
        self.draws = draws

    def first(self) -> Tree:
        """Row of a sample without noise."""
        return self.draws[0].first()

    def next(self) -> Tree:
        """Rows of the next chunk."""
        every = [d.next() for d in self.draws]
        return every[0] if len(every) == 1 else jax.tree.map(lambda *x: np.stack(x), *every)


def march_part(
    kernels: LaneKernels,
    leaves: Sequence[np.ndarray],
    sums: RunningTotals,
    rows: NoiseRows,
    *,
    period: float,
    inner: int,
    tell: Callable[[float], None],
) -> MarchedPart:
    """Run one part of the protocol in every lane.

    Args:
        kernels: compiled functions.
        leaves: arrays of the lanes.
        sums: totals so far; lanes that are not going stay as they are.
        rows: noise.
        period: period of the samples [s].
        inner: steps of the physics per sample.
        tell: told how many samples all lanes have done.
    """
    carry = begun = kernels.begin(leaves, rows.first(), len(sums.going))
    failed: dict[int, LaneFailure] = {}
    stopped: dict[int, dict[str, float]] = {}
    kept: list[tuple[dict[str, np.ndarray], np.ndarray, np.ndarray]] = []
    done, width = 0, len(sums.going)
    while bool(np.any(sums.going)):
        before, row = sums, rows.next()
        carry, sums, result = _chunk(kernels, leaves, carry, sums, row, period, inner, failed)
        for lane in np.flatnonzero(result.counted.stops & before.going):
            at = float(before.samples[lane] + result.counted.at[lane]) * period
            stopped[int(lane)] = {n: float(v[lane]) for n, v in result.stop.items()} | {"time": at}
        if kernels.kind.kept:
            kept.append((dict(result.samples), result.counted.kept & before.going[:, None], result.step))
        done += CHUNK
        tell(done)
    return MarchedPart(
        begun,
        carry,
        sums,
        failed,
        stopped,
        {n: np.concatenate([k[0][n] for k in kept], axis=1) for n in kernels.kind.kept} if kept else {},
        np.concatenate([k[1] for k in kept], axis=1) if kept else np.zeros((width, 0), bool),
        np.concatenate([k[2] for k in kept], axis=1) if kept else np.zeros((width, 0), int),
    )


def _chunk(
    kernels: LaneKernels,
    leaves: Sequence[np.ndarray],
    carry: Tree,
    sums: Tree,
    row: Tree,
    period: float,
    inner: int,
    failed: dict[int, LaneFailure],
) -> tuple[Tree, Tree, ChunkResult]:
    """Compute a chunk of all lanes, with shorter steps where needed; failures are added to `failed`."""
    result: ChunkResult
    after, new, result = kernels.march(leaves, carry, sums, row, period=period, inner=inner, stiff=False)
    todo = {Steps(): np.flatnonzero(sums.going)}
    while todo:
        steps, lanes = todo.popitem()
        if steps != Steps():
            size = LEAST_LANES  # few sizes, so that few are compiled
            while size < len(lanes):
                size *= 4
            some, at = np.pad(lanes, (0, size - len(lanes)), mode="edge"), np.arange(len(lanes))
            chosen = [x if s else x[some] for x, s in zip(leaves, kernels.kind.shared, strict=True)]
            mine, sub = jax.tree.map(lambda x: x[some], (carry, sums))  # noqa: B023
            theirs = jax.tree.map(lambda x: x[some], row) if kernels.kind.seeds else row  # noqa: B023
            again = kernels.march(
                chosen, mine, sub, theirs, period=period, inner=inner * steps.split, stiff=steps.stiff
            )
            after, new, result = (
                jax.tree.map(lambda x, y: _put(x, lanes, y[at]), old, got)  # noqa: B023
                for old, got in zip((after, new, result), again, strict=True)
            )
        for lane in lanes:
            fastest, sound = float(result.fastest[lane]), bool(result.sound[lane])
            finite, broken = bool(result.finite[lane]), bool(result.broken[lane])
            verdict = _verdict(fastest, sound, finite, broken, period / inner, steps)
            if isinstance(verdict, LaneFailure):
                failed[int(lane)] = verdict
                new.going[lane] = False
            elif verdict is not None:
                todo[verdict] = np.append(todo.get(verdict, np.zeros(0, int)), lane)
    return after, new, result


def _verdict(
    fastest: float, sound: bool, finite: bool, broken: bool, usual: float, steps: Steps
) -> None | LaneFailure | Steps:
    """Whether the steps of a chunk were short enough; else the steps to try next."""
    h = usual / steps.split
    if steps.short(fastest, usual):
        if sound:
            return None
        if finite and broken:
            return LaneFailure(VariantOutcome.BROKEN, unsound_sentence(Soundness.BROKEN, 0.0, h))
        outcome = VariantOutcome.IMPOSSIBLE if finite else VariantOutcome.NOT_FINITE
        return LaneFailure(outcome, f"{outcome.sentence} The steps were of {h:.3g} s.")
    shorter = steps.shorter(fastest, usual)
    if shorter is not None:
        return shorter
    if not math.isfinite(fastest) and not finite:
        outcome = VariantOutcome.NOT_FINITE
        return LaneFailure(outcome, f"{outcome.sentence} The steps were of {h:.3g} s.")
    outcome = VariantOutcome.TOO_STIFF
    return LaneFailure(outcome, f"{outcome.sentence} It has {fastest:.3g} 1/s, the step {h:.3g} s.")


def _put(all_: np.ndarray, lanes: np.ndarray, some: np.ndarray) -> np.ndarray:
    changed = np.array(all_)
    changed[lanes] = some
    return changed


def after_stop(period: float) -> int:
    """Number of samples recorded after a stop."""
    return round(AFTER_STOP / period)
