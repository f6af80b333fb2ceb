"""The tube study: lumped models of a tube against the distributed one, with everything fixed and printed.

Chou and Hannaford compared three models with measured pressures in front of and behind 100 cm of tube into two accumulators.
Their pressures are not published. Here the distributed tube takes the place of the measurement, under three assumptions
on heat, so that a finding that hangs on one of them shows. Source: Part II of C.-P. Chou and B. Hannaford, IEEE Trans.
Robotics and Automation 12(1), 1996, doi:10.1109/70.481753.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

from .tube_cost import Cost, measure_cost
from .tube_models import Case, Model, Result, fitted, models, transferred
from .tube_records import ACCUMULATORS, LARGE, SEEDS, SMALL, THERMALS, Record, records, reference

# Fitted anew on the small accumulator as well, to see how far its parameters move.
REFITTED = ("quadratic", "inertial")
PAPERS = ("linear", "quadratic", "inertial")
QUICK_SEEDS, QUICK_THERMALS = (1,), ("wall_heat",)

Progress = Callable[[str], None]


@dataclass(frozen=True)
class TubeStudy:
    """All results, by thermal reference; `hottest` is the hottest gas in the vessels [K]."""

    records: tuple[Record, ...]
    cases: dict[tuple[str, str], tuple[Case, ...]]
    results: dict[str, tuple[Result, ...]]
    hottest: dict[tuple[str, str], float] = field(default_factory=dict)
    cost: Cost | None = None

    @property
    def thermals(self) -> tuple[str, ...]:
        """The references, in order."""
        return tuple(self.results)

    def result(self, thermal: str, model: str, accumulator: str, *, refitted: bool = False) -> Result:
        """A model's result on an accumulator; on the small one transferred, unless the refitted one is asked for.

        Raises:
            KeyError: if the study did not run it.
        """
        for r in self.results[thermal]:
            if (r.model, r.accumulator) == (model, accumulator) and (accumulator == LARGE or r.fitted == refitted):
                return r
        raise KeyError(f"{model}, {accumulator}, {thermal}")

    def has(self, model: str) -> bool:
        """Whether a model was part of it."""
        return all(any(r.model == model for r in many) for many in self.results.values())


def stages(
    *, seeds: Sequence[int] = SEEDS, thermals: Sequence[str] = THERMALS, keys: Sequence[str] | None = None
) -> int:
    """How often `tube_study` reports progress."""
    chosen = _chosen(keys)
    per_thermal = 2 * len(seeds) * len(ACCUMULATORS) + len(chosen) + sum(k in REFITTED for k in chosen)
    return len(thermals) * per_thermal + ("lumped" in chosen)


def tube_study(
    *,
    seeds: Sequence[int] = SEEDS,
    thermals: Sequence[str] = THERMALS,
    keys: Sequence[str] | None = None,
    progress: Progress | None = None,
) -> TubeStudy:
    """Run it.

    Args:
        seeds: one noise and one steps record each.
        thermals: which references.
        keys: which models, as `tube_models.models` names them; all where left out.
        progress: is told what comes next.
    """
    tell = progress or (lambda _: None)
    chosen, some = _chosen(keys), records(tuple(seeds))
    cases: dict[tuple[str, str], tuple[Case, ...]] = {}
    hottest, results = {}, {}
    for thermal in thermals:
        for accumulator in ACCUMULATORS:
            cases[thermal, accumulator], hottest[thermal, accumulator] = _answers(some, accumulator, thermal, tell)
        both = cases[thermal, LARGE], cases[thermal, SMALL]
        results[thermal] = tuple(_results(chosen, *both, functools.partial(_tell_at, tell, thermal)))
    cost = None
    if "lumped" in chosen:
        tell("timing")
        last = thermals[-1]  # whose walls take heat, which the vessel of the improved model then computes
        known = {k: next(r for r in results[last] if r.model == k) for k in ("inertial", "lumped")}
        cost = measure_cost(cases[last, LARGE][0], known)
    return TubeStudy(tuple(some), cases, results, hottest, cost)


def _tell_at(tell: Progress, thermal: str, words: str) -> None:
    tell(f"{thermal}: {words}")


def _chosen(keys: Sequence[str] | None) -> dict[str, Model]:
    known = models()
    return known if keys is None else {k: known[k] for k in keys}


def _answers(some: Sequence[Record], accumulator: str, thermal: str, tell: Progress) -> tuple[tuple[Case, ...], float]:
    found, hottest = [], 0.0
    for record in some:
        tell(f"{thermal}: distributed tube, {record.name}, {accumulator}")
        supply = record.pressure_abs()
        answer = reference(supply, ACCUMULATORS[accumulator], thermal)
        hottest = max(hottest, answer.hottest)
        found.append(Case(record, accumulator, supply, answer.pressure_abs))
    return tuple(found), hottest


def _results(chosen: dict[str, Model], large: Sequence[Case], small: Sequence[Case], tell: Progress) -> list[Result]:
    """Every model fitted on the large accumulator and taken to the small one; some fitted there as well."""
    out: list[Result] = []
    for key, model in chosen.items():
        tell(model.title)
        first = fitted(model, large)
        isothermal = next((r for r in out if r.model == "lumped_isothermal" and r.accumulator == LARGE), None)
        if key == "lumped" and isothermal is not None and isothermal.rms <= first.rms:
            first = replace(isothermal, model=key)  # the fitted records alone have chosen the vessel
        out += [first, transferred(model, first, small)]
        if key in REFITTED:
            tell(f"{model.title}, refitted")
            out.append(fitted(model, small))
    return out
