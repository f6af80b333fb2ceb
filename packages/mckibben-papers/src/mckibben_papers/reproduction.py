"""Reproduction of the papers, number by number, and the recordings of the simulated test machine that rows are computed of.

Rows are computed from the first one on. A recording is made once and shared. Where several rows need recordings, a second
process computes these rows from the last one on, only to make recordings, which it leaves in a folder: what one process has
begun, the other does not begin again, and what is read there is what was made, bit for bit.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import itertools
import multiprocessing
import os
import re
import signal
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeVar

from mckibben.analysis.segments import segments
from mckibben.assembly.build import rig_cord, unit_from_specimen
from mckibben.bench.prepare import with_friction_scale
from mckibben.bench.rig_file import rig as rig_of
from mckibben.bench.run import prepare, run
from mckibben.documents import JsonValue
from mckibben.errors import ConvergenceError, InputError, MckibbenError, not_found
from mckibben.experiments.read import protocol
from mckibben.muscles.elements import Tendon
from mckibben.recordings import Recording, read_recording

from .rows import PrintedRow, RowOutcome, needs_recording, reproduce_row, select
from .rows import reproduces as reproduces_row

LONGEST_NAME = 120  # characters of the name of a saved recording
PAUSE = 0.05  # between two looks at what the other process has done [s]


class ElsewhereError(MckibbenError):
    """The other process is already making this recording."""


class Folder:
    """Folder of the recordings of both processes.

    Args:
        place: place of the folder.
        alive: whether the other process lives, for whose recording it is waited then; by default, nobody waits.
    """

    def __init__(self, place: Path, alive: Callable[[], bool] | None = None) -> None:
        self.place, self.alive = place, alive

    def file(self, key: str) -> Path:
        """Where the recording of a key stands."""
        return self.place / f"{hashlib.sha256(key.encode()).hexdigest()[:24]}.nc"

    def one(self, key: str, make: Callable[[], Recording]) -> Recording:
        """Recording of a key: from the other process, or made here.

        Raises:
            ElsewhereError: the other process makes it, and it is not waited for.
        """
        file = self.file(key)
        try:
            os.close(os.open(file.with_suffix(".claim"), os.O_CREAT | os.O_EXCL))
        except FileExistsError:  # the other process has begun it
            if self.alive is None:
                raise ElsewhereError(key) from None
            while self.alive() and not file.exists():
                time.sleep(PAUSE)
            return read_recording(file) if file.exists() else make()
        recording = make()
        if self.alive is None:
            recording.save(file)
        return recording


Listed = TypeVar("Listed")
_folders: list[Folder] = []
_tellers: list[Callable[[str], None]] = []
_saved_in: list[Path] = []


@contextlib.contextmanager
def _among(listed: list[Listed], one: Listed | None) -> Iterator[None]:
    """Have something in a list, within the context; nothing where it is None."""
    if one is not None:
        listed.append(one)
    try:
        yield
    finally:
        if one is not None:
            listed.pop()


def shared(key: str, make: Callable[[], Recording]) -> Recording:
    """Recording of a key, made here unless another process does."""
    return _folders[-1].one(key, make) if _folders else make()


def kept_in(folder: Folder) -> contextlib.AbstractContextManager[None]:
    """Read and write recordings in a folder, within the context."""
    return _among(_folders, folder)


def told(tell: Callable[[str], None] | None) -> contextlib.AbstractContextManager[None]:
    """Report which recording is being made and its progress to `tell`, within the context."""
    return _among(_tellers, tell)


SPAN, TENSION = "span", "tension"  # channels that the machine measures
FIVE_BAR = "5 bar"
RIGID_CORD = Tendon(stiffness=1e7, toe_length=5e-6, loss=0.2)  # 80 N stretch it by a hundredth of a millimetre
RIGID_FRAME = {"frame.stiffness": "1e8 N/m"}
reproduces = functools.partial(reproduces_row, recordings=True)  # a row that is computed of recordings


@functools.cache
def recording(
    name: str,
    muscle: str = "nylon",
    *,
    rig: str = "paper",
    plumbing: str | None = None,
    accept_saturation: bool = False,
    rigid: bool = False,
    changes: tuple[tuple[str, str], ...] = (),
    friction: float = 1.0,
    law: tuple[tuple[str, float], ...] = (),
    **values: JsonValue,
) -> Recording:
    """Recording of a shipped protocol, made at the first call.

    Args:
        name: name of the protocol.
        muscle: id of a specimen.
        rig: name of a rig.
        plumbing: name of the way in which the pneumatic parts are joined.
        accept_saturation: go on where the range of the cell is exceeded.
        rigid: the cord and the frame, whose stiffness is inferred, do not give way.
        changes: other values of the rig, by their paths.
        friction: of the muscle, over that of its specimen.
        law: other parameters of the muscle's law [SI].
        **values: of the protocol's parameters; several in a tuple.

    Raises:
        InputError: the dry run found something.
        ConvergenceError: the run stopped before its end; says why.
    """
    said = repr((name, muscle, rig, plumbing, accept_saturation, rigid, changes, friction, law, sorted(values.items())))

    def make() -> Recording:
        settings = {key: list(value) if isinstance(value, tuple) else value for key, value in values.items()}
        cord = RIGID_CORD if rigid else rig_cord()
        unit = with_friction_scale(unit_from_specimen(muscle, tendon=cord, changes=dict(law)), friction)
        bench = prepare(
            protocol(name, **settings),
            muscle=muscle,
            unit=unit if rigid or law or friction != 1.0 else None,
            rig=rig_of(rig, {**(RIGID_FRAME if rigid else {}), **dict(changes)}) if rigid or changes else rig,
            plumbing=plumbing,
            accept_saturation=accept_saturation,
        )
        words = ", ".join([name, muscle, *(str(value) for value in values.values() if not isinstance(value, tuple))])

        def progress(done: float, total: float) -> None:
            for tell in _tellers:
                tell(f"recording {words}: {100.0 * done / total:.0f} %")

        progress(0.0, 1.0)
        recording = run(bench, progress=progress)
        if recording.meta["result"] != "done":
            raise ConvergenceError(f"{words}: {recording.meta['message']}")
        return recording

    record = shared(said, make)
    others = [w for w in (None if rig == "paper" else rig, plumbing, "rigid" if rigid else None) if w]
    others += [f"{path.rpartition('.')[2]} {value}" for path, value in (*changes, *law)]
    others += [] if friction == 1.0 else [f"friction {friction:g}"]
    for folder in _saved_in:
        # Save a recording under the words that say which it is; another one of the same words gets a number
        words = [name, muscle, *others, *(f"{k} {v}" for k, v in values.items() if not isinstance(v, tuple))]
        stem = re.sub(r"[^\w.]+", "-", " ".join(words)).strip("-")[:LONGEST_NAME]
        numbers = itertools.count(2)
        path = folder / f"{stem}.nc"
        while path.exists():
            path = folder / f"{stem}-{next(numbers)}.nc"
        record.save(path)
    return record


def saved_in(folder: str | os.PathLike[str] | None) -> contextlib.AbstractContextManager[None]:
    """Save every recording that is made or read within the context as a ``.nc`` file in a folder, which is made if needed.

    Raises:
        InputError: the place is a file, or its parent folder is missing.
    """
    if folder is None:
        return contextlib.nullcontext()
    place = Path(folder)
    if place.exists() and not place.is_dir():
        raise InputError("folder", str(place), "must be a folder; it is a file")
    if not place.absolute().parent.is_dir():
        raise not_found(place.absolute().parent, "folder")
    place.mkdir(exist_ok=True)
    return _among(_saved_in, place)


def step_of(record: Recording, label: str, **case: str | float) -> Recording:
    """Recorded step with a label, and a case if several have it."""
    (step,) = segments(record, label, **case)
    return step


def saturation_words(record: Recording) -> str:
    """Describe the samples of the tension at the end of its range; empty if there are none."""
    said = record.meta["saturation"].get("tension")
    return "" if said is None else str(said["sentence"])


# ---- reproduction

WORTH = 6  # rows with recordings from which on a second process is worth its start


def reproduce(
    part: str | None = None,
    rows: list[str] | None = None,
    *,
    progress: Callable[[PrintedRow], None] | None = None,
    tell: Callable[[str], None] | None = None,
    recordings: bool = True,
    save: str | os.PathLike[str] | None = None,
) -> list[RowOutcome]:
    """Compute rows of the papers and judge each.

    Args:
        part: ``I`` to ``IV`` or ``discussion``; all by default.
        rows: beginnings of identifiers, such as ``table1.nylon``.
        progress: called with each row before it is computed.
        tell: called with words while a recording is made, of which several rows are computed; that takes minutes.
        recordings: off leaves out the rows that need them.
        save: folder into which the recordings of these rows are written, as ``.nc`` files.

    Raises:
        InputError: there is no such part or row, or the folder is a file.

    Examples:
        >>> import mckibben as mk
        >>> sorted({str(outcome.verdict) for outcome in mk.reproduce(rows=["table1.nylon"], recordings=False)})
        ['arithmetic', 'open']
    """
    outcomes = []
    wanted = select(part, rows)
    with told(tell), saved_in(save):
        for row in wanted:
            if not recordings and needs_recording(row):
                continue
            if progress:
                progress(row)
            outcomes.append(reproduce_row(row))
    return outcomes


@contextlib.contextmanager
def helped(identifiers: list[str]) -> Iterator[None]:
    """Let a second process make recordings for these rows, within the context, if that saves time."""
    wanted = [row.id for row in select(None, identifiers) if needs_recording(row)] if identifiers else []
    if len(wanted) < WORTH or (os.cpu_count() or 1) < 2 or multiprocessing.parent_process() is not None:
        yield
        return
    with tempfile.TemporaryDirectory(prefix="mckibben-") as place:
        other = multiprocessing.get_context("spawn").Process(target=_help, args=(place, wanted), daemon=True)
        other.start()
        try:
            with kept_in(Folder(Path(place), other.is_alive)):
                yield
        finally:
            other.terminate()
            other.join()


def _help(place: str, identifiers: list[str]) -> None:
    """Compute rows in the second process; failures are left to the first, which reports them."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the first process ends this one
    with kept_in(Folder(Path(place))):
        for row in reversed(select(None, identifiers)):
            with contextlib.suppress(MckibbenError, ArithmeticError, OSError):
                reproduce_row(row)
