"""Integration of all lanes of a group, chunk by chunk, with step sizes that the rates of the group permit.

The decisions are those of `engine.sampled.advance`, lane by lane: every chunk is tried with the usual steps; lanes whose
modes are too fast for them do it again with shorter ones or by the stiff method, among themselves. A lane that fails leaves
the others alone: it gets a result code and a sentence.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from .._jax import Tree, jax
from ..bench.segment import AFTER_STOP, CHUNK, SensorNoise
from ..engine.sampled import Steps
from ..engine.soundness import Soundness, unsound_sentence
from .kernels import ChunkResult, LaneKernels
from .outputs import RunningTotals, VariantOutcome

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


def part(
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
    done = 0
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
    names = kernels.kind.kept
    width = len(sums.going)
    return MarchedPart(
        begun,
        carry,
        sums,
        failed,
        stopped,
        {n: np.concatenate([k[0][n] for k in kept], axis=1) for n in names} if kept else {},
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
    after, new, result_of_chunk = kernels.march(leaves, carry, sums, row, period=period, inner=inner, stiff=False)
    todo = {Steps(): np.flatnonzero(sums.going)}
    result: ChunkResult = result_of_chunk
    while todo:
        steps, lanes = todo.popitem()
        if steps != Steps():
            some, at = _few(lanes)
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
    if shorter is None and not math.isfinite(fastest) and not finite:
        return LaneFailure(
            VariantOutcome.NOT_FINITE, f"{VariantOutcome.NOT_FINITE.sentence} The steps were of {h:.3g} s."
        )
    if shorter is None:
        return LaneFailure(
            VariantOutcome.TOO_STIFF,
            f"{VariantOutcome.TOO_STIFF.sentence} It has {fastest:.3g} 1/s, the step {h:.3g} s.",
        )
    return shorter


def _few(lanes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pad lanes so that few sizes are compiled; also return the index of each."""
    size = LEAST_LANES
    while size < len(lanes):
        size *= 4
    return np.pad(lanes, (0, size - len(lanes)), mode="edge"), np.arange(len(lanes))


def _put(all_: np.ndarray, lanes: np.ndarray, some: np.ndarray) -> np.ndarray:
    changed = np.array(all_)
    changed[lanes] = some
    return changed


def after_stop(period: float) -> int:
    """Number of samples recorded after a stop."""
    return round(AFTER_STOP / period)
