"""A sweep as its file states it: what would be run, and what became of its variants."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ..answers import Answer, Caution, Column, Table
from ..assembly.build import rig_unit, with_parameters
from ..batch import VariantOutcome
from ..batch.drive import SweepReport, Workers, run_sweep
from ..batch.sweep import Sweep, read_sweep
from ..documents import JsonValue
from ..muscles.evidence import interval_remarks, law_error
from ..quantities import with_unit
from ..verbs import ResultFolder, SchedulerName, SweepFile, WorkerCount, verb

WORDS = 8  # of a column that a person is shown


@dataclass(frozen=True)
class SweepPlan(Answer):
    """What a sweep would run: what `sweep_variants` says of a dry run.

    Attributes:
        sweep: with its variants.
        duration: of the first variant [s].
    """

    sweep: Sweep
    duration: float

    def _columns(self) -> dict[str, dict[str, Any]]:
        """Unit and range of each varied number [SI], or the words of what is none."""
        columns: dict[str, Any] = {}
        for path, values in self.sweep.variants.columns.items():
            ends = self.sweep.ranges.get(path)
            words = list(dict.fromkeys(values)) if ends is None else []
            columns[path] = {"unit": self.sweep.template.settings[path].unit, "range": ends, "words": words}
        return columns

    def to_dict(self) -> dict[str, JsonValue]:
        """Number of variants, their parameters and outputs, and the hash of the sweep."""
        return {
            "result": "ready",
            "variants": len(self.sweep.variants),
            "duration": self.duration,
            "hash": self.sweep.digest,
            "parameters": self._columns(),
            "outputs": [o.name for o in self.sweep.template.outputs],
        }

    def tables(self) -> list[Table]:
        """The parameters that are varied."""
        rows = []
        for path, column in self._columns().items():
            more = " .." if len(column["words"]) > WORDS else ""
            words = ", ".join(column["words"][:WORDS]) + more
            if column["range"] is not None:
                words = " to ".join(with_unit(end, column["unit"] or "1") for end in column["range"])
            rows.append({"parameter": path, "values": words})
        count, title = len(self.sweep.variants), self.sweep.template.protocol.title
        heading = f"{count:,} variants of {title!r}, the first of {self.duration:.4g} s."
        return [Table(heading, (Column("parameter"), Column("values")), rows)]

    def remarks(self) -> list[str]:
        """The outputs that are kept."""
        return [f"Kept: {', '.join(o.name for o in self.sweep.template.outputs)}"]


@dataclass(frozen=True)
class SweepResults(Answer):
    """What became of the variants of a sweep: what `sweep_variants` computes.

    Attributes:
        sweep: with its variants.
        report: counts, speed and path of the results.
        cautions: of outputs that variants have no value of.
    """

    sweep: Sweep
    report: SweepReport
    cautions: tuple[Caution, ...] = ()

    def to_dict(self) -> dict[str, JsonValue]:
        """How many variants ended how, the speed, and the path of the results."""
        names = ("runs", "failed", "unmeasured", "store", "new", "codes", "seconds")
        content = {name: getattr(self.report, name) for name in names} | {"law_error": self._law_errors()}
        said = [one.text for one in self.cautions]
        return content | {"warnings": said, "muscle_seconds_per_second": self.report.rate}

    def tables(self) -> list[Table]:
        """How many variants ended how."""
        rows = [
            {"code": name.replace("_", " "), "count": f"{n:,}", "about": VariantOutcome[name.upper()].sentence}
            for name, n in self.report.codes.items()
        ]
        columns = (Column("code", ""), Column("count", "", right=True), Column("about", ""))
        title = self.sweep.title or self.sweep.template.protocol.title
        return [Table(f"{title}: {self.report.runs:,} variants", columns, rows)]

    def remarks(self) -> list[str]:
        """The speed of what was run now, the intervals of the muscles' tensions, and where the results are."""
        report = self.report
        speed = f"{report.new:,} run now, {report.rate:.3g} s of muscle per second."
        said = [speed] if report.new else []
        return [*said, *interval_remarks(self._law_errors()), f"Written: {report.store}"]

    def _law_errors(self) -> dict[str, Any]:
        """What is known of the tension of each muscle that a variant may name, at that end of its numbers with less."""
        template, errors = self.sweep.template, {}
        for name, spec in template.specimens.items():
            ends = []
            for end in (0, 1):
                numbers = dict(template.given) | {path: pair[end] for path, pair in self.sweep.ranges.items()}
                of_muscle = {p.removeprefix("muscle."): v for p, v in numbers.items() if p.startswith("muscle.")}
                cut, unit = with_parameters(spec, rig_unit(spec), of_muscle)
                ends.append(law_error(cut, unit.law) or {})
            errors[name] = max(ends, key=lambda one: (bool(one.get("own")), one.get("at_rest_length") or 0.0))
        return errors

    def failure(self) -> str | None:
        """Empty where a variant did not reach its end or lacks an output, which the table and the cautions say."""
        return "" if self.report.failed or self.report.unmeasured else None


@verb
def sweep_variants(
    sweep: SweepFile,
    *,
    out: ResultFolder,
    scheduler: SchedulerName = "dask",
    workers: WorkerCount = 0,
    dry_run: bool = False,
    progress: Callable[[float, int], None] | None = None,
    stored: Callable[[int, int], None] | None = None,
) -> SweepPlan | SweepResults:
    """Run a protocol on many variants of a rig and a muscle; resumable, results in zarr.

    Args:
        sweep: sweep file with the variants and the outputs to keep.
        out: folder of the results; an interrupted sweep resumes from it.
        scheduler: where variants run: Dask or a pool of processes on this machine, this process, or a Dask scheduler such
            as tcp://host:8786.
        workers: number of processes on this machine; 0 for one per core.
        dry_run: report what would be run, without running it.
        progress: told how many variants are done, and how many there are.
        stored: told how many variants the store holds, and how many there are.

    Raises:
        InputError: the file, the scheduler or the store does not fit.
        MissingLibraryError: the extra ``sweep`` is not installed.
        ConvergenceError: some variants kill every worker.
    """
    wanted = sweep if isinstance(sweep, Sweep) else read_sweep(sweep)
    team = Workers(scheduler, workers)
    if dry_run:
        return SweepPlan(wanted, wanted.check().bench.plan.duration)

    def keep(count: int) -> None:
        if stored is not None:
            stored(count, len(wanted.variants))

    tell = progress or (lambda done, total: None)
    report = run_sweep(wanted, out, workers=team, progress=tell, stored=keep)
    return SweepResults(wanted, report, report.cautions)
