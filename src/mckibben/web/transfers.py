"""Slow work in threads, and files that are uploaded and downloaded, those of specimens among them."""

from __future__ import annotations

import asyncio
import secrets
import shutil
import tempfile
import weakref
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from ..errors import InputError, MckibbenError
from ..specimens import muscle_specimen
from .elements import Element, call_script, page_document
from .reader import ReaderProcess, is_small
from .shelf import LARGEST, Shelf, check_size, plain_name
from .widgets import box, button, loading, raw, refused, say_refused, tell, text

if TYPE_CHECKING:
    from starlette.requests import Request

T = TypeVar("T")
PART = 2**20  # of an upload that is written at once [B]
PROGRESS = 0.25  # time between two words on how far a file is read [s]
AWAY = 5.0  # time for which a page may lose its line before what it reads is stopped [s]


async def run_in_thread(place: Element, words: str, work: Callable[..., T], *arguments: Any) -> T | None:
    """Run slow work in another thread; `place` keeps its size and shows a label.

    Work that ends late leaves what was put into the place meanwhile.

    Returns:
        What `work` returns; None if it was refused, with the sentence in the place.
    """
    place.clear()
    with place, loading(words) as label:
        pass
    try:
        result = await asyncio.to_thread(work, *arguments)
    except MckibbenError as error:
        if label.delete():
            with place:
                refused(str(error))
        return None
    label.delete()
    return result


async def attempt(work: Callable[..., T], *arguments: Any) -> T | None:
    """Run work in another thread; None if it was refused, with the sentence at the foot of the page."""
    try:
        return await asyncio.to_thread(work, *arguments)
    except MckibbenError as error:
        tell(str(error))
        return None


async def read_with_progress(
    place: Element, words: str, work: Callable[..., Any], path: Path, *arguments: Any, passes: int = 1
) -> Any:
    """Read a file, in a separate process if it is large; `place` shows the progress, and a button to stop.

    A page that is left for longer than `AWAY` stops it too. A file that is read late leaves what was put into the place
    meanwhile.

    Args:
        place: keeps its size; empty afterwards.
        words: that say what is done.
        work: function of a module that is given the path and `given`.
        path: the file.
        arguments: further arguments.
        passes: how often the function reads the file.

    Raises:
        MckibbenError: as `work` does, or that it was stopped.
    """
    place.clear()
    if is_small(path):
        with place, loading(words) as label:
            pass
        try:
            return await asyncio.to_thread(work, path, *arguments)
        finally:
            label.delete()
    reader, document = ReaderProcess(work, path, *arguments, passes=passes), page_document()
    with place, box("div", "reading").set(role="status") as label:
        progress = text("span", words)
        line = raw("<i></i>", "div", "line")
        button("Stop reading", reader.stop, small=True)
    done = asyncio.ensure_future(asyncio.to_thread(reader.result))
    away = 0.0
    try:
        while not (await asyncio.wait({done}, timeout=PROGRESS))[0]:
            away = 0.0 if document.connected else away + PROGRESS
            if away > AWAY or document.closed:
                reader.stop()
                continue
            left = "" if reader.left is None else f", about {reader.left:.0f}\u2009\u2060s left"
            progress.say("Waiting for another file" if reader.waits else f"{words}{left}")
            line.put(f'<i style="width:{100.0 * reader.share:.0f}%"></i>')
        return done.result()
    finally:
        reader.stop()
        label.delete()


class IncomingFile:
    """An uploaded file: its name and a temporary copy, which exists until `close`, or until it is released."""

    def __init__(self, name: str) -> None:
        folder = Path(tempfile.mkdtemp(prefix="mckibben-"))
        self.name = plain_name(name)
        self.path = folder / f"given{Path(self.name).suffix.lower()}"
        self.close = weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)

    def content(self) -> bytes:
        """Whole content; for small files."""
        return self.path.read_bytes()


