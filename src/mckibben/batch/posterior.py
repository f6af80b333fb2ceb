"""Variants drawn from the result of a fit, and a run predicted from them with the bands of its channels.

They are drawn from a fit's intervals and correlations, from its posterior, or from posterior samples of another program.
"""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..documents import JsonValue, parse_json, read_text
from ..errors import InputError
from ..identification.fit import Fit
from ..identification.posterior import Posterior
from ..muscles.law import TensionLaw
from ..muscles.laws import law_type
from ..quantities import declared, random_generator
from .outputs import Output, VariantOutcome
from .run import Runner
from .run_template import RunTemplate, Setting
from .variants import Variants

MOST_DRAWS = 1000  # for one variant within the bounds
_HEADER = re.compile(r"\s*(\S+)\s*(?:\[([^\]]*)\])?\s*")


def draws(
    mean: np.ndarray, covariance: np.ndarray, bounds: tuple[np.ndarray, np.ndarray], count: int, *, seed: int = 0
) -> np.ndarray:
    """Draw from a normal distribution within bounds, (count, n); samples outside are redrawn.

    Args:
        mean: (n,).
        covariance: (n, n).
        bounds: lowest and highest, (n,) each.
        count: count of the draws.
        seed: same seed, same draws.

    Raises:
        InputError: if nearly all draws lie outside.
    """
    chance = random_generator(seed)
    # by eigenvectors: a covariance of parameters that the data cannot tell apart has no Cholesky factor; the symmetric root,
    # which depends on no sign of theirs
    strength, directions = np.linalg.eigh(covariance)
    spread = directions * np.sqrt(np.maximum(strength, 0.0)) @ directions.T
    samples = np.empty((0, len(mean)))
    for _ in range(MOST_DRAWS):
        tried = mean + chance.standard_normal((count, len(mean))) @ spread.T
        inside = np.all((tried >= bounds[0]) & (tried <= bounds[1]), axis=1)
        samples = np.concatenate([samples, tried[inside]])
        if len(samples) >= count:
            return samples[:count]
    raise InputError("posterior", None, f"has too few draws within the declared bounds, {len(samples)} of {count}")


def of_fit(fit: Fit, count: int, *, seed: int = 0, prefix: str = "muscle.law.") -> Variants:
    """Draw variants of a muscle from the intervals and correlations of its fit.

    Raises:
        InputError: if the data do not fix a parameter.
    """
    names = list(fit.parameters)
    deviation = np.array([_deviation(n, e._asdict(), len(fit.points), len(names)) for n, e in fit.parameters.items()])
    alike = np.eye(len(names)) if fit.correlation is None else np.asarray(fit.correlation)
    fields = declared(law_type(fit.law))
    low, high = np.array([fields[n].bounds for n in names]).T
    mean = np.array([e.value for e in fit.parameters.values()])
    samples = draws(mean, alike * np.outer(deviation, deviation), (low, high), count, seed=seed)
    return Variants({prefix + n: column for n, column in zip(names, samples.T, strict=True)})


def of_json(
    path: str | os.PathLike[str],
    law: str,
    count: int,
    known: Callable[[str], Setting],
    *,
    seed: int = 0,
    muscle: tuple[str, TensionLaw] | None = None,
) -> Variants:
    """Draw variants from the output of ``mckibben fit --json``: its posterior, else intervals without correlations.

    Args:
        path: path of the file.
        law: whose fit; the first of the file where empty.
        count: count of the variants.
        known: what a path names.
        seed: same seed, same variants.
        muscle: name and law of the muscle whose parameters the samples replace.

    Raises:
        InputError: if it is no such file, has no such law, or a posterior of another muscle.
    """
    where = os.fspath(path)
    try:
        fits = parse_json(read_text(path, field="posterior.fit", form="JSON"))["fits"]
        names = [f["law"] for f in fits]
        one = fits[names.index(law or names[0])]
        parameters: Mapping[str, Mapping[str, Any]] = one["parameters"]
        points = int(one["n"])
    except (ValueError, KeyError, TypeError, IndexError):
        said = f"a fit of {law}" if law else "a fit"
        raise InputError("posterior.fit", where, f"must be what mckibben fit --json prints, with {said}") from None
    settings = {name: known(f"muscle.law.{name}") for name in parameters}
    if one.get("posterior"):
        samples = Posterior.from_dict(one["posterior"])
        if muscle is not None:
            name, own = muscle
            samples.check_muscle(own, name)
        rows = np.sort(random_generator(seed).permutation(len(samples))[: samples.rows(count).size])
        return Variants({settings[name].path: column[rows] for name, column in samples.samples.items()})
    deviation = np.array([_deviation(n, e, points, len(parameters)) for n, e in parameters.items()])
    bounds = [s.quantity.bounds if s.quantity else (-np.inf, np.inf) for s in settings.values()]
    low, high = np.array(bounds).T
    mean = np.array([float(e["value"]) for e in parameters.values()])
    drawn = draws(mean, np.diag(deviation**2), (low, high), count, seed=seed)
    return Variants({s.path: column for s, column in zip(settings.values(), drawn.T, strict=True)})


def of_samples(
    path: str | os.PathLike[str], count: int | None, known: Callable[[str], Setting], *, seed: int = 0
) -> Variants:
    """Read variants from a table with headers ``path [unit]``, a sample per row.

    Args:
        path: path of a CSV file.
        count: count of the variants, drawn without replacement; all rows in their order by default.
        known: what a path names.
        seed: same seed, same rows.

    Raises:
        InputError: names the column, the value and what is allowed.
    """
    where = os.fspath(path)
    rows = [row for row in csv.reader(io.StringIO(read_text(path, field="posterior.samples", form="CSV"))) if row]
    if len(rows) < 2:
        raise InputError("posterior.samples", where, "must be a table with a header and a row for each sample")
    columns = {}
    for i, header in enumerate(rows[0]):
        match = _HEADER.fullmatch(header)
        if match is None:
            raise InputError("header", header, "must be a path and its unit, such as end_mass [g]", where=where)
        one, unit, numbers = known(match[1]), match[2] or "", []
        for row in rows[1:]:
            if len(row) <= i:
                raise InputError("posterior.samples", where, "every row needs as many values as the header")
            value = one.read(f"{row[i].strip()} {unit}".strip(), where=where)
            if isinstance(value, str):
                raise InputError(one.path, row[i], "must be a number", where=where)
            numbers.append(value)
        columns[one.path] = np.array(numbers)
    table = Variants(columns)
    if count is None:
        return table
    if not 1 <= count <= len(table):
        said = f"must be at most {len(table)}, the samples of the table"
        raise InputError("posterior.count", count, said, where=where)
    chosen = np.sort(random_generator(seed).permutation(len(table))[:count])
    return Variants({name: values[chosen] for name, values in columns.items()})


def _deviation(name: str, estimate: Mapping[str, Any], points: int, free: int) -> float:
    """Standard error of an estimate from its 95 % interval, which is by Student's t."""
    from scipy import stats

    try:
        half = 0.5 * (float(estimate["high"]) - float(estimate["low"]))
    except TypeError:  # null where it is not finite
        half = np.inf
    if not np.isfinite(half):
        raise InputError(f"posterior.{name}", None, "must have a finite interval in the fit; the data do not fix it")
    return half / float(stats.t.ppf(0.975, max(points - free, 1)))


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
