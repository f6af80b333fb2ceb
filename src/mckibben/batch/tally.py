"""Running results of one lane: what a recording would keep of its samples, reduced chunk by chunk.

Which samples count is decided as `bench.run` decides it: up to the end of the protocol, or for a while after something
stopped the machine; those of steps that are recorded, or all of a chunk in which it stopped.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..analysis.steps import LAST, settling
from .outputs import RUNNING, Output

# What has to be known of the samples so far.
NEEDS = {
    "first": ("first",), "final": ("last",), "min": ("low",), "max": ("high",), "mean": ("sum",), "rms": ("squares",),
    "integral": ("path", "last", "since"), "area": ("path", "last", "since", "over"),
}  # fmt: skip
FAR = 1 << 40  # samples since the last one that counted, where none did


class Tally(NamedTuple):
    """What is known of a lane so far.

    Attributes:
        going: whether its part has not ended (bool).
        stopped: whether something stopped the machine (bool).
        samples: that were used.
        left: samples that follow a stop.
        sums: of every running output.
    """

    going: Any
    stopped: Any
    samples: Any
    left: Any
    sums: dict[str, dict[str, Any]]


class Look(NamedTuple):
    """Samples of a chunk, all (n,); channels by name."""

    channels: Mapping[str, Any]
    shown: Mapping[str, Any]


class Counted(NamedTuple):
    """Which samples of a chunk count.

    Attributes:
        used: how many were used.
        kept: which a recording has (n,).
        stops: whether the machine stopped in this chunk, for the first time (bool).
        at: sample at which.
    """

    used: Any
    kept: Any
    stops: Any
    at: Any


def fresh(outputs: tuple[Output, ...], after_stop: int) -> Tally:
    """Before the first sample; `after_stop` samples follow a stop."""
    zero, none = jnp.zeros(()), jnp.asarray(jnp.nan)
    empty = {
        "count": jnp.zeros((), int), "first": none, "last": none, "low": jnp.asarray(jnp.inf),
        "high": jnp.asarray(-jnp.inf), "sum": zero, "squares": zero, "path": zero, "over": none,
        "since": jnp.asarray(FAR),
    }  # fmt: skip
    sums = {o.name: {k: empty[k] for k in ("count", *NEEDS[o.reduce])} for o in outputs if o.reduce in RUNNING}
    return Tally(jnp.asarray(True), jnp.asarray(False), jnp.zeros((), int), jnp.asarray(after_stop), sums)


def count(tally: Tally, shown: Mapping[str, Any], every: int) -> tuple[Tally, Counted]:
    """Which samples of a chunk count, and the tally of their number."""
    size = shown["running"].shape[0]
    place = jnp.arange(size)
    used = jnp.where(tally.going, jnp.sum(shown["running"]), 0)
    stopped = tally.going & (jnp.any(shown["code"] > 0) | jnp.any(shown["missed"]))
    after = jnp.where(stopped, jnp.minimum(size - used, tally.left), 0)
    at = jnp.minimum(used, size - 1)
    used, left = used + after, tally.left - after
    over = jnp.where(stopped, left <= 0, used < size)
    kept = (place < used) & (shown["record"].astype(bool) | stopped) & ((tally.samples + place) % every == 0)
    new = tally._replace(
        going=tally.going & ~over, stopped=tally.stopped | stopped, samples=tally.samples + used, left=left
    )
    return new, Counted(used, kept, stopped & ~tally.stopped, at)


def add(
    tally: Tally,
    outputs: tuple[Output, ...],
    look: Look,
    windows: Mapping[str, Any],
    kept: Any,
    period: Any,
    every: int,
) -> Tally:
    """The running outputs with the samples of a chunk.

    Args:
        tally: so far.
        outputs: of the sweep.
        look: the samples.
        windows: of every output, at which steps it looks (steps,).
        kept: which samples a recording has (n,).
        period: of the samples [s].
        every: samples of the loop per one that is kept.
    """
    step = look.shown["step"].astype(int)
    sums = dict(tally.sums)
    for one in outputs:
        if one.reduce not in RUNNING:
            continue
        chosen = kept & windows[one.name][step] if one.step else kept
        x = look.channels[one.channel]
        over = look.channels[one.over] if one.over else None
        sums[one.name] = _added(sums[one.name], one.reduce, x, over, chosen, period, every)
    return tally._replace(sums=sums)


def _added(
    so_far: dict[str, Any], kind: str, x: Any, over: Any, chosen: Any, period: Any, every: int
) -> dict[str, Any]:
    size = x.shape[0]
    place = jnp.arange(size)
    number = jnp.sum(chosen)
    some = number > 0
    new = {**so_far, "count": so_far["count"] + number}
    if kind == "first":
        begins = jnp.min(jnp.where(chosen, place, size - 1))
        new["first"] = jnp.where((so_far["count"] == 0) & some, x[begins], so_far["first"])
    elif kind == "min":
        new["low"] = jnp.minimum(so_far["low"], jnp.min(jnp.where(chosen, x, jnp.inf)))
    elif kind == "max":
        new["high"] = jnp.maximum(so_far["high"], jnp.max(jnp.where(chosen, x, -jnp.inf)))
    elif kind == "mean":
        new["sum"] = so_far["sum"] + jnp.sum(jnp.where(chosen, x, 0.0))
    elif kind == "rms":
        new["squares"] = so_far["squares"] + jnp.sum(jnp.where(chosen, x * x, 0.0))
    else:
        last = jnp.max(jnp.where(chosen, place, 0))
        if kind != "final":
            new |= _along(so_far, x, over, chosen, last, period, every)
        new["last"] = jnp.where(some, x[last], so_far["last"])
    return new


def _along(
    so_far: dict[str, Any], x: Any, over: Any, chosen: Any, last: Any, period: Any, every: int
) -> dict[str, Any]:
    """The path of an integral or an area; samples of other steps in between break it."""
    size = x.shape[0]
    place, some = jnp.arange(size), jnp.any(chosen)
    # the sample that counted before each one
    before = jax.lax.cummax(jnp.where(chosen, place, -1))
    before = jnp.concatenate([jnp.full((1,), -1), before[:-1]])
    gap = jnp.where(before >= 0, place - before, so_far["since"] + place)
    old = jnp.where(before >= 0, x[before], so_far["last"])
    along, found = gap * period, {}
    if over is not None:
        along = over - jnp.where(before >= 0, over[before], so_far["over"])
        found["over"] = jnp.where(some, over[last], so_far["over"])
    found["path"] = so_far["path"] + jnp.sum(jnp.where(chosen & (gap <= every), 0.5 * (x + old) * along, 0.0))
    found["since"] = jnp.where(some, size - last, jnp.minimum(so_far["since"] + size, FAR))
    return found


def finished(one: Output, sums: Mapping[str, np.ndarray]) -> np.ndarray:
    """A running output of all lanes (lanes,); NaN where no sample counted."""
    found = sums[NEEDS[one.reduce][0]]
    if one.reduce in ("mean", "rms"):
        found = found / np.maximum(sums["count"], 1)
    if one.reduce == "rms":
        found = np.sqrt(found)
    return np.asarray(np.where(sums["count"] > 0, found, np.nan))


def time_to(one: Output, time: np.ndarray, values: np.ndarray) -> float:
    """When a share of the way from the first value to the last is passed for the first time, from the first sample [s].

    Passings lie between samples by a straight line; NaN where the values end where they begin.

    Args:
        one: the output.
        time: of the samples that count (n,) [s].
        values: of the channel (n,).
    """
    if len(values) < 2 or not np.isfinite(values).all() or values[-1] == values[0]:
        return float("nan")
    way = (values - values[0]) / (values[-1] - values[0])
    i = int(np.argmax(way >= one.share))
    between = (one.share - way[i - 1]) / (way[i] - way[i - 1])
    return float(time[i - 1] + between * (time[i] - time[i - 1]) - time[0])


def drift(time: np.ndarray, values: np.ndarray) -> tuple[float, bool]:
    """The change over the last fifth of the samples over the way from the first value to the last, and whether it is none.

    NaN, and settled, where the values end where they begin or are too few.

    Args:
        time: of the samples that count (n,) [s].
        values: of the channel (n,).
    """
    if len(values) < 2 or not np.isfinite(values).all() or values[-1] == values[0]:
        return float("nan"), True
    late = time >= time[-1] - LAST * (time[-1] - time[0])
    if np.count_nonzero(late) < 3:
        return float("nan"), True
    return settling(time[late], values[late], float(values[-1] - values[0]))
