"""A table to be fitted as links and commands state it, its reading, and the fits, made one by one in a thread."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import threading
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from ....documents import JsonValue, parse_json
from ....errors import InputError, MckibbenError
from ....formats.registry import part_options, parts_of
from ....identification import Fit
from ....identification.fit import SCHEMES, fit, rank
from ....identification.ranking import Ranking, known_of, published_of
from ....muscles.laws import LAWS, law_type
from ....quantities import declared, parse
from ....recordings import ForceMap, read_any, read_force_map
from ....recordings.force_map import TablePreview, preview_table
from ....specimens import Specimen, map_file, specimen
from ...reader import check_rows
from ...shelf import SharedResults
from ...widgets import sentence
from ...workspace import Workspace

KINDS = ("table", "recording", "map")  # an uploaded file, one of the recordings, a specimen that ships with a map
PAIRS = ("columns", "units", "known")
WORDS = ("part", "rest", "like", "branch", "zero", "below")
MOST_ROWS = 50_000  # of a table that is fitted
LINK = (*KINDS, *PAIRS, *WORDS, "slack", "laws", "law", "view")


@dataclass(frozen=True)
class FitRequest:
    """A table and how to read it, as text; equal ones give equal fits.

    Attributes:
        columns: what a column holds, and its cell of the header; over what the header says.
    """

    kind: str  # one of `KINDS`
    name: str  # name of the file or the specimen
    columns: tuple[tuple[str, str], ...] = ()
    units: tuple[tuple[str, str], ...] = ()  # what a column holds, and its unit as text; over what the header says
    known: tuple[tuple[str, str], ...] = ()  # parameters that are not fitted, with their values as text
    part: str = ""  # sheet of a spreadsheet, or topic of a bag; the only one with numbers where empty
    rest: str = ""  # rest length as text
    like: str = ""  # a specimen whose dimensions are known
    branch: str = ""  # branch of the rows that are kept
    zero: str = ""  # what the pressure reads at zero, as text
    below: str = ""  # gauge pressure up to which a separate fit is trained, as text
    slack: bool = True  # use slack points to say where a law may not pull

    def link(self) -> dict[str, str | None]:
        """Parameters of an address."""
        parameters: dict[str, str | None] = {kind: self.name if kind == self.kind else None for kind in KINDS}
        for key in PAIRS:
            pairs = dict(getattr(self, key))
            parameters[key] = json.dumps(pairs, separators=(",", ":"), ensure_ascii=False) if pairs else None
        return {**parameters, **{w: getattr(self, w) or None for w in WORDS}, "slack": None if self.slack else "no"}

    def with_pair(self, key: str, name: str, words: str | None) -> FitRequest:
        """Return a copy with one column, unit or known parameter set or removed."""
        pairs = {k: v for k, v in getattr(self, key) if k != name}
        new: dict[str, Any] = {key: tuple(sorted({**pairs, **({name: words} if words else {})}.items()))}
        return dataclasses.replace(self, **new)


def from_link(words: Mapping[str, str]) -> FitRequest | None:
    """Read the request from an address; None if it names no table."""
    kind = next((k for k in KINDS if words.get(k)), None)
    if kind is None:
        return None
    pairs: dict[str, Any] = {}
    for key in PAIRS:
        table: object = None
        with contextlib.suppress(ValueError, RecursionError):  # an address that somebody changed says nothing
            table = parse_json(words[key]) if words.get(key) else None
        pairs[key] = tuple(sorted((str(k), str(v)) for k, v in table.items())) if isinstance(table, dict) else ()
    more: dict[str, Any] = {w: words.get(w, "") for w in WORDS}
    return FitRequest(kind, words[kind], **pairs, **more, slack=words.get("slack") != "no")


def specimen_of(asked: FitRequest) -> Specimen | None:
    """Specimen of the map, or the one with the known dimensions."""
    name = asked.name if asked.kind == "map" else asked.like
    return specimen(name) if name else None


def file_of(workspace: Workspace, asked: FitRequest) -> Path:
    """Path of the table."""
    if asked.kind == "map":
        return map_file(specimen(asked.name))
    return (workspace.uploads if asked.kind == "table" else workspace.recordings).found(asked.name)


def read(path: Path, asked: FitRequest) -> ForceMap:
    """Read the table of a file as a force map, as the command ``fit`` does."""
    rest = parse(asked.rest, "m", field="rest length") if asked.rest else None
    spec = specimen_of(asked)
    if asked.kind == "map" and spec is not None:
        rest = rest or spec.property_si("rest_length", "m")
    zero = parse(asked.zero, "Pa", field="pressure zero") if asked.zero else 0.0
    try:
        return read_force_map(
            path,
            rest_length=rest,
            columns=dict(asked.columns),
            units=dict(asked.units),
            branch=asked.branch or None,
            pressure_zero=zero,
            **part_options(path, asked.part),
        )
    except InputError as error:  # the file by its name, not by its path on the server
        raise error.changed(where=path.name) from None


def known_values(asked: FitRequest) -> dict[str, float]:
    """Parameters that are not fitted [SI]: of the specimen, then stated ones."""
    dimensions_known, fields = known_of(specimen_of(asked)), dimensions()
    for name, words in asked.known:
        if name not in fields:
            raise InputError(name, words, known=fields)
        dimensions_known[name] = parse(words, fields[name].unit, field=name)
        fields[name].check(name, dimensions_known[name])
    return dimensions_known


def dimensions() -> dict[str, JsonValue]:
    """Dimensions of a muscle that can be stated for a fit: declared by laws, and stated by specimens."""
    names = ("rest_diameter", "wall_thickness")
    every = {k: q for law in LAWS for k, q in declared(law_type(law)).items()}
    return {name: every[name] for name in names if name in every}


_pool = ThreadPoolExecutor(2, thread_name_prefix="fit")
_results = SharedResults(200)  # of all pages: a fit, or why there is none


class _StoppedError(Exception):
    """The user stopped the work."""


class FitJob:
    """Fits of one page."""

    def __init__(self, workspace: Workspace) -> None:
        self._workspace, self._stop = workspace, threading.Event()
        # A fit ends or is stopped: what comes late is not of the table that came meanwhile.
        self._lock = threading.Lock()
        self.fits: dict[str, Fit] = {}
        self.skipped: dict[str, str] = {}
        self.words, self.version, self.running = "", 0, False
        self.failed, self.ended = "", False
        self._done, self._total, self._began = 0, 1, 0.0
        self._key: Any = None

    @property
    def share(self) -> float:
        """Completed share of the work."""
        return min(1.0, self._done / self._total)

    @property
    def left(self) -> float | None:
        """Remaining time [s], as soon as it can be estimated."""
        gone = time.monotonic() - self._began
        return gone * (1.0 - self.share) / self.share if self.share > 0.05 and gone > 1.0 else None

    def start(self, asked: FitRequest, points: ForceMap, laws: Sequence[str]) -> None:
        """Fit the requested laws that are missing, and stop others."""
        self.stop()  # from now on the work before leaves everything as it is
        path = file_of(self._workspace, asked)
        key = (str(path), path.stat().st_mtime_ns, asked)
        if key != self._key:
            self._key, self.fits, self.skipped = key, {}, {}
        self.failed = ""
        for law in laws:
            self._take(law, _results.known((key, law)))
        missing = [law for law in laws if law not in self.fits and law not in self.skipped]
        self.version += 1
        if missing:
            self._stop, self.running, self.words = threading.Event(), True, ""
            self._done, self._total, self._began = 0, len(missing) * (1 + len(SCHEMES)), time.monotonic()
            _pool.submit(self._go, self._stop, key, asked, points, missing)

    def stop(self) -> None:
        """Stop fitting, and keep the results so far."""
        with self._lock:
            self._stop.set()
            self.running = False
            self.version += 1

    def end(self) -> None:
        """End the work, when the page is closed or the server ends."""
        self.ended = True
        self.stop()

    def study(self, asked: FitRequest, points: ForceMap, laws: Sequence[str]) -> Ranking:
        """Return the results so far, ranked as the command does."""
        spec = specimen_of(asked)
        return Ranking(
            title=spec.title if spec else points.name,
            specimen=spec,
            points=points,
            fits=rank(self.fits[law] for law in laws if law in self.fits),
            published=published_of(spec, points),
            skipped={law: self.skipped[law] for law in laws if law in self.skipped},
        )

    def _take(self, law: str, result: Any) -> None:
        if isinstance(result, str):
            self.skipped[law] = result
        elif result is not None:
            self.fits[law] = result

    def _go(self, stop: threading.Event, key: Any, asked: FitRequest, points: ForceMap, laws: list[str]) -> None:
        def tell(words: str) -> None:
            if stop.is_set():
                raise _StoppedError
            self.words, self._done = words, self._done + 1
            self.version += 1

        failed = ""
        try:
            known = known_values(asked)
            below = parse(asked.below, "Pa", field="train below") if asked.below else None
            for law in laws:
                if stop.is_set():
                    return
                self.words = law
                try:
                    result: Any = fit(law, points, known=known, slack=asked.slack, train_below=below, progress=tell)
                except MckibbenError as error:
                    result = str(error)
                _results.put((key, law), result)
                with self._lock:
                    if stop.is_set():
                        return
                    self._take(law, result)
                    self.version += 1
        except _StoppedError:
            return
        except Exception as error:  # only this fit fails; the server and the other pages go on
            failed = str(error) or type(error).__name__
        with self._lock:
            if not stop.is_set():
                self.failed, self.running = failed, False
                self.version += 1


class TableReading(NamedTuple):
    """Result of reading a table."""

    look: TablePreview  # into the file
    size: int
    points: ForceMap | None  # the table; nothing if it was refused
    wrong: InputError | None  # why it was refused
    asked: FitRequest  # how it was read in the end
    parts: list[str] = []  # names of its sheets or topics, where it has several


def look_and_read(path: Path, asked: FitRequest) -> TableReading:
    """Look into a file, of `file_of`, and read it."""
    check_rows(path, MOST_ROWS, "a fit")
    _, parts = parts_of(path)
    look, refused = None, None
    for part in [asked.part] if asked.part else ["", *parts]:  # where none is chosen, the first one with a table
        try:
            look, asked = preview_table(path, **part_options(path, part)), dataclasses.replace(asked, part=part)
            break
        except InputError as error:
            refused = refused or error
    if look is None:
        assert refused is not None
        raise refused.changed(where=path.name) from None
    if asked.kind == "recording":  # which states its rest length, and of a real machine the span for the length
        spans = [c for c in look.header if c.split(" [")[0] in ("span", "muscle.span")]
        if not {"length", "contraction"} & {*look.meant, *dict(asked.columns)} and spans:
            asked = asked.with_pair("columns", "length", spans[0])
        rest = read_any(path).recording.meta.get("rest_length")
        if not asked.rest and isinstance(rest, float):
            asked = dataclasses.replace(asked, rest=f"{100.0 * rest:.10g} cm")
    points, wrong = None, None
    try:
        points = read(path, asked)
    except InputError as error:
        wrong = error
    return TableReading(look, path.stat().st_size, points, wrong, asked, parts)


def used(points: ForceMap, asked: FitRequest) -> str:
    """Describe which rows count."""
    taut = int(points.taut.sum())
    slack, informative = len(points) - taut, int(points.informative_slack.sum())
    left = "".join(f" {sentence(remark)}" for remark in points.remarks)
    if not slack:
        return f"{taut} rows used.{left}"
    noun = "row reads" if slack == 1 else "rows read"
    use = f"; {informative} of them ask the laws for zero tension" if asked.slack and informative else ""
    return (
        f"{taut} rows used. {slack} {noun} zero tension: the muscle is slack there, so errors do not count them{use}."
        + left
    )
