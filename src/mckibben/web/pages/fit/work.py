"""Fits in a thread of their own, law by law: each is there once it is done, can be stopped, and is kept for other pages."""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

from ....errors import MckibbenError
from ...laboratory import Laboratory
from . import source
from .source import Asked

if TYPE_CHECKING:
    from ....identification import Fit
    from ....recordings import ForceMap
    from ....report.fit_study import Study

KEPT = 200  # fits that are kept of all pages
_pool = ThreadPoolExecutor(2, thread_name_prefix="fit")
_kept: OrderedDict[Any, Any] = OrderedDict()
_lock = threading.Lock()


class _StoppedError(Exception):
    """A person did not want to wait for it."""


class Work:
    """The fits of one page.

    Args:
        lab: whose tables are fitted.

    Attributes:
        fits: by law.
        skipped: why a law could not be fitted, by law.
        words: what is being done.
        version: changes with every step.
    """

    def __init__(self, lab: Laboratory) -> None:
        self._lab, self._stop = lab, threading.Event()
        self.fits: dict[str, Fit] = {}
        self.skipped: dict[str, str] = {}
        self.words, self.version, self.running = "", 0, False
        self.failed, self.ended = "", False
        self._done, self._total, self._began = 0, 1, 0.0
        self._key: Any = None

    @property
    def share(self) -> float:
        """Of the work, that is done."""
        return min(1.0, self._done / self._total)

    @property
    def left(self) -> float | None:
        """Time that it will still take [s], once that can be said."""
        gone = time.monotonic() - self._began
        return gone * (1.0 - self.share) / self.share if self.share > 0.05 and gone > 1.0 else None

    def start(self, asked: Asked, points: ForceMap, laws: Sequence[str]) -> None:
        """Fit what is not yet there; what is no longer wanted is stopped."""
        self.stop()
        path = source.file_of(self._lab, asked)
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
        """Take what is there; the rest is not done."""
        self._stop.set()
        self.running = False
        self.version += 1

    def end(self) -> None:
        """The page is gone, or the server ends."""
        self.ended = True
        self.stop()

    def study(self, asked: Asked, points: ForceMap, laws: Sequence[str]) -> Study:
        """What was found by now, ranked as the command does."""
        from ....identification.fit import rank
        from ....report.fit_study import Study, published_of

        spec = source.specimen_of(asked)
        return Study(
            title=spec.title if spec else points.name, specimen=spec, points=points,
            fits=rank(self.fits[law] for law in laws if law in self.fits), published=published_of(spec, points),
            skipped={law: self.skipped[law] for law in laws if law in self.skipped},
        )  # fmt: skip

    def _take(self, law: str, found: Any) -> None:
        if isinstance(found, str):
            self.skipped[law] = found
        elif found is not None:
            self.fits[law] = found

    def _go(self, stop: threading.Event, key: Any, asked: Asked, points: ForceMap, laws: list[str]) -> None:
        def tell(words: str) -> None:
            if stop.is_set():
                raise _StoppedError
            self.words, self._done = words, self._done + 1
            self.version += 1

        try:
            from ....identification.fit import fit

            known, below = source.known(asked), source.below(asked)
            for law in laws:
                if stop.is_set():
                    return
                self.words = law
                try:
                    found: Any = fit(law, points, known=known, slack=asked.slack, train_below=below, progress=tell)
                except MckibbenError as error:
                    found = str(error)
                _keep(key, law, found)
                if stop.is_set():
                    return
                self._take(law, found)
                self.version += 1
        except _StoppedError:
            return
        except Exception as error:  # of this page's fit alone; the laboratory and the other pages go on
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


def _keep(key: Any, law: str, found: Any) -> None:
    with _lock:
        _kept[key, law] = found
        while len(_kept) > KEPT:
            _kept.popitem(last=False)
