"""Runs of variants in lanes: numbers, a result code and a message for each."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np

from .._jax import Tree, jax
from ..answers import Answer, Caution, collect
from ..assembly.accounts import accounts
from ..bench.segment import AFTER_STOP, SensorNoise
from ..bench.sensors import MUSCLE
from ..engine import sampled
from ..engine.native import ENGINES, call_compiled
from ..errors import InputError
from ..muscles.evidence import volume_contradiction
from ..recordings.memory import check_memory
from .kernels import KernelKey, LaneKernels, MarchedPart, NoiseRows, at_rest, channels_of, march_part
from .lanes import BuiltVariant, LaneGroup, LanePlanner, VariantFamily
from .outputs import (
    LATER,
    TIME,
    Output,
    RunningTotals,
    VariantOutcome,
    codes_of,
    drift,
    final_values,
    start_totals,
    time_to,
)
from .run_template import RunTemplate
from .variants import Variants, power

CAUTION = " Caution: "  # before each in the message of a variant, where it ends the message
LANES = 256  # of a call of the processor: more are hardly faster
LISTED = 8  # runs of variants that a caution names
GPU_LANES = 16384  # of a call of a GPU, which fewer leave idle
INVALID = [VariantOutcome.NOT_FINITE, VariantOutcome.TOO_STIFF, VariantOutcome.IMPOSSIBLE, VariantOutcome.BROKEN]
LATER_CHANNELS = 8  # that a run keeps until its outputs are made of them, with copies
Tell = Callable[[float], None]  # told the share of the work that is done


def lanes_per_call(engine: str) -> int:
    """Largest number of variants that are computed at once by an engine."""
    return GPU_LANES if engine == "gpu" else LANES


@dataclass(frozen=True, eq=False, repr=False)
class Results(Answer):
    """Outputs of some variants.

    Attributes:
        code: result codes (n,).
        message: a sentence for each; where an output has no value, why; what can hardly be meant of it.
        duration: simulated time of each [s] (n,).
        outputs: by name (n,); whole channels (n, samples), NaN beyond the end of each.
        cautions: of every output that has no value, or one of a step under way, in variants that reached their end; and of
            what can hardly be meant of the variants, with the first that has it.
    """

    code: np.ndarray
    message: list[str]
    duration: np.ndarray
    outputs: dict[str, np.ndarray]
    cautions: tuple[Caution, ...] = field(init=False)

    def __post_init__(self) -> None:
        said = []
        for name in self.outputs:
            remarks = np.array([f" {name}: " in message for message in self.message], bool)
            without = self.unmeasured(name)
            said.append(self._caution(name, without, "has no value"))
            said.append(self._caution(name, np.setdiff1d(np.flatnonzero(remarks), without), "is not settled"))
        first: dict[str, int] = {}
        for row, message in enumerate(self.message):
            for text in message.split(CAUTION)[1:]:
                first.setdefault(text, row)
        said += [Caution(f"{text} (variant {row})", "variants") for text, row in first.items()]
        object.__setattr__(self, "cautions", collect(*said))

    def unmeasured(self, name: str) -> np.ndarray:
        """Variants that reached their end and have no value of an output, their places (m,)."""
        values = self.outputs[name]
        none = np.isnan(values) if values.ndim == 1 else np.zeros(len(self.code), bool)
        return np.flatnonzero(none & (np.asarray(self.code) == VariantOutcome.DONE))

    def _caution(self, name: str, lanes: np.ndarray, words: str) -> Caution | None:
        if not lanes.size:
            return None
        runs = np.split(lanes, np.flatnonzero(np.diff(lanes) > 1) + 1)
        which = ", ".join(f"{r[0]} to {r[-1]}" if len(r) > 1 else f"{r[0]}" for r in runs[:LISTED])
        which += " .." if len(runs) > LISTED else ""
        why = self.message[lanes[0]].partition(f" {name}: ")[2].partition(". ")[0].rstrip(".")
        said = f"{name} {words} in {lanes.size:,} of {len(self.code):,} variants ({which})"
        return Caution(f"{said}; in the first, {why}" if why else said, f"outputs.{name}")

    def __repr__(self) -> str:
        counts = ", ".join(f"{n:,} {name}" for name, n in codes_of(self.code).items())
        without = ", ".join(f"{len(self.unmeasured(n)):,} without {n}" for n in self.outputs if self.unmeasured(n).size)
        return f"Results({counts}{f' ({without})' if without else ''}; outputs: {', '.join(self.outputs)})"


class Runner:
    """Runs variants of one template; compiled functions are reused.

    Args:
        template: template of all variants.
        ranges: lowest and highest value of every varied number in the whole sweep [SI].
        engine: that compiles the lanes: ``auto``, ``native``, ``gpu`` or ``xla``.
        threads: threads of native kernels; all cores where 0.
    """

    def __init__(
        self,
        template: RunTemplate,
        ranges: Mapping[str, tuple[float, float]],
        *,
        engine: str = "auto",
        threads: int = 0,
    ) -> None:
        if engine not in ENGINES:
            raise InputError("engine", engine, known=ENGINES)
        self.template, self.engine, self.threads = template, engine, threads
        self.planner = LanePlanner(template, ranges)
        self._kernels: list[LaneKernels] = []

    def run(self, variants: Variants, tell: Tell = lambda _: None) -> Results:
        """Run all variants; an invalid one is reported in its result and never raises."""
        count = len(variants)
        code, duration = np.full(count, int(VariantOutcome.REFUSED), np.int8), np.zeros(count)
        message = [""] * count
        refused, groups = self.planner.plan(variants)
        for row, said in refused.items():
            message[row] = said
        size = lanes_per_call(self.engine)
        wide = sum(o.reduce == "samples" for o in self.template.outputs)
        plans = [lane.built.bench.plan for g in groups for lane in g.lanes]
        if plans:  # whole channels of all variants stay, and those of the lanes that run at once
            longest = max(plans, key=lambda plan: plan.samples / plan.sample_rate)
            at_once = 8.0 * (wide * count + LATER_CHANNELS * min(count, size))
            check_memory(longest.samples / longest.sample_rate, 1.0 / longest.sample_rate, bytes_per_sample=at_once)
        pieces = [LaneGroup(g.family, g.lanes[i : i + size]) for g in groups for i in range(0, len(g.lanes), size)]
        outputs: dict[str, np.ndarray] = {}
        for number, piece in enumerate(pieces):
            done = _Piece(self, piece, _after(number, len(pieces), tell))
            rows = [lane.row for lane in piece.lanes]
            code[rows], duration[rows] = done.code, done.duration
            for row, said in zip(rows, done.message, strict=True):
                message[row] = said
            for name, values in done.outputs.items():
                outputs[name] = _placed(outputs.get(name), count, rows, values)
        for row, cautions in self.planner.cautions(variants).items():
            if row not in refused:
                message[row] = CAUTION.join([message[row], *cautions])
        for one in self.template.outputs:
            outputs.setdefault(one.name, np.full((count, 0) if one.reduce == "samples" else count, np.nan))
        return Results(code, message, duration, outputs)

    def kernels(self, family: VariantFamily, part: int, seeds: bool) -> LaneKernels:
        """Compiled functions of a part, for the parameters known to be shared."""
        outputs = self.template.outputs
        kind = KernelKey(
            structure=family.fixed.structures[part],
            shared=tuple(bool(s) for s in family.shared[part]),
            depth=family.fixed.timing.depth,
            every=family.fixed.every,
            outputs=outputs,
            kept=tuple(dict.fromkeys(o.channel for o in outputs if o.reduce in LATER)),
            accounts=any(not o.sampled for o in outputs),
            seeds=seeds,
            engine=self.engine,
            threads=self.threads,
        )
        for known in self._kernels:
            if known.kind == kind:
                return known
        self._kernels.append(LaneKernels(kind))
        return self._kernels[-1]


class _Piece:
    """One group of lanes, run from start to end."""

    def __init__(self, runner: Runner, group: LaneGroup, tell: Tell) -> None:
        lanes = group.lanes
        self.outputs_wanted, self.family, self.lanes = runner.template.outputs, group.family, lanes
        self.timing, self.period = group.family.fixed.timing, group.family.fixed.timing.period
        count, width = len(lanes), power(len(lanes))
        padded = [*lanes, *[lanes[-1]] * (width - count)]
        self.code, self.duration = np.zeros(count, np.int8), np.zeros(count)
        self.message = [VariantOutcome.DONE.sentence] * count
        self.outputs: dict[str, np.ndarray] = {}
        self.gathered: list[list[tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]]] = [[] for _ in lanes]
        self.reasons: dict[tuple[int, str], str] = {}  # why an output of a lane has no value
        self.integrals: dict[str, np.ndarray] = {}
        self.balances: dict[str, np.ndarray] = {}
        after_stop = round(AFTER_STOP / self.period)  # samples that are recorded then
        sums = jax.tree.map(
            lambda x: np.array(np.broadcast_to(np.asarray(x), (width, *np.shape(x)))),
            start_totals(self.outputs_wanted, after_stop),
        )
        sums.going[count:] = False  # the last lane again, to fill the width
        total = max(lane.built.bench.plan.samples for lane in lanes)
        drifting = sorted({name for lane in lanes for name in lane.built.bench.rig.faults.drifts()})
        own = {
            (b.seed, *(float(b.rig.faults.drifts().get(n, 0.0)) for n in drifting))
            for b in (x.built.bench for x in lanes)
        }
        seeds = len(own) > 1
        before = 0
        for part in range(len(group.family.fixed.structures)):
            leaves = group.family.stacked(padded, part)
            kernels = runner.kernels(group.family, part, seeds)
            chosen = padded if seeds else padded[:1]
            rows = NoiseRows([SensorNoise(lane.built.bench, part, drifting=drifting) for lane in chosen])
            offset = sums.samples.copy()
            told = _after(before, total, tell)
            marched = march_part(kernels, leaves, sums, rows, period=self.period, inner=self.timing.inner, tell=told)
            before = int(marched.totals.samples.max())
            self._take(kernels, leaves, part, marched, offset)
            dead = np.zeros(width, bool)
            dead[count:] = True
            dead[:count] = self.code != 0
            sums = marched.totals._replace(going=~dead, left=np.full(width, after_stop))
        self.duration[:] = sums.samples[:count] * self.period
        self._finish(sums)

    def _take(
        self, kernels: LaneKernels, leaves: Sequence[np.ndarray], part: int, found: MarchedPart, offset: np.ndarray
    ) -> None:
        for lane in range(len(self.lanes)):
            if self.code[lane]:
                continue
            if lane in found.failed:
                failed = found.failed[lane]
                self.code[lane], self.message[lane] = int(failed.outcome), failed.message
                unit = kernels.tree(_lane(leaves, kernels.kind.shared, lane))["plant"].machine.units.get(MUSCLE)
                span = self.lanes[lane].built.parts[part].start_span
                why = None if unit is None else volume_contradiction(unit.law, span)
                self.message[lane] += "" if why is None else f" {str(why)[:1].upper()}{str(why)[1:]}."
            elif lane in found.stopped:
                self.code[lane] = int(VariantOutcome.STOPPED)
                self.message[lane] = self._why(kernels, _lane(leaves, kernels.kind.shared, lane), part, lane, found)
            if found.samples:
                at = np.flatnonzero(found.counted[lane])
                samples = {n: v[lane, at] for n, v in found.samples.items()}
                self.gathered[lane].append((self.period * (offset[lane] + at), found.step[lane, at], samples))
            if kernels.kind.accounts:
                self._account(kernels, _lane(leaves, kernels.kind.shared, lane), lane, found)

    def _why(self, kernels: LaneKernels, leaves: Tree, part: int, lane: int, found: MarchedPart) -> str:
        """Why a machine stopped, in the words of `bench.run`."""
        stop = found.stopped[lane]
        if stop["code"] > 0:
            watch = kernels.tree(leaves)["software"].interlocks
            said: str = watch.reason(int(stop["code"]), stop, stop["time"])
            return said
        step = self.lanes[lane].built.parts[part].steps[int(stop["step"])]
        test = "" if step.until is None else step.until.sentence()
        waited = step.count * self.period
        return f"{step.sentence()}: {test} did not come true within {waited:.4g} s; stopped and vented"

    def _account(self, kernels: LaneKernels, leaves: Tree, lane: int, part: MarchedPart) -> None:
        begun, ended = (jax.tree.map(lambda x: x[lane], c) for c in (part.begun, part.carry))
        for name, value in ended.integrals.items():
            many = self.integrals.setdefault(name, np.zeros(len(self.lanes)))
            many[lane] += value
        wanted = [o.channel for o in self.outputs_wanted if o.reduce == "balance"]
        if not wanted:
            return
        plant, latency = kernels.tree(leaves)["plant"], float(kernels.tree(leaves)["latency"])
        first, last = (call_compiled(sampled.inputs_of, plant, c, latency, self.period) for c in (begun, ended))
        run: Any = SimpleNamespace(state=ended.state["machine"], memory=ended.memory, integrals=ended.integrals)
        closed = accounts(plant.machine, (begun.state["machine"], begun.memory), run, first, last)
        for name in wanted:
            many = self.balances.setdefault(name, np.zeros(len(self.lanes)))
            many[lane] = max(many[lane], float(getattr(closed, name)))

    def _finish(self, sums: RunningTotals) -> None:
        count = len(self.lanes)
        for one in self.outputs_wanted:
            if one.reduce == "account":
                self.outputs[one.name] = self.integrals.get(one.channel, np.full(count, np.nan))
            elif one.reduce == "balance":
                self.outputs[one.name] = self.balances[one.channel]
            elif one.reduce in LATER:
                self._of_samples(one)
            else:
                self.outputs[one.name] = final_values(one, sums.sums[one.name])[:count]
        bad = np.isin(self.code, INVALID)
        for values in self.outputs.values():
            values[bad] = np.nan
        for name, values in self.outputs.items():
            for lane in np.flatnonzero((self.code == 0) & np.isnan(values) if values.ndim == 1 else []):
                self.reasons.setdefault((int(lane), name), "no sample counts, or it does not change")
        for (at, name), why in self.reasons.items():
            self.message[at] += f" {name}: {why}." if self.code[at] == 0 else ""

    def _of_samples(self, one: Output) -> None:
        kept = []
        for lane, parts in zip(self.lanes, self.gathered, strict=True):
            pieces = []
            for part, (time, step, samples) in zip(lane.built.parts, parts, strict=False):
                inside = np.array([not one.step or s.step.label == one.step for s in part.steps])[step]
                pieces.append((time[inside], samples[one.channel][inside]))
            kept.append(tuple(np.concatenate(x) if x else np.zeros(0) for x in zip(*pieces, strict=True)))
        if one.reduce == "time_to":
            timed = [time_to(one, *x) for x in kept]
            self.outputs[one.name] = np.array([value for value, _ in timed])
            self.reasons |= {(lane, one.name): why for lane, (_, why) in enumerate(timed) if why}
            return
        if one.reduce == "drift":
            self.outputs[one.name] = np.array([drift(*x)[0] for x in kept])
            return
        longest = max(len(t) for t, _ in kept)
        for name, i in ((TIME, 0), (one.name, 1)):
            self.outputs[name] = np.stack(
                [np.pad(x[i], (0, longest - len(x[i])), constant_values=np.nan) for x in kept]
            )


def known_names(template: BuiltVariant) -> tuple[list[str], list[str]]:
    """Channels and integrals that outputs of a built variant can name."""
    fixed, leaves = template.fixed, template.leaves[0]
    kind = KernelKey(
        fixed.structures[0], (True,) * len(leaves), fixed.timing.depth, fixed.every, (), (), True, False, "auto"
    )
    row = SensorNoise(template.bench, 0).first()
    kernels = LaneKernels(kind)

    def one(own: Any) -> Any:
        tree = kernels.tree(own)
        carry = at_rest(tree["plant"], tree["software"], tree["pressure"], fixed.timing.depth, row)
        plant, software, timing = tree["plant"], tree["software"], fixed.timing
        steps = {"period": timing.period, "inner": timing.inner, "latency": tree["latency"], "stiff": False}
        _, result = sampled.sample(plant, software, carry, row, **steps)
        return channels_of(result), carry.integrals

    channels, integrals = jax.eval_shape(one, leaves)
    return sorted(channels), sorted(integrals)


def _lane(leaves: Sequence[np.ndarray], shared: Sequence[bool], lane: int) -> list[np.ndarray]:
    return [x if s else x[lane] for x, s in zip(leaves, shared, strict=True)]


def _after(before: float, total: float, tell: Tell) -> Tell:
    return lambda done: tell(min(1.0, (before + done) / total))


def _placed(so_far: np.ndarray | None, count: int, rows: Sequence[int], values: np.ndarray) -> np.ndarray:
    """Insert values of some rows among all; whole channels are padded to the longest."""
    shape = (count, *values.shape[1:])
    if so_far is None:
        so_far = np.full(shape, np.nan)
    elif so_far.ndim > 1 and so_far.shape[1] < values.shape[1]:
        so_far = np.pad(so_far, ((0, 0), (0, values.shape[1] - so_far.shape[1])), constant_values=np.nan)
    place: Any = (rows, slice(0, values.shape[1])) if values.ndim > 1 else rows
    so_far[place] = values
    return so_far
