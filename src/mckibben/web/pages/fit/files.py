"""What a visitor takes home from a fit: the report, and the specimen file."""

from __future__ import annotations

import asyncio
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ....errors import MckibbenError
from ...elements import call_script
from ...transfers import download
from ...widgets import button, tell

if TYPE_CHECKING:
    from .view import View


def buttons(view: View) -> None:
    """In the bar of the page."""
    button("Report as PDF", lambda: _pdf(view))
    button("Open report", lambda: _open(view)).set(data_opens="report")  # by the click itself: see fit.js
    button("Save as specimen file", lambda: _specimen(view), primary=True)


def _study(view: View) -> Any:
    """What there is to write about; nothing, and a word about it, where there is none."""
    if view.work.running:
        tell("The fits go on; wait for their end, or stop them first.")
        return None
    if view.asked is None or view.points is None:
        tell("There is no table yet: drop one first.")
        return None
    study = view.work.study(view.asked, view.points, view.laws)
    if not study.fits:
        tell("No law was fitted; there is nothing to write.")
        return None
    return study


async def _pdf(view: View) -> None:
    study = _study(view)
    if study is None:
        return
    tell("Making the report ..")
    try:
        data = await asyncio.to_thread(_document, study, "pdf")
    except MckibbenError as error:
        tell(str(error))
        return
    download(f"{Path(study.points.name).stem}-fit.pdf", data)


async def _open(view: View) -> None:
    study = _study(view)
    if study is None:
        call_script("dropReport")
        return
    try:
        page = (await asyncio.to_thread(_document, study, "html")).decode()
    except MckibbenError as error:
        tell(str(error))
        call_script("dropReport")
        return
    name = f"{Path(study.points.name).stem}-fit.html"
    call_script("showReport", page, name)


def _document(study: Any, kind: str) -> bytes:
    from ....report.fit_report import fit_document

    found = fit_document([study])
    return found.pdf() if kind == "pdf" else found.html().encode()


async def _specimen(view: View) -> None:
    """Download it, and keep it on the laboratory's shelf of specimens, which can be undone."""
    study = _study(view)
    if study is None:
        return
    try:
        name, data = await asyncio.to_thread(_written, study)
        path = await asyncio.to_thread(view.lab.specimens.store, name, data)
    except MckibbenError as error:
        tell(str(error))
        return
    view.lab.toasts.tell(f"Saved specimens/{path.name}.", undo=lambda: path.unlink(missing_ok=True))
    view.lab.changed()
    download(name, data)


def _written(study: Any) -> tuple[str, bytes]:
    from ....report.fit_study import write_specimen

    stem = (
        "".join(c if c.isalnum() or c in "._-" else "-" for c in Path(study.points.name).stem)[:60].strip("-.")
        or "table"
    )
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / f"{stem}-fit.toml"
        write_specimen(study.fits, study.specimen, place)
        return place.name, place.read_bytes()