async def receive_file(request: Request) -> IncomingFile:
    """Receive the body of a request, named by its query, as a file; none of it stays in memory."""
    file = IncomingFile(request.query_params.get("name", "file"))
    with open(file.path, "wb", buffering=0) as stream:
        part = bytearray()
        try:
            async for some in request.stream():
                part += some
                if len(part) >= PART:  # in a thread, for a disk may be slow, and a stop must not wait for it
                    await asyncio.to_thread(stream.write, part)
                    part = bytearray()
            await asyncio.to_thread(stream.write, part)
        except OSError as error:
            raise InputError("file", file.name, f"cannot be stored: {error.strerror}; nothing was stored") from None
    return file


class UploadPlace:
    """A place where files can be dropped or chosen.

    Args:
        words: that stand in it.
        take: is given each `IncomingFile`, and may raise `InputError`.
        endings: endings of the files that it takes.

    Attributes:
        element: the place itself.
        words: the element of its words, which a page may change.
        about: place above the words.
    """

    def __init__(self, words: str, take: Callable[[IncomingFile], object], endings: Sequence[str]) -> None:
        self._take = take
        with box("div", "drop") as self.element:
            with box("div", "grow"):
                self.about = box("div")
                self.words = text("span", words)
                self._answer = box("div")
            self._picker = box("input").set(
                type="file", accept=",".join(endings), data_most=LARGEST, hidden=True, tabindex=-1, aria_label=words
            )
            button("Choose", small=True).set(data_chooses=self._picker.number)
        kinds = ", ".join(endings)
        why = f"the file has another ending than {kinds}, or more than {LARGEST >> 20} MB; nothing was stored"
        self._picker.on_value("rejected", lambda _: say_refused(self._answer, why)).on_value("came", self._came)
        self.also(self.element)

    def also(self, place: Element) -> None:
        """Accept files that are dropped on another element too."""
        place.set(data_takes=self._picker.number)

    async def _came(self, file: IncomingFile) -> None:
        self._answer.clear()
        try:
            check_size(file.name, file.path.stat().st_size, LARGEST)
            result = self._take(file)
            if asyncio.iscoroutine(result):
                await result
        except MckibbenError as error:
            say_refused(self._answer, error)


def download(name: str, data: bytes) -> None:
    """Let the browser save a file."""
    document = page_document()
    key = secrets.token_urlsafe(12)
    document.downloads[key] = (name, data)
    call_script("download", f"/download/{document.key}/{key}", name)


ENDINGS = (".toml",)
LARGEST_SPECIMEN = 2**20  # of a specimen file [B]
WORDS = "A specimen file of your own: .toml, as mckibben braid and the page Fit write it"


class SpecimenFile(NamedTuple):
    """A specimen file as it was when it was chosen: its path, and when it was changed [ns]."""

    path: str
    changed: int


def specimen_file(shelf: Shelf, name: str) -> SpecimenFile:
    """Find a file of a visitor by its name; refused if there is none."""
    path = shelf.found(name)
    return SpecimenFile(str(path), path.stat().st_mtime_ns)


def own_titles(shelf: Shelf, fits: Callable[[Path], bool]) -> dict[str, str]:
    """Names of the files of a visitor, the newest first, with the words of a list; unsuitable ones are left out."""
    titles = {}
    for name in shelf.names():
        try:
            if fits(shelf.path(name)):
                titles[name] = f"{Path(name).stem} (your own)"
        except MckibbenError:
            continue  # said where it is chosen by its name
    return titles


def specimen_place(shelf: Shelf, take: Callable[[str], object]) -> UploadPlace:
    """Build the place for a specimen file; `take` is told its name on the shelf."""

    def came(file: IncomingFile) -> object:
        name = plain_name(file.name)
        if file.path.stat().st_size > LARGEST_SPECIMEN:
            raise InputError("file", name, f"must be at most {LARGEST_SPECIMEN >> 20} MB; nothing was stored")
        try:
            muscle_specimen(file.path)  # refused here, by the name that its sender gave it, and nothing is stored
        except InputError as error:
            raise error.changed(where=name) if error.where else error.changed(sentence=f"{name}: {error}") from None
        stored = shelf.store_once(name, file.content())
        file.close()
        return take(stored.name)

    return UploadPlace(WORDS, came, ENDINGS)
