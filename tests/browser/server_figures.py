"""What the server of the screen costs: memory over a day of runs, how soon a run is saved, how soon Size answers.

    python tests/browser/server_figures.py day [--hours 24] [--minutes 6]
    python tests/browser/server_figures.py save [--minutes 6]
    python tests/browser/server_figures.py size

`day` runs work loops of some minutes each, as fast as they go, until so many hours of them are simulated, and prints the
memory of the server after each; each recording is deleted, as it is no memory. `save` says how long after its last sample a
run is kept and said to be. `size` opens the page on a server that has stood for 20 s, and asks four questions more, each for
the first time.
The load of the machine stands in each line. Requires playwright and chromium.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psutil
from playwright.sync_api import sync_playwright
from screen_server import Served

from conftest import ARGUMENTS, CHROMIUM

QUESTIONS = (("Force", "80 N"), ("Stroke", "4 cm"), ("Pressure", "6 bar"), ("Force", "65 N"))
DAY = 3600.0  # of an hour [s]


def resident(served: Served) -> float:
    """Memory of the server and its processes [MB]."""
    server = psutil.Process(served.process.pid)
    return sum(one.memory_info().rss for one in (server, *server.children(recursive=True))) / 2**20


def used(served: Served) -> float:
    """Time that the server and its processes have had of the cores [s]: what an answer costs, whoever else is busy."""
    server = psutil.Process(served.process.pid)
    times = [one.cpu_times() for one in (server, *server.children(recursive=True))]
    return sum(one.user + one.system for one in times)


def load() -> str:
    """Processes that waited for a core in the last minute."""
    return f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores"


def runs(page: Any, minutes: float) -> Iterator[tuple[dict[str, Any], float, float]]:
    """Run again and again: how it ended, seconds of the run, and seconds from its last sample to its kept recording."""
    page.wait_for_function("() => window.lab?.lab.parts.dry?.passed")
    cycles = round(60.0 * minutes / 1.0)
    act = f"window.lab.act('value', {{ name: 'cycles', words: '{cycles}' }})"
    assert page.evaluate(act)["ok"]
    page.evaluate("window.lab.act('pace', { name: 'simulated' })")
    while True:
        page.wait_for_function("() => window.lab.lab.parts.dry?.passed && !window.lab.lab.status.running")
        began = time.monotonic()
        assert page.evaluate("window.lab.act('start')")["ok"]
        # the state comes ten times a second: so exact are these times
        page.wait_for_function(
            """() => { const s = window.lab.lab.status; if (s.running) { window.ran = true
                if (s.time !== window.newest) { window.newest = s.time; window.last = performance.now() } return false }
                return window.ran && s.ended?.file }""",
            polling=20,
        )
        after = page.evaluate("(window.ran = false, performance.now() - window.last)") / 1e3
        yield page.evaluate("window.lab.lab.status.ended"), time.monotonic() - began, after


def day(page: Any, served: Served, hours: float, minutes: float) -> None:
    """Print the memory after each run, and what an hour of runs adds in the second half."""
    simulated, course = 0.0, [(0.0, resident(served))]
    for ended, took, after in runs(page, minutes):
        simulated += ended["time"]
        (served.folder / ended["file"]).unlink()
        course.append((simulated / DAY, resident(served)))
        print(
            f"{simulated / DAY:6.2f} h simulated: {course[-1][1]:7.1f} MB; a run of {ended['time']:.0f} s "
            f"took {took:.1f} s, saved {after:.2f} s after its end; {load()}",
            flush=True,
        )
        if simulated >= DAY * hours:
            break
    (first, low), (last, high) = course[len(course) // 2], course[-1]
    print(f"second half: {(high - low) / (last - first):+.2f} MB for each simulated hour", flush=True)


def sized(browser: Any, served: Served) -> None:
    """Print the time of the first answer of Size, and of later ones."""
    context = browser.new_context()
    context.add_cookies([served.cookie])
    page = context.new_page()
    page.set_default_timeout(300_000)
    time.sleep(20.0)  # what a new server makes ready beside it is no part of it
    began, before = time.monotonic(), used(served)
    page.goto(f"{served.url}/size")
    page.wait_for_selector(".size-facts")
    spent = used(served) - before
    print(
        f"first answer, from the click on: {time.monotonic() - began:.2f} s, {spent:.2f} s of a core; {load()}",
        flush=True,
    )
    for label, words in QUESTIONS:
        field = page.get_by_label(label, exact=True).first
        began, before = time.monotonic(), used(served)
        field.fill(words)
        field.press("Enter")
        page.wait_for_selector(".size-result.old", state="attached")
        page.wait_for_selector(".size-result:not(.old)", state="attached")
        spent = used(served) - before
        print(f"{label} {words}: {time.monotonic() - began:.2f} s, {spent:.2f} s of a core; {load()}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("figure", choices=("day", "save", "size"))
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--minutes", type=float, default=6.0, help="of each run")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as home, sync_playwright() as play:
        served = Served(Path(home) / "recordings")
        try:
            browser = play.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
            if given.figure == "size":
                sized(browser, served)
                return
            context = browser.new_context()
            context.add_cookies([served.cookie])
            page = context.new_page()
            page.set_default_timeout(3_600_000)
            page.goto(f"{served.url}/compare")  # a page that draws no samples, for which no run waits
            page.wait_for_function("() => window.lab && window.lab.lab.open")
            if given.figure == "day":
                day(page, served, given.hours, given.minutes)
                return
            for _, (ended, took, after) in zip(range(3), runs(page, given.minutes), strict=False):
                said = f"a run of {ended['time']:.0f} s took {took:.1f} s; saved {after:.2f} s after its end"
                print(f"{said}; {load()}", flush=True)
        finally:
            served.end()


if __name__ == "__main__":
    main()
