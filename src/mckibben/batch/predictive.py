"""A run predicted from a posterior: the same protocol with the parameters of many samples, and the bands of its channels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..documents import JsonValue
from ..errors import InputError
from ..identification.posterior import Posterior
from .outputs import Output, VariantOutcome
from .run import Runner
from .run_template import RunTemplate
from .variants import Variants

CHANNELS = {"tension": "N", "pressure": "Pa", "span": "m"}
FEWEST = 3  # samples whose run must end, for a band


@dataclass(frozen=True)
class PredictedRun:
    """Channels of a run from the samples of a posterior.

    Attributes:
        time: of the samples [s] (n,).
        channels: by name [SI], a row per sample of the posterior (d, n).
        failed: why the run of a sample did not end, one sentence each.
    """

    time: np.ndarray
    channels: dict[str, np.ndarray]
    failed: tuple[str, ...]

    @staticmethod
    def unit(channel: str) -> str:
        """SI unit of a channel."""
        return CHANNELS[channel]

    def band(self, channel: str, confidence: float = 0.95) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Lower end, median and upper end of a channel at each time (n,)."""
        tail = 0.5 - 0.5 * confidence
        low, middle, high = np.quantile(self.channels[channel], (tail, 0.5, 1.0 - tail), axis=0)
        return low, middle, high

    def summary(self) -> dict[str, JsonValue]:
        """Median and 95 % interval of the lowest, mean and highest value of each channel [SI]."""
        summary: dict[str, JsonValue] = {}
        for channel, rows in self.channels.items():
            reduced = {"min": rows.min(axis=1), "mean": rows.mean(axis=1), "max": rows.max(axis=1)}
            quantiles = {name: np.quantile(values, (0.025, 0.5, 0.975)).tolist() for name, values in reduced.items()}
            ends = {name: dict(zip(("low", "median", "high"), q, strict=True)) for name, q in quantiles.items()}
            summary[channel] = {"unit": CHANNELS[channel]} | ends
        return summary


def predict_run(
    template: RunTemplate, posterior: Posterior, count: int, *, progress: Callable[[float], None] = lambda _: None
) -> PredictedRun:
    """Run a protocol with the parameters of some samples of a posterior.

    The discrepancy of the law at the length and pressure of each instant is added to the tension, with the mean and the
    standard deviation that follow from the data; it does not act back on the motion. Where tension moves the machine, the
    span is that of the law alone.

    Args:
        template: the run; its muscle has the law of the posterior.
        posterior: samples of the law's parameters.
        count: count of the samples, evenly from all of them.
        progress: told the share of the work that is done.

    Raises:
        InputError: the muscle has another law, or too few of the runs end.
    """
    rows = posterior.rows(count)
    columns = {f"muscle.law.{name}": column[rows] for name, column in posterior.samples.items()}
    settings = {path: template.setting(path, where="posterior") for path in columns}
    outputs = tuple(Output(name, "samples", name) for name in CHANNELS)
    template = replace(template, settings={**template.settings, **settings}, outputs=outputs)
    ranges = {path: (float(v.min()), float(v.max())) for path, v in columns.items()}
    results = Runner(template, ranges).run(Variants(columns), progress)
    done = results.code == VariantOutcome.DONE
    failed = tuple(dict.fromkeys(message for message, ok in zip(results.message, done, strict=True) if not ok))
    if done.sum() < min(FEWEST, count):
        raise InputError("posterior", None, f"leaves no run that ends: {failed[0]}")
    whole = ~np.isnan(results.outputs["tension"][done]).any(axis=0)  # until the first run ended
    channels = {name: results.outputs[name][done][:, whole] for name in CHANNELS}
    kept = rows[done]
    mean, deviation = posterior.discrepancy_along(kept, channels["span"], channels["pressure"])
    # one draw for all instants of a run: a law that is too weak is so throughout
    share = np.random.default_rng(posterior.seed).standard_normal((len(kept), 1))
    channels["tension"] = np.maximum(channels["tension"] + mean + deviation * share, 0.0)
    time = results.outputs["time"]
    return PredictedRun(time[done][0][whole] if time.ndim > 1 else time[whole], channels, failed)
