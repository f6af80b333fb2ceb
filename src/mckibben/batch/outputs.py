"""Outputs of every variant: a result code, numbers from channels or from the engine's accounts, or whole channels.

Channels are those that a recording of `mckibben run` has, and only samples that it would keep count. In the sweep file:

    [outputs.peak]
    channel = "tension"
    reduce = "max"
    step = "steps"            # only while the step with this label is under way; all recorded samples by default

| reduce | result |
|---|---|
| first, final, min, max, mean, rms | of the samples [unit of the channel] |
| integral | over time, straight between the samples [unit s] |
| area | over the channel named by `over`: the work of a loop with its sign [product of both units] |
| time_to | from the first sample until a `share` of the way from the first to the last value is passed [s]; NaN if no step |
| drift | change over the last fifth of the samples, over the way from the first to the last value [1] |
| samples | the samples themselves, the output ``time`` with them |
| account | engine's own integral over the run, such as ``delivered`` [J] |
| balance | closure of mass, gas, muscle, mechanics, energy or exergy, as a recording's meta has it [1] |

Running outputs are made chunk by chunk. Which samples count is decided as `bench.run` decides it: up to the end of the
protocol, or for a while after something stopped the machine; those of steps that are recorded, or all of a chunk in which
it stopped.
"""

from __future__ import annotations

import enum
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np

from .._jax import Array, Scalar, jax, jnp
from ..analysis.steps import LAST, settling
from ..documents import JsonValue
from ..engine.integration import Result
from ..errors import InputError
from ..schema import Place, number, read_table, word

RUNNING = ("first", "final", "min", "max", "mean", "rms", "integral", "area")  # made while it goes
LATER = ("time_to", "drift", "samples")  # made of kept samples
BALANCES = ("mass", "gas", "muscle", "mechanics", "energy", "exergy")
KINDS = (*RUNNING, *LATER, "account", "balance")
TIME = "time"
BEYOND = 0.5  # of its way, by which a step may overshoot: a pole pair of a damping of 0.2 does


@dataclass(frozen=True)
class Output:
    """Definition of one output of every variant.

    Attributes:
        name: name of the array in the store.
        reduce: one of `KINDS`.
        channel: that it is made of; the integral's or balance's name for these.
        over: second channel of an area.
        share: share of the way, for ``time_to``.
        step: label of the step under way; empty for all.
    """

    name: str
    reduce: str = word(among=(*RUNNING, *LATER))
    channel: str = word()
    over: str = ""
    share: float = number("1", default=0.9)
    step: str = ""

    def __post_init__(self) -> None:
        if not 0.0 < self.share < 1.0:
            raise InputError("share", self.share, "must be more than 0 and less than 1")
        if (self.reduce == "area") != bool(self.over):
            problem = "is missing: an area needs it" if self.reduce == "area" else "is allowed only with an area"
            raise InputError("over", None, problem)

    @property
    def sampled(self) -> bool:
        """Whether the output is made from samples, not from the engine's integrals."""
        return self.reduce not in ("account", "balance")


USUAL = tuple(
    Output(f"{channel}.{reduce}", reduce, channel)
    for channel in ("pressure", "tension", "span")
    for reduce in ("final", "mean", "min", "max")
)


def read_outputs(raw: object, place: Place) -> tuple[Output, ...]:
    """Read the outputs of a sweep file, the usual ones if it names none.

    Raises:
        InputError: names the dotted path and what is allowed.
    """

    def read(name: str, below: Place, value: object) -> Output:
        if name == TIME or not name.strip() or "/" in name:
            raise below.fail(name, "must be another name; time and names with / are taken")
        entry = below.table(value)
        for key, among in (("account", None), ("balance", BALANCES)):
            if key in entry:
                entry.only((key,), f"with {key} goes nothing else:")
                return Output(name, key, entry.word(key, among=among))
        return read_table(Output, entry, owner="an output has", name=name)

    return tuple(read(name, place.below(name), value) for name, value in place.table(raw).values.items()) or USUAL


def check_channels(outputs: Iterable[Output], known: Iterable[str], accounts: Iterable[str], where: str) -> None:
    """Refuse outputs of channels or integrals that the machine does not have."""
    channels, integrals = list(known), list(accounts)
    for one in outputs:
        allowed = channels if one.sampled else integrals if one.reduce == "account" else list(BALANCES)
        for name in filter(None, (one.channel, one.over)):
            if name not in allowed:
                key = one.reduce if not one.sampled else "over" if name == one.over else "channel"
                raise InputError(f"outputs.{one.name}.{key}", name, known=allowed, where=where)


