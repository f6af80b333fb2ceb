"""Slow work and file transfers: work in threads, and files that are uploaded and downloaded."""

from __future__ import annotations

import asyncio
import secrets
import shutil
import tempfile
import weakref
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError, MckibbenError
from .elements import Element, call_script, page_document
from .reader import ReaderProcess, is_small
from .shelf import LARGEST, check_size, plain_name
from .widgets import box, button, loading, raw, refused, text

if TYPE_CHECKING:
    from starlette.requests import Request

PART = 2**20  # of an upload that is written at once [B]
PROGRESS = 0.25  # time between two words on how far a file is read [s]
AWAY = 5.0  # time for which a page may lose its line before what it reads is stopped [s]


async def run_in_thread(place: Element, words: str, work: Callable[..., Any], *arguments: Any) -> Any:
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
    """Receive the body of a request, named by its query, as a file; none of it stays in memory.

    Raises:
        InputError: if it has no room on the disk.
    """
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
        self._take, self._endings = take, endings
        with box("div", "drop") as self.element:
            with box("div", "grow"):
                self.about = box("div")
                self.words = text("span", words)
                self._answer = box("div")
            self._picker = box("input").set(
                type="file", accept=",".join(endings), data_most=LARGEST, hidden=True, tabindex=-1, aria_label=words
            )
            button("Choose", small=True).set(data_chooses=self._picker.number)
        self._picker.on_value("rejected", self._rejected).on_value("came", self._came)
        self.also(self.element)

    def also(self, place: Element) -> None:
        """Accept files that are dropped on another element too."""
        place.set(data_takes=self._picker.number)

    def _rejected(self, _: object) -> None:
        kinds = ", ".join(self._endings)
        self._say(f"the file has another ending than {kinds}, or more than {LARGEST >> 20} MB; nothing was stored")

    def _say(self, sentence: str) -> None:
        self._answer.clear()
        with self._answer:
            refused(sentence)

    async def _came(self, file: IncomingFile) -> None:
        self._answer.clear()
        try:
            check_size(file.name, file.path.stat().st_size, LARGEST)
            result = self._take(file)
            if asyncio.iscoroutine(result):
                await result
        except MckibbenError as error:
            self._say(str(error))


def download(name: str, data: bytes) -> None:
    """Let the browser save a file."""
    document = page_document()
    key = secrets.token_urlsafe(12)
    document.downloads[key] = (name, data)
    call_script("download", f"/download/{document.key}/{key}", name)
