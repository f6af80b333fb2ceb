"""Execution of sweeps: checks, block-wise storage, resumption, and the workers on which blocks are run.

Blocks are run in one process, in several, or on a Dask cluster. The caller gets results one after the other and writes
them; workers write nothing, so that nothing is written twice, and no block is lost when a worker fails. A block whose
worker dies is given to another one, a few times: then it is the block that kills them.
"""

from __future__ import annotations

import contextlib
import itertools
import logging
import os
import pickle
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from .._jax import Tree
from ..answers import Caution, brief
from ..errors import ConvergenceError, InputError, choice
from ..extras import library
from .outputs import VariantOutcome, codes_of
from .run import Results, Runner, Tell
from .store import opened, zarr_library
from .sweep import Sweep
from .variants import Variants

WAYS = ("dask", "processes", "serial")
ATTEMPTS = 4  # of a block whose workers die
AHEAD = 2  # blocks per worker that wait for one
PATIENCE = 10.0  # until a scheduler has answered [s]
GATHERED = 300.0  # until a result that is there has come, or else is asked for again [s]


class BlockWork(Protocol):
    """Work on a block of variants; it is sent with each block, since the worker may be a new one."""

    def run(self, block: VariantBlock, tell: Tell = ...) -> Results:
        """Compute the results of a block."""

    @property
    def name(self) -> str:
        """Name of the work, equal for all its blocks."""


class SweepJob(NamedTuple):
    """Computation of the blocks of a sweep.

    Attributes:
        name: hash of the sweep.
        template: pickled.
        ranges: ranges of the varied numbers.
        engine: that compiles the lanes.
        threads: threads of native kernels; all cores where 0.
    """

    name: str
    template: bytes
    ranges: Mapping[str, tuple[float, float]]
    engine: str
    threads: int = 1

    @classmethod
    def of(cls, sweep: Sweep, threads: int) -> SweepJob:
        """Job of a sweep; a worker that shares a machine with others has one thread."""
        return cls(sweep.digest, pickle.dumps(sweep.template), dict(sweep.ranges), sweep.engine, threads)

    def run(self, block: VariantBlock, tell: Tell = lambda _: None) -> Results:
        """Compute the results of a block; functions compiled for the sweep are kept for the next one."""
        with _one_at_a_time:  # a worker may have threads
            if self.name not in _runners:
                _runners.clear()
                template = pickle.loads(self.template)
                _runners[self.name] = Runner(template, self.ranges, engine=self.engine, threads=self.threads)
            return _runners[self.name].run(block.variants, tell)


class VariantBlock(NamedTuple):
    """A range of variants."""

    part: slice
    variants: Variants


Done = tuple[VariantBlock, Results]
_runners: dict[str, Runner] = {}
_one_at_a_time = threading.Lock()


@dataclass
class Workers:
    """Choice of the workers on which blocks are run.

    Attributes:
        way: one of `WAYS`, or the address of a Dask scheduler, such as ``tcp://node1:8786``.
        count: count of worker processes on this machine; as many as cores where 0.
    """

    way: str = "dask"
    count: int = 0

    def __post_init__(self) -> None:
        if self.way not in WAYS and "://" not in self.way:
            raise InputError("scheduler", self.way, f"must be {choice(WAYS)}, or an address such as tcp://host:8786")
        if self.count < 0:
            raise InputError("workers", self.count, "must be a whole number above 0")
        self.count = 1 if self.way == "serial" else self.count or cores()

    def check_libraries(self) -> None:
        """Refuse a kind of worker whose libraries are not installed, before any computation.

        Raises:
            MissingLibraryError: one of them is not installed.
        """
        if self.way not in ("serial", "processes"):
            _dask_libraries()

    @contextlib.contextmanager
    def open(self) -> Iterator[WorkerTeam]:
        """Open a team of workers.

        Raises:
            InputError: if a library is missing, or no scheduler answers.
        """
        if self.way == "serial":
            yield SerialTeam()
        elif self.way == "processes":
            yield ProcessTeam(self.count)
        else:
            with _client(self.way, self.count) as client:
                yield DaskTeam(client)


class WorkerTeam:
    """A team of workers that computes blocks."""

    size = 1

    def run(self, work: BlockWork, blocks: Sequence[VariantBlock], tell: Tell) -> Iterator[Done]:
        """Results of every block, in the order of completion.

        Args:
            work: that is done with each.
            blocks: blocks of its variants.
            tell: told the share of a block that is done, where the blocks are run here.

        Raises:
            ConvergenceError: if a block kills every worker.
        """
        raise NotImplementedError


class SerialTeam(WorkerTeam):
    """Workers in this process, one block after the other."""

    def run(self, work: BlockWork, blocks: Sequence[VariantBlock], tell: Tell) -> Iterator[Done]:
        """Run the blocks, see `WorkerTeam.run`."""
        return ((block, work.run(block, tell)) for block in blocks)