def wanted(outputs: Iterable[Output]) -> tuple[str, ...]:
    """Channels needed by all outputs, without repetition."""
    return tuple(dict.fromkeys(c for o in outputs if o.sampled for c in (o.channel, o.over) if c))


def document(outputs: Iterable[Output]) -> dict[str, Mapping[str, JsonValue]]:
    """Convert outputs to a JSON document for a store."""
    return {o.name: {k: v for k, v in asdict(o).items() if k != "name" and v not in ("",)} for o in outputs}


# ---- result codes


class VariantOutcome(enum.IntEnum):
    """Result code of a lane: those of the engine, and further ones of a bench."""

    NOT_RUN = -1
    DONE = 0
    NOT_FINITE = 1
    TOO_STIFF = 2
    IMPOSSIBLE = 3
    STOPPED = 4
    REFUSED = 5
    BROKEN = 6

    @property
    def sentence(self) -> str:
        """Meaning of the code, without the numbers of a lane."""
        return SENTENCES[self]


SENTENCES = {
    VariantOutcome.NOT_RUN: "It has not been run yet.",
    VariantOutcome.DONE: Result.DONE.value,
    VariantOutcome.NOT_FINITE: Result.NOT_FINITE.value,
    VariantOutcome.TOO_STIFF: Result.TOO_STIFF.value,
    VariantOutcome.IMPOSSIBLE: Result.IMPOSSIBLE.value,
    VariantOutcome.STOPPED: "The bench stopped it: an interlock tripped, or a test that had to come true did not.",
    VariantOutcome.REFUSED: "Nothing moved: the dry run or a value's bounds spoke against it.",
    VariantOutcome.BROKEN: Result.BROKEN.value,
}


def codes_of(codes: np.ndarray) -> dict[str, int]:
    """Count the variants by result code, by its name."""
    return {VariantOutcome(c).name.lower(): int(n) for c, n in zip(*np.unique(codes, return_counts=True), strict=True)}


# ---- running outputs of one lane

# What has to be known of the samples so far.
NEEDS = {
    "first": ("first",), "final": ("last",), "min": ("low",), "max": ("high",), "mean": ("sum",), "rms": ("squares",),
    "integral": ("path", "last", "since"), "area": ("path", "last", "since", "over"),
}  # fmt: skip
FAR = 1 << 40  # samples since the last one that counted, where none did


class RunningTotals(NamedTuple):
    """Intermediate values of a lane's outputs.

    Attributes:
        going: whether its part has not ended (bool).
        stopped: whether something stopped the machine (bool).
        samples: that were used.
        left: samples that follow a stop.
        sums: sums of every running output.
    """

    going: Any
    stopped: Any
    samples: Any
    left: Any
    sums: dict[str, dict[str, Any]]


