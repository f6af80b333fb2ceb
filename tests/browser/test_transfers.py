"""Slow work for a page: what ends late does not undo what was put into its place meanwhile."""

import asyncio
import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

from mckibben.errors import InputError
from mckibben.web.elements import Element, PageDocument
from mckibben.web.transfers import read_with_progress, run_in_thread
from mckibben.web.widgets import text

LONG = 30.0  # a bound for a busy machine [s]


def run(work):
    """Run a coroutine in a thread of its own, for the browser of other tests has a loop in this one."""
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(asyncio.run, work).result(LONG)


@pytest.mark.parametrize("refused", [False, True])
def test_work_that_ends_late_leaves_what_was_shown_meanwhile(refused):
    async def visit() -> tuple[object, str]:
        document, go = PageDocument(), threading.Event()
        with document.root:
            place = Element("div")

        def late() -> str:
            assert go.wait(LONG)
            if refused:
                raise InputError("recording", "a.nc", "must be readable")
            return "late"

        first = asyncio.create_task(run_in_thread(place, "Reading a.nc", late))
        await asyncio.sleep(0)  # it begins
        soon = await run_in_thread(place, "Reading b.nc", lambda: "soon")
        with place:
            text("p", soon)
        go.set()
        return await first, place.inside

    answer, shown = run(visit())
    assert answer == (None if refused else "late")
    assert "soon" in shown and "a.nc" not in shown


def test_a_file_that_is_read_late_leaves_what_was_shown_meanwhile(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text("pressure,length,tension\n", encoding="utf-8")

    async def visit() -> str:
        document, go = PageDocument(), threading.Event()
        with document.root:
            place = Element("div")
        late = asyncio.create_task(read_with_progress(place, "Reading", lambda _: go.wait(LONG), path))
        await asyncio.sleep(0)
        soon = await read_with_progress(place, "Reading", lambda found: found.name, path)
        with place:
            text("p", soon)
        go.set()
        await late
        return place.inside

    assert "table.csv" in run(visit())


def test_work_that_was_refused_says_so_in_its_place():
    async def visit() -> tuple[object, str]:
        document = PageDocument()
        with document.root:
            place = Element("div")

        def refuse() -> None:
            raise InputError("recording", "a.nc", "must be readable")

        return await run_in_thread(place, "Reading a.nc", refuse), place.inside

    answer, shown = run(visit())
    assert answer is None and "recording must be readable" in shown and "Reading" not in shown
