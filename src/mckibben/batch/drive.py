"""Execution of sweeps: checks, block-wise storage, and resumption."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..answers import Caution, brief
from .outputs import VariantOutcome, codes_of
from .store import opened, zarr_library
from .sweep import Sweep
from .workers import SweepJob, VariantBlock, Workers

Progress = Callable[[float, int], None]  # variants that are done, of all


class SweepReport(NamedTuple):
    """Result of a sweep.

    Attributes:
        runs: variants with a result.
        new: number of those run by this call.
        failed: whose result is none that reached its end.
        unmeasured: variants that reached their end and have no value of an output, their places by its name.
        cautions: of those, with the reason of the first.
        codes: how many have each result code, by its name.
        store: path of the results.
        seconds: that this call took [s].
        muscle_seconds: simulated by this call [s].
    """

    runs: int
    new: int
    failed: int
    unmeasured: dict[str, list[int]]
    cautions: tuple[Caution, ...]
    codes: dict[str, int]
    store: str
    seconds: float
    muscle_seconds: float

    def __repr__(self) -> str:
        return brief(self)

    @property
    def rate(self) -> float:
        """Simulated seconds per second."""
        return self.muscle_seconds / self.seconds if self.new else 0.0


def run_sweep(
    sweep: Sweep,
    out: str | os.PathLike[str],
    *,
    workers: Workers | None = None,
    progress: Progress = lambda done, total: None,
    stored: Callable[[int], None] = lambda count: None,
) -> SweepReport:
    """Run the variants that the store in a folder does not have yet.

    A keyboard interrupt leaves a store from which the next call goes on.

    Args:
        sweep: the sweep to run.
        out: folder.
        workers: where; a Dask cluster on this machine by default.
        progress: told how far it is.
        stored: told how many variants the store holds, whenever that changes.

    Raises:
        MissingLibraryError: before anything is computed, if the extra ``sweep`` is not installed.
        InputError: as `Sweep.check` and `store.opened`; or a scheduler that does not answer, before anything runs.
        ConvergenceError: if some variants kill every worker.
    """
    begun = time.perf_counter()
    team_of = workers or Workers()
    zarr_library()
    team_of.check_libraries()
    first = sweep.check()
    plan = first.bench.plan
    block = sweep.sized(team_of.count, plan.samples, plan.duration)
    new, simulated = 0, 0.0
    with opened(out, sweep, block) as store:
        todo = [VariantBlock(part, sweep.variants[part]) for part in store.missing()]
        already = store.count - sum(b.part.stop - b.part.start for b in todo)
        progress(already, store.count)
        stored(already)
        if todo:
            job = SweepJob.of(sweep, threads=0 if team_of.way == "serial" else 1)
            with team_of.open() as team:
                sizes = [b.part.stop - b.part.start for b in todo]

                def tell(share: float) -> None:
                    progress(already + new + share * sizes[0], store.count)

                for done, block_results in team.run(job, todo, tell):
                    store.write(done.part, block_results)
                    new += len(block_results.code)
                    stored(already + new)
                    simulated += float(np.sum(block_results.duration))
                    progress(already + new, store.count)
        results = store.measured()
    codes = results.code
    there = codes != VariantOutcome.NOT_RUN
    return SweepReport(
        runs=int(there.sum()),
        new=new,
        failed=int((there & (codes != VariantOutcome.DONE)).sum()),
        unmeasured={n: u.tolist() for n in results.outputs if (u := results.unmeasured(n)).size},
        cautions=results.cautions,
        codes=codes_of(codes),
        store=str(store.path),
        seconds=time.perf_counter() - begun,
        muscle_seconds=simulated,
    )