class CountedSamples(NamedTuple):
    """Selection of the samples of a chunk that count.

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


def start_totals(outputs: tuple[Output, ...], after_stop: int) -> RunningTotals:
    """Totals before the first sample; `after_stop` samples follow a stop."""
    zero, none = jnp.zeros(()), jnp.asarray(jnp.nan)
    empty = {
        "count": jnp.zeros((), int),
        "first": none,
        "last": none,
        "low": jnp.asarray(jnp.inf),
        "high": jnp.asarray(-jnp.inf),
        "sum": zero,
        "squares": zero,
        "path": zero,
        "over": none,
        "since": jnp.asarray(FAR),
    }
    sums = {o.name: {k: empty[k] for k in ("count", *NEEDS[o.reduce])} for o in outputs if o.reduce in RUNNING}
    return RunningTotals(jnp.asarray(True), jnp.asarray(False), jnp.zeros((), int), jnp.asarray(after_stop), sums)


def count_samples(
    totals: RunningTotals, shown: Mapping[str, Array], every: int
) -> tuple[RunningTotals, CountedSamples]:
    """Select the samples of a chunk that count, and update their number in the totals."""
    size = shown["running"].shape[0]
    place = jnp.arange(size)
    used = jnp.where(totals.going, jnp.sum(shown["running"]), 0)
    stopped = totals.going & (jnp.any(shown["code"] > 0) | jnp.any(shown["missed"]))
    after = jnp.where(stopped, jnp.minimum(size - used, totals.left), 0)
    at = jnp.minimum(used, size - 1)
    used, left = used + after, totals.left - after
    over = jnp.where(stopped, left <= 0, used < size)
    kept = (place < used) & (shown["record"].astype(bool) | stopped) & ((totals.samples + place) % every == 0)
    new = totals._replace(
        going=totals.going & ~over, stopped=totals.stopped | stopped, samples=totals.samples + used, left=left
    )
    return new, CountedSamples(used, kept, stopped & ~totals.stopped, at)


def add_samples(
    totals: RunningTotals,
    outputs: tuple[Output, ...],
    channels: Mapping[str, Array],
    steps: Array,
    windows: Mapping[str, Array],
    kept: Array,
    period: Scalar,
    every: int,
) -> RunningTotals:
    """Add the samples of a chunk to the running outputs.

    Args:
        totals: so far.
        outputs: outputs of the sweep.
        channels: samples of each channel (n,).
        steps: index of the step of each sample (n,).
        windows: windows of every output, at which steps it looks (steps,).
        kept: which samples a recording has (n,).
        period: period of the samples [s].
        every: samples of the loop per one that is kept.
    """
    step = steps.astype(int)
    sums = dict(totals.sums)
    for one in outputs:
        if one.reduce not in RUNNING:
            continue
        chosen = kept & windows[one.name][step] if one.step else kept
        x = channels[one.channel]
        over = channels[one.over] if one.over else None
        sums[one.name] = _added(sums[one.name], one.reduce, x, over, chosen, period, every)
    return totals._replace(sums=sums)


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
    """Update the path of an integral or an area; samples of other steps in between break it."""
    size = x.shape[0]
    place, some = jnp.arange(size), jnp.any(chosen)
    # the sample that counted before each one
    before = jax.lax.cummax(jnp.where(chosen, place, -1))
    before = jnp.concatenate([jnp.full((1,), -1), before[:-1]])
    gap = jnp.where(before >= 0, place - before, so_far["since"] + place)
    old = jnp.where(before >= 0, x[before], so_far["last"])
    along, along_path = gap * period, {}
    if over is not None:
        along = over - jnp.where(before >= 0, over[before], so_far["over"])
        along_path["over"] = jnp.where(some, over[last], so_far["over"])
    along_path["path"] = so_far["path"] + jnp.sum(jnp.where(chosen & (gap <= every), 0.5 * (x + old) * along, 0.0))
    along_path["since"] = jnp.where(some, size - last, jnp.minimum(so_far["since"] + size, FAR))
    return along_path


def final_values(one: Output, sums: Mapping[str, np.ndarray]) -> np.ndarray:
    """A running output of all lanes (lanes,); NaN if no sample counted."""
    values = sums[NEEDS[one.reduce][0]]
    if one.reduce in ("mean", "rms"):
        values = values / np.maximum(sums["count"], 1)
    if one.reduce == "rms":
        values = np.sqrt(values)
    return np.asarray(np.where(sums["count"] > 0, values, np.nan))


def time_to(one: Output, time: np.ndarray, values: np.ndarray) -> tuple[float, str]:
    """Time from the first sample until a share of the change from first to last value is first passed [s].

    Passings lie between samples by a straight line.

    Args:
        one: the output.
        time: time of the samples that count (n,) [s].
        values: values of the channel (n,).

    Returns:
        The time, and what must be said of it: NaN where the values are no step, a time of a step under way where they have
        not settled; nothing where they have.
    """
    if len(values) < 2 or not np.isfinite(values).all():
        return float("nan"), f"{one.channel} has fewer than two samples, or some that are not finite"
    size, whole = abs(values[-1] - values[0]), float(np.ptp(values))
    change, settled = drift(time, values)
    moving = f"has not settled after {time[-1] - time[0]:.3g} s, in the last fifth of which it still changes by"
    moving = "" if settled else f"{moving} {abs(change):.1%} of its way"
    # What ends where it began, or on the way back, has no time of its own: the last sample alone decides when it is passed.
    if not whole < (1.0 + BEYOND) * size:
        far = f"{one.channel} ends {size / max(whole, 1e-300):.1%} of its range from where it began"
        return float("nan"), far + (f", and {moving}" if moving else ": it steps back, or not at all")
    said = f"{one.channel} {moving}" if moving else ""
    way = (values - values[0]) / (values[-1] - values[0])
    i = int(np.argmax(way >= one.share))
    between = (one.share - way[i - 1]) / (way[i] - way[i - 1])
    return float(time[i - 1] + between * (time[i] - time[i - 1]) - time[0]), said


def drift(time: np.ndarray, values: np.ndarray) -> tuple[float, bool]:
    """Change over the last fifth of the samples relative to the total change, and whether it is negligible.

    NaN, and settled, where the values end where they begin or are too few.

    Args:
        time: time of the samples that count (n,) [s].
        values: values of the channel (n,).
    """
    if len(values) < 2 or not np.isfinite(values).all() or values[-1] == values[0]:
        return float("nan"), True
    late = time >= time[-1] - LAST * (time[-1] - time[0])
    if np.count_nonzero(late) < 3:
        return float("nan"), True
    return settling(time[late], values[late], float(values[-1] - values[0]))
