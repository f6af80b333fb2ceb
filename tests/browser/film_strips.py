"""Walk four ways through the screen by its visible labels, in a real Chromium, and lay six pictures of each side by side.

    python tests/browser/film_strips.py FOLDER [--file TABLE.csv] [--way student]

A student goes to a first loop, an experimenter from a file of another program (`--file`, a force map) to a report, an
engineer to a sized muscle on the bench, a reviewer to the origin of one printed number. FOLDER gets the pictures, one strip
for each way, and `ways.json`: clicks, typed fields and seconds of each. Requires playwright, chromium and pillow.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from PIL import Image
from playwright.sync_api import expect, sync_playwright
from screen_server import Served, settled

from conftest import ARGUMENTS, CHROMIUM

SIZE = {"width": 1440, "height": 900}
PATIENCE = 180_000  # a bound for a busy machine, no measure of the screen [ms]


class Walk:
    """One visitor's way: what was pressed and typed, how long the screen took, and the pictures."""

    def __init__(self, browser: Any, served: Served, folder: Path, name: str) -> None:
        context = browser.new_context(viewport=SIZE)
        context.add_cookies([served.cookie])
        self.page, self.folder, self.name = context.new_page(), folder, name
        self.clicks = self.typed = 0
        self.pictures: list[Path] = []
        self.looking = 0.0  # time for pictures, which is no part of the way
        self.began = time.monotonic()
        self.page.set_default_timeout(PATIENCE)
        self.page.goto(served.url)
        self.sees("ready, dry run passed")

    def press(self, label: str, role: str = "button", place: Any = None) -> None:
        """Press what has this label."""
        (place or self.page).get_by_role(role, name=label).first.click()
        self.clicks += 1

    def write(self, label: str, words: str) -> None:
        """Write into the field of this label."""
        field = self.page.get_by_label(label, exact=True).first
        field.fill(words)
        field.press("Enter")
        self.typed += 1

    def sees(self, words: str) -> None:
        """Wait until the page shows these words."""
        expect(self.page.get_by_text(words).locator("visible=true").first).to_be_visible(timeout=PATIENCE)

    def ready(self, true: str) -> None:
        """Wait until what was changed is taken and its dry run is over."""
        begun = "parts?.setup && parts.protocol && parts.dry?.passed && status?.shape === 'idle'"
        self.page.wait_for_function(
            f"() => {{ const {{ parts, status }} = window.lab?.lab ?? {{}}; return {begun} && ({true}) }}"
        )

    def picture(self, page: Any = None) -> None:
        """Keep what is seen."""
        began, shown = time.monotonic(), page or self.page
        path = self.folder / f"{self.name}-{len(self.pictures) + 1}.png"
        shown.screenshot(path=path)
        self.pictures.append(path)
        self.looking += time.monotonic() - began

    def end(self) -> dict[str, Any]:
        """Lay the pictures side by side; clicks, fields and seconds."""
        seconds = time.monotonic() - self.began - self.looking
        strip = Image.new("RGB", (SIZE["width"] * len(self.pictures), SIZE["height"]))
        for k, path in enumerate(self.pictures):
            strip.paste(Image.open(path), (k * SIZE["width"], 0))
        strip.save(self.folder / f"{self.name}.png")
        self.page.context.close()
        return {"clicks": self.clicks, "fields": self.typed, "seconds": round(seconds, 1)}


def student(walk: Walk, _: Path) -> None:
    """From the first look to a loop that was run, and its numbers."""
    walk.picture()
    walk.press("Fiberglass shell", "radio")
    walk.ready("parts.setup.muscle === 'fiberglass'")
    walk.picture()
    for old, new in (("4.5 bar", "4 bar"), ("20 cycles", "5")):
        walk.press(old)
        walk.page.keyboard.type(new)
        walk.page.keyboard.press("Enter")
        walk.typed += 1
    walk.ready("Object.keys(parts.protocol.edits ?? {}).length === 2")
    walk.press("Start")
    walk.page.wait_for_timeout(5_000)  # some cycles
    walk.picture()
    walk.press("Simulated")  # the rest as fast as it goes
    walk.sees("recorded and kept")
    walk.picture()
    walk.press("Recordings", "link")
    walk.page.locator(".rows tr").first.click()
    walk.clicks += 1
    settled(walk.page)
    walk.picture()
    walk.press("Loops compared")
    settled(walk.page)
    walk.picture()


