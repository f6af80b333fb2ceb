"""Metadata of a test machine's recording: steps and events, parameters, versions, sources, saturation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .. import citations
from ..analysis.channels import saturation
from ..assembly.accounts import CLOSED, Accounts
from ..assembly.exergy_balance import document
from ..assembly.machine import Machine
from ..components.paths import resolved
from ..documents import JsonValue
from ..experiments.protocol import PlannedStep
from ..muscles.evidence import law_error
from ..muscles.law import law_name
from ..recordings.provenance import created, versions
from ..recordings.recording import Recording
from .hardware.computer import Timing
from .prepare import PreparedRun

ASKED = "asked to "  # begins the event of an operator's action


class StepTable:
    """Start and end times of the steps of a protocol, as a recording keeps them."""

    def __init__(self, period: float) -> None:
        self.period = period
        self.steps: list[dict[str, Any]] = []
        self._longest = 0.0

    def add(self, times: np.ndarray, index: np.ndarray, steps: Sequence[PlannedStep]) -> None:
        """Add samples at times [s], each in the step with an index into `steps`."""
        for j in np.unique(index):
            step, begins = steps[int(j)], float(times[np.argmax(index == j)])
            if self.steps and self.steps[-1]["index"] == step.index:
                continue
            self.end(begins)
            self._longest = step.count * self.period
            case = {k: v if isinstance(v, str) else str(v) for k, v in step.case.items()}
            self.steps.append(
                {
                    "index": step.index,
                    "path": step.path,
                    "label": step.step.label,
                    "case": case,
                    "start": begins,
                    "end": begins,
                    "ended_by": "time",
                    "recorded": step.record,
                    "sentence": step.step.sentence(),
                }
            )

    def end(self, time: float, by: str = "until") -> None:
        """End the last step at a time [s]; if that is earlier than planned, `by` names the reason."""
        if not self.steps or self.steps[-1]["end"] > self.steps[-1]["start"]:
            return
        last = self.steps[-1]
        last["end"] = time
        if time - last["start"] < self._longest - 0.5 * self.period:
            last["ended_by"] = by


def initial_metadata(bench: PreparedRun) -> dict[str, JsonValue]:
    """Compose the metadata that are known before the run."""
    protocol, rig, spec = bench.protocol, bench.rig, bench.specimen
    room = rig.environment
    said = " ".join([rig.source, protocol.source])
    return {
        "title": protocol.title,
        "sentence": protocol.sentence(),
        "protocol": protocol.document(),
        "digest": protocol.digest,
        "rig": rig.name,
        "rig_document": dict(rig.document),
        "plumbing": bench.layout,
        "specimen": None if spec is None else spec.id,
        "rest_length": bench.plan.rest_length,
        "mounting": {"muscle": bench.unit.mounting},
        "inferred": [*rig.inferred, *(spec.inferred() if spec else [])],
        "environment": {"pressure_abs": float(room.pressure_abs), "temperature": float(room.temperature)},
        "converters": _ends(bench),
        **_calibrated(bench),
        "seed": bench.seed,
        "law_error": law_error(spec, law_name(bench.unit.law)),
        "warnings": [*(f.sentence for f in bench.accepted), *bench.cautions],
        "citations": list(
            dict.fromkeys(
                [
                    *bench.unit.law.cites,
                    *(spec.sources if spec else ()),
                    *(k for k in citations.known_keys() if k in said),
                ]
            )
        ),
        "versions": versions(),
        "created": created(),
    }


def run_metadata(
    bench: PreparedRun, machine: Machine, timing: Timing, *, inner: int, closed: Sequence[Accounts], record: Recording
) -> dict[str, JsonValue]:
    """Compose the metadata of a recording, without steps, events and result.

    Args:
        bench: the run.
        machine: the last one, whose parameters are written down.
        timing: timing of the loop.
        inner: most steps of the physics per sample.
        closed: the accounts of every part; none if the machine is real.
        record: what was recorded, for its saturation.
    """
    return {
        **initial_metadata(bench),
        "parameters": resolved(machine),
        "balance": {name: max(float(getattr(a, name)) for a in closed) for name in CLOSED if closed},
        "friction": {"work": sum(a.friction for a in closed), "dissipated": sum(a.dissipated for a in closed)},
        "energy": document(machine, [a.energy_parts for a in closed]) if closed else {},
        "saturation": saturated(record, _true_ends(bench)),
        "timing": {
            "sample_rate": bench.protocol.sample_rate,
            "control_rate": timing.sample_rate,
            "latency": timing.latency,
            "step": timing.period / inner,
        },
    }


def _ends(bench: PreparedRun) -> dict[str, dict[str, float]]:
    return {
        name: {"low": float(s.converter.low), "high": float(s.converter.top), "bits": s.converter.bits}
        for name, s in bench.rig.sensors.items()
    }


def _true_ends(bench: PreparedRun) -> dict[str, dict[str, float]]:
    """Return the values that the channels measure at the ends of their converters."""
    true = bench.rig.true
    return {n: {k: float(true(n, e[k])) for k in ("low", "high")} for n, e in _ends(bench).items()}


def _calibrated(bench: PreparedRun) -> dict[str, JsonValue]:
    used = bench.rig.calibration
    return {} if used is None else {"calibration": used.plain()}


def saturated(record: Recording, converters: Mapping[str, Mapping[str, float]]) -> dict[str, JsonValue]:
    """Describe every measured channel that saturated: share, longest time [s], and a sentence."""
    saturations = {}
    for name, ends in converters.items():
        if name not in record or not np.isfinite(record[name]).all():
            continue
        # at the lower end of a range that begins at zero, zero is measured
        low = ends["low"] if ends["low"] < 0.0 else None
        one = saturation(record, name, ends=(low, ends["high"]))
        if one:
            saturations[name] = {"share": one.share, "longest": one.longest, "sentence": one.sentence}
    return saturations
