"""Dialogs of the comparison: adding a column, and running the trials."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Any

from ....errors import MckibbenError
from ....specimens import specimens
from ...specimen_files import specimen_place
from ...widgets import Dialog, box, button, empty, raw, refused, text
from . import drawings, jobs

if TYPE_CHECKING:
    from .page import ComparePage


def add(face: ComparePage) -> None:
    """Build the list of muscles that are not shown; a click adds one."""
    dialog = Dialog("Add a column", "compare-dialog", "bd list", once=True)

    def take(name: str) -> None:
        dialog.close()
        face.take(name)

    with dialog:
        if face.values == "recordings":
            text("h3", "Recordings")
            left = [n for n in face.workspace.recordings.names() if n.endswith(".nc") and n not in face.recordings][:60]
            for name in left:
                button(name.removesuffix(".nc"), lambda n=name: take(n), quiet=True)
            if not left:
                text("p", "There is no other recording.", "small dim")
        kinds = {"mckibben": "McKibben muscles", "biological": "Biological muscles"}
        for kind, title in kinds.items():
            if face.values == "recordings" and kind == "mckibben":
                continue
            text("h3", title)
            others = [s for s in specimens() if s.kind == kind and s.id not in face.muscles]
            for spec in others:
                button(spec.title, lambda n=spec.id: take(n), quiet=True)
            if not others:
                text("p", "All of them are shown.", "small dim")
        own_files = [n for n in face.workspace.specimens.names() if n not in face.muscles]
        if own_files and face.values == "laws":
            text("h3", "Your own")
            for name in own_files:
                button(name.removesuffix(".toml"), lambda n=name: take(n), quiet=True)
        if face.values == "laws":
            specimen_place(face.workspace.specimens, take)
    dialog.open()


def runs(face: ComparePage) -> None:
    """Show the isometric steps of the muscles, or a button that runs them."""
    face.step.clear()
    face.running.clear()
    if not face.shown:
        with face.step:
            text("p", "Protocols run on muscles, not on recordings: choose From the laws.", "small dim")
        return
    missing = [(s, n) for _, s in face.shown for n in jobs.PROTOCOLS if jobs.run_known(s, n) is None]
    chart = drawings.step_chart(face.shown)
    with face.step:
        if chart is not None:
            chart.show()
        elif missing:
            words = "isometric step and isokinetic shortening"
            empty(
                f"No muscle has run it yet: {words}, on the simulated machine.",
                "Run the protocols",
                lambda: begin(face),
            )
    if chart is not None and missing:
        with face.running:
            button("Run the rest", lambda: begin(face), small=True)


def begin(face: ComparePage) -> None:
    """Run the missing protocols one after the other; when cancelled, the running one is completed."""
    face.cancelled = False
    face.document.spawn(_run(face))


async def _run(face: ComparePage) -> None:
    todo = [(s, n) for n in jobs.PROTOCOLS for _, s in face.shown if jobs.run_known(s, n) is None]
    number = face.number
    for i, (one, name) in enumerate(todo):
        if face.cancelled or face.number != number:
            break
        _progress(face, f"{one.id}: {name}", i, len(todo))
        try:
            await asyncio.to_thread(jobs.run_of, one, name)
        except MckibbenError as error:
            face.step.clear()
            with face.step:
                refused(str(error))
            return
        except Exception as error:  # the page has to hear of it
            face.step.clear()
            with face.step:
                refused(f"the run failed: {type(error).__name__}: {str(error)[:200]}")
            return
    if not face.gone and face.number == number:
        face.renew()


def _progress(face: ComparePage, words: str, done: int, total: int) -> None:
    def cancel() -> None:
        face.cancelled = True
        _progress(face, f"{words}; ends after it", done, total)

    face.running.clear()
    chart: Any = drawings.step_chart(face.shown)
    face.step.clear()
    with face.step:
        if chart is not None:
            chart.show()
        with box("div", "running").set(role="status"):
            text("span", f"{words}, {done + 1} of {total}", "small")
            raw(f'<i style="width:{100.0 * (done + 0.5) / total:.0f}%" class="share"></i>', "div", "line")
            if not face.cancelled:
                button("Cancel", cancel, small=True)


__all__ = ["add", "begin", "runs"]