def experimenter(walk: Walk, file: Path) -> None:
    """From a file of another program to a report."""
    walk.press("Fit", "link")
    walk.sees("Drop a table of any format here")
    walk.picture()
    with walk.page.expect_file_chooser() as chooser:
        walk.press("Choose")
    chooser.value.set_files(file)
    settled(walk.page)
    walk.picture()
    walk.write("Rest length L\u2080", "20 cm")
    walk.page.wait_for_timeout(1_500)
    walk.picture()
    walk.page.wait_for_function("() => document.querySelectorAll('.rank tr.pick').length > 4")
    walk.press("Stop fitting")  # five laws are enough
    settled(walk.page)
    walk.picture()
    walk.press("Residuals")
    settled(walk.page)
    walk.picture()
    with walk.page.context.expect_page() as report:
        walk.press("Open report")
    report.value.wait_for_function("() => document.title.startsWith('Tension laws fitted')")
    settled(report.value)
    walk.picture(report.value)


def engineer(walk: Walk, _: Path) -> None:
    """From a load to a muscle on the bench."""
    walk.press("Size", "link")
    walk.sees("What it must do")
    walk.picture()
    walk.write("Force", "80 N")
    walk.write("Stroke", "4 cm")
    walk.page.wait_for_timeout(1_500)
    walk.picture()
    walk.page.wait_for_function(
        "() => document.querySelector('.size-facts') && !document.querySelector('.size-result.old')"
    )
    settled(walk.page)
    walk.picture()
    walk.page.mouse.move(900, 600)
    walk.page.mouse.wheel(0, 700)
    walk.page.wait_for_timeout(500)
    walk.picture()
    walk.press("Take to the bench")
    walk.page.wait_for_url("**/?muscle=*")
    walk.ready("parts.setup.muscle.startsWith('braid')")
    settled(walk.page)
    walk.picture()
    walk.press("Simulated")
    walk.press("Start")
    walk.sees("recorded and kept")
    walk.picture()


def reviewer(walk: Walk, _: Path) -> None:
    """From the paper's rows to what one number comes from."""
    walk.press("The paper", "link")
    walk.sees("rows done")
    settled(walk.page)
    walk.picture()
    walk.page.get_by_label("Search rows").first.fill("stiffness")
    walk.typed += 1
    settled(walk.page)
    walk.picture()
    walk.page.locator("tr[data-row]").first.click()
    walk.clicks += 1
    settled(walk.page)
    walk.picture()
    walk.press("Compute this row")
    walk.page.wait_for_selector("tr.sel[data-value], tr[aria-selected=true][data-value]")
    settled(walk.page)
    walk.picture()
    walk.press("Its numbers")
    settled(walk.page)
    walk.picture()
    with walk.page.expect_download() as coming:
        walk.press("Report as HTML")
    report = walk.page.context.new_page()
    path = walk.folder / "reviewer.html"
    coming.value.save_as(path)
    report.goto(path.as_uri())
    walk.picture(report)


WAYS: tuple[Callable[[Walk, Path], None], ...] = (student, experimenter, engineer, reviewer)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--file", type=Path, required=True)
    parser.add_argument("--way", action="append", choices=[w.__name__ for w in WAYS], help="all where none is named")
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    counted = {}
    with tempfile.TemporaryDirectory() as home, sync_playwright() as play:
        served = Served(Path(home) / "recordings")
        try:
            browser = play.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
            for way in (w for w in WAYS if not given.way or w.__name__ in given.way):
                walk = Walk(browser, served, given.folder, way.__name__)
                way(walk, given.file)
                counted[way.__name__] = walk.end()
                print(way.__name__, counted[way.__name__], flush=True)
        finally:
            served.end()
    (given.folder / "ways.json").write_text(json.dumps(counted, indent=1) + "\n")


if __name__ == "__main__":
    main()