class ProcessTeam(WorkerTeam):
    """A pool of processes on this machine; a process that dies is replaced."""

    def __init__(self, size: int) -> None:
        self.size = size

    def run(self, work: BlockWork, blocks: Sequence[VariantBlock], tell: Tell) -> Iterator[Done]:
        """Run the blocks, see `WorkerTeam.run`."""
        import multiprocessing
        from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, ProcessPoolExecutor, wait

        waiting = [(block, 0) for block in reversed(blocks)]
        spawn = multiprocessing.get_context("spawn")
        while waiting:
            others = set(multiprocessing.active_children())
            pool = ProcessPoolExecutor(min(self.size, len(waiting)), mp_context=spawn, initializer=_quiet)
            at_work: dict[Future[Results], tuple[VariantBlock, int]] = {}
            try:
                while waiting or at_work:
                    while waiting and len(at_work) < AHEAD * self.size:
                        block, tried = waiting[-1]
                        at_work[pool.submit(work.run, block)] = (block, tried)
                        waiting.pop()  # not before: a pool that just broke takes nothing
                    for future in wait(at_work, return_when=FIRST_COMPLETED).done:
                        results = future.result()
                        yield at_work.pop(future)[0], results
            except BrokenExecutor:
                for future, (block, tried) in at_work.items():
                    if future.done() and not future.cancelled() and future.exception() is None:
                        yield block, future.result()
                    else:
                        if tried + 1 >= ATTEMPTS:
                            raise ConvergenceError(_deadly(block)) from None
                        waiting.append((block, tried + 1))
            finally:
                for child in set(multiprocessing.active_children()) - others:
                    child.terminate()
                pool.shutdown(cancel_futures=True)  # its own thread takes leave of them


class DaskTeam(WorkerTeam):
    """Workers of a Dask cluster."""

    def __init__(self, client: Any) -> None:
        self.client = client
        self.size = max(1, len(client.scheduler_info(n_workers=-1)["workers"]))

    def run(self, work: BlockWork, blocks: Sequence[VariantBlock], tell: Tell) -> Iterator[Done]:
        """Run the blocks, see `WorkerTeam.run`."""
        from distributed import as_completed
        from distributed.scheduler import KilledWorker

        waiting = list(reversed(blocks))
        at_work: dict[str, tuple[VariantBlock, Any]] = {}
        number = itertools.count()

        def more() -> list[Any]:
            futures = []
            while waiting and len(at_work) < (AHEAD + 1) * self.size:
                block = waiting.pop()
                key = f"mckibben-{work.name[:12]}-{os.getpid()}-{next(number)}"
                future = self.client.submit(work.run, block, pure=False, key=key, retries=0)
                at_work[key] = (block, future)
                futures.append(future)
            return futures

        queue = as_completed(more())
        try:
            for future in queue:
                block, _ = at_work.pop(future.key)
                try:
                    yield block, future.result(timeout=GATHERED)
                except KilledWorker:
                    raise ConvergenceError(_deadly(block)) from None
                except TimeoutError:  # it was done, and lost with its worker before it was here
                    self.client.cancel([future], force=True)
                    waiting.append(block)
                future.release()
                queue.update(more())
        finally:
            self.client.cancel([future for _, future in at_work.values()])


def _dask_libraries() -> tuple[Tree, Tree]:
    use, instead = "Sweeps on Dask need", "--scheduler processes does without it"
    return library("dask", use, instead=instead), library("distributed", use, instead=instead)


@contextlib.contextmanager
def _client(way: str, count: int) -> Iterator[Any]:
    dask, distributed = _dask_libraries()
    settings = {
        "distributed.scheduler.allowed-failures": ATTEMPTS - 1,
        "distributed.worker.memory.terminate": False,
        "distributed.comm.timeouts.connect": f"{PATIENCE:g}s",
    }
    with dask.config.set(settings), contextlib.ExitStack() as after:
        # The log of failing workers, which are handled here.
        logger = logging.getLogger("distributed")
        after.callback(logger.setLevel, logger.level)
        logger.setLevel(logging.CRITICAL + 1)
        if way != "dask":
            try:
                client = distributed.Client(way, timeout=PATIENCE)
            except (OSError, ValueError, TimeoutError):
                said = f"no Dask scheduler answered there within {PATIENCE:g} s"
                raise InputError("scheduler", way, said) from None
            with client:
                yield client
            return
        with (
            distributed.LocalCluster(
                n_workers=count,
                threads_per_worker=1,
                dashboard_address=None,
                memory_limit=0,
                env={"DASK_LOGGING__DISTRIBUTED": "critical"},
            ) as cluster,
            distributed.Client(cluster) as client,
        ):
            yield client


def _deadly(block: VariantBlock) -> str:
    part = block.part
    return (
        f"The workers that had variants {part.start} to {part.stop - 1} died, {ATTEMPTS} times; what other blocks gave is "
        "stored. Smaller blocks need less memory"
    )


def _quiet() -> None:
    """Ignore Ctrl-C in a worker; the process that waits for the workers handles it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def cores() -> int:
    """Number of processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


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
