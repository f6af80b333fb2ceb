"""Background work of the Fit page: reading tables, and fitting laws one by one in a thread."""

from __future__ import annotations

import dataclasses
import threading
import time
from collections import OrderedDict
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from ....errors import InputError, MckibbenError
from ...reader import check_rows
from ...workspace import Workspace
from . import state
from .state import FitRequest

if TYPE_CHECKING:
    from ....identification import Fit
    from ....identification.ranking import Ranking
    from ....recordings import ForceMap
    from ....recordings.force_map import TablePreview

KEPT = 200  # fits that are kept of all pages
_pool = ThreadPoolExecutor(2, thread_name_prefix="fit")
_kept: OrderedDict[Any, Any] = OrderedDict()
_lock = threading.Lock()


class _StoppedError(Exception):
    """The user stopped the work."""


class FitJob:
    """Fits of one page.

    Args:
        workspace: whose tables are fitted.

    Attributes:
        fits: by law.
        skipped: why a law could not be fitted, by law.
        words: label of the work.
        version: changes with every step.
    """

    def __init__(self, workspace: Workspace) -> None:
        self._workspace, self._stop = workspace, threading.Event()
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
        self.stop()
        path = state.file_of(self._workspace, asked)
        key = (str(path), path.stat().st_mtime_ns, asked)
        if key != self._key:
            self._key, self.fits, self.skipped = key, {}, {}
        self.failed = ""
        for law in laws:
            self._take(law, _found(key, law))
        missing = [law for law in laws if law not in self.fits and law not in self.skipped]
        self.version += 1
        if missing:
            from ....identification.fit import SCHEMES

            self._stop, self.running, self.words = threading.Event(), True, ""
            self._done, self._total, self._began = 0, len(missing) * (1 + len(SCHEMES)), time.monotonic()
            _pool.submit(self._go, self._stop, key, asked, points, missing)

    def stop(self) -> None:
        """Stop fitting, and keep the results so far."""
        self._stop.set()
        self.running = False
        self.version += 1

    def end(self) -> None:
        """End the work, when the page is closed or the server ends."""
        self.ended = True
        self.stop()

    def study(self, asked: FitRequest, points: ForceMap, laws: Sequence[str]) -> Ranking:
        """Return the results so far, ranked as the command does."""
        from ....identification.fit import rank
        from ....identification.ranking import Ranking, published_of

        spec = state.specimen_of(asked)
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

        try:
            from ....identification.fit import fit

            known, below = state.known(asked), state.below(asked)
            for law in laws:
                if stop.is_set():
                    return
                self.words = law
                try:
                    result: Any = fit(law, points, known=known, slack=asked.slack, train_below=below, progress=tell)
                except MckibbenError as error:
                    result = str(error)
                _keep(key, law, result)
                if stop.is_set():
                    return
                self._take(law, result)
                self.version += 1
        except _StoppedError:
            return
        except Exception as error:  # only this fit fails; the server and the other pages go on
            if not stop.is_set():
                self.failed = str(error) or type(error).__name__
        finally:
            if not stop.is_set():
                self.running = False
                self.version += 1


def _found(key: Any, law: str) -> Any:
    with _lock:
        if (key, law) in _kept:
            _kept.move_to_end((key, law))
        return _kept.get((key, law))


def _keep(key: Any, law: str, result: Any) -> None:
    with _lock:
        _kept[key, law] = result
        while len(_kept) > KEPT:
            _kept.popitem(last=False)


class TableReading(NamedTuple):
    """Result of reading a table.

    Attributes:
        look: into the file.
        size: size of the file [B].
        points: the table; nothing if it was refused.
        wrong: why it was refused.
        asked: how it was read in the end.
        parts: names of its sheets or topics, where it has several.
    """

    look: TablePreview
    size: int
    points: ForceMap | None
    wrong: InputError | None
    asked: FitRequest
    parts: list[str] = []


def read(path: Path, asked: FitRequest) -> TableReading:
    """Look into a file, of `state.file_of`, and read it.

    Raises:
        InputError: it is no table at all, or has more rows than a fit takes.
    """
    from ....recordings.formats import parts_of

    check_rows(path, state.MOST_ROWS, "a fit")
    _, parts = parts_of(path)
    look, asked = _look(path, asked, parts)
    if asked.kind == "recording":
        asked = _of_recording(path, asked, look)
    size = path.stat().st_size
    try:
        return TableReading(look, size, state.read(path, asked), None, asked, parts)
    except InputError as error:
        return TableReading(look, size, None, error, asked, parts)


def _look(path: Path, asked: FitRequest, parts: Sequence[str]) -> tuple[TablePreview, FitRequest]:
    """Look into a file, or into its first sheet with a table where none is chosen and several have one."""
    from ....recordings.force_map import preview_table
    from ....recordings.formats import part_options

    refusal: InputError | None = None
    for part in [asked.part] if asked.part else ["", *parts]:
        try:
            look = preview_table(path, **part_options(path, part))
            return look, dataclasses.replace(asked, part=part)
        except InputError as error:
            refusal = refusal or error
    assert refusal is not None
    raise refusal.changed(where=path.name) from None


def _of_recording(path: Path, asked: FitRequest, look: Any) -> FitRequest:
    """Complete a request from a recording: its rest length, and a real machine's span for the length."""
    from ....recordings import read_any

    spans = [c for c in look.header if c.split(" [")[0] in ("span", "muscle.span")]
    if not {"length", "contraction"} & {*look.meant, *dict(asked.columns)} and spans:
        asked = asked.with_pair("columns", "length", spans[0])
    rest = read_any(path).recording.meta.get("rest_length")
    if not asked.rest and isinstance(rest, float):
        asked = dataclasses.replace(asked, rest=f"{100.0 * rest:.10g} cm")
    return asked


def used(points: ForceMap, asked: FitRequest) -> str:
    """Describe which rows count."""
    taut = int(points.taut.sum())
    slack, informative = len(points) - taut, int(points.informative_slack.sum())
    left = "".join(f" {remark[0].upper()}{remark[1:]}." for remark in points.remarks)
    if not slack:
        return f"{taut} rows used.{left}"
    noun = "row reads" if slack == 1 else "rows read"
    use = f"; {informative} of them ask the laws for zero tension" if asked.slack and informative else ""
    return (
        f"{taut} rows used. {slack} {noun} zero tension: the muscle is slack there, so errors do not count them{use}."
        + left
    )
