"""The page Energy in a real Chromium: the numbers of the command line, what is refused, and links that hold the view."""

import json

import numpy as np
import pytest
from screen_server import says
from typer.testing import CliRunner

from mckibben.cli.app import app
from mckibben.recordings import Channel, Recording

LONG = 60_000  # a slow machine compiles meanwhile [ms]
NEEDED = ("input", "output", "efficiency", "friction", "throttling", "exhaust", "emptying", "slackening", "unaccounted")


def command(*words):
    found = CliRunner().invoke(app, [*words, "--json"])
    assert found.exit_code == 0, found.output
    return json.loads(found.stdout)


def open_page(visit, query="", **options):
    page = visit(f"/energy{query}", **options)
    page.wait_for_selector(".e-numbers [data-row]", timeout=LONG)
    page.wait_for_selector(".e-curve svg", timeout=LONG)
    return page


def in_link(page, *words):
    page.wait_for_function("words => words.every(w => location.search.includes(w))", arg=list(words), timeout=LONG)


def number(page, row):
    return float(page.get_attribute(f'.e-numbers [data-row="{row}"]', "data-value"))


@pytest.fixture(scope="module")
def recorded(served):
    """Two turns of a nylon muscle that is not named in the file, so that the page takes its own."""
    from mckibben.muscles import law_from_specimen
    from mckibben.specimens import specimen

    time = np.linspace(0.0, 2.5, 1001)
    turn = 2.0 * np.pi * time
    pressure, span = 3e5 - 1.5e5 * np.cos(turn), 0.125 + 0.01 * np.cos(turn - 0.9)
    tension = np.asarray(law_from_specimen(specimen("nylon")).tension(span, pressure))
    channels = {
        "pressure": Channel(pressure, "Pa", "measured"),
        "span": Channel(span, "m", "measured"),
        "tension": Channel(tension, "N", "measured"),
    }
    served.folder.mkdir(parents=True, exist_ok=True)
    path = served.folder / "two-turns.nc"
    Recording(time, channels, {"environment": {"pressure_abs": 101325.0, "temperature": 293.15}}).save(path)
    (served.folder / "broken.nc").write_bytes(b"no recording")
    return path


def test_the_cycle_has_the_numbers_of_the_command(visit):
    """Exact: both ask the same functions, and a float is written so that it is read back as the same one."""
    words = ("energy", "nylon", "--pressure", "4.2 bar", "--cycle", "valve", "--accumulator")
    (theirs,) = command(*words)["cycles"]
    page = open_page(visit, "?cycle=valve&exchange=accumulator&pressure=4.2+bar")
    assert number(page, "In") == theirs["input"]
    assert number(page, "Out") == theirs["output"]
    assert number(page, "Efficiency") == theirs["efficiency"]
    for name in NEEDED:
        ours = page.get_attribute(f'.e-losses [data-part="paper.{name}"]', "data-value")
        assert float(ours) == theirs[name], name
    beside = page.get_attribute('.e-losses [data-part="potential.input"]', "data-value")
    assert float(beside) == theirs["beside"]["potential"]["input"]


@pytest.fixture(scope="module")
def braid(tmp_path_factory):
    """A specimen file of one's own, of a braid of which nothing is measured."""
    path = tmp_path_factory.mktemp("own") / "my sleeve.toml"
    words = [
        "--length",
        "22 cm",
        "--angle",
        "24 deg",
        "--diameter",
        "11 mm",
        "--thread",
        "0.3 mm",
        "--bladder",
        "0.8 mm",
    ]
    assert CliRunner().invoke(app, ["braid", *words, "--out", str(path)]).exit_code == 0
    return path


def test_a_specimen_file_of_ones_own_has_the_numbers_of_the_command(visit, braid, until, tmp_path):
    (theirs,) = command("energy", str(braid), "--pressure", "5 bar", "--cycle", "maximal")["cycles"]
    page = open_page(visit)
    page.fill(".supply .field input", "5 furlong")
    page.keyboard.press("Tab")
    says(page, ".supply .said", "The old value, 5, stays in use.")
    (tmp_path / "no.toml").write_text("kind = 'mckibben'\n", encoding="utf-8")
    page.click("text=Add muscle")
    page.set_input_files("dialog.ask input[type=file]", tmp_path / "no.toml")
    says(page, "dialog.ask", "no.toml: ", "is missing")
    page.set_input_files("dialog.ask input[type=file]", braid)
    in_link(page, "muscle=my+sleeve.toml")
    assert page.get_by_label("Muscle", exact=True).input_value() == "my sleeve.toml"
    until(lambda: number(page, "In") == theirs["input"])
    assert number(page, "Out") == theirs["output"]
    says(page, ".supply .said", "The old value, 5, stays in use.")  # another muscle does not undo an answer
    assert page.input_value(".supply .field input") == "5 furlong"
    other = open_page(visit, page.url[page.url.index("?") :])
    assert number(other, "Out") == theirs["output"]


@pytest.mark.slow
def test_choices_stand_in_the_link_and_a_link_brings_them_back(visit, until):
    page = open_page(visit)
    page.click("text=Isotonic >> visible=true >> nth=0")
    page.get_by_role("group", name="Friction").get_by_text("None").click()
    page.focus(".supply input[type=range]")
    page.keyboard.press("Shift+ArrowRight")  # ten steps of 0.1 bar
    in_link(page, "pressure=6+bar", "friction=0+N", "cycle=isotonic")
    other = open_page(visit, page.url[page.url.index("?") :])
    until(lambda: number(other, "In") == number(page, "In"))
    assert other.input_value(".supply .field input") == "6"
    pressed = other.locator(".supply [aria-pressed=true]").all_inner_texts()
    assert pressed == ["Isotonic", "Atmosphere", "None"]
    (theirs,) = command("energy", "nylon", "--pressure", "6 bar", "--cycle", "isotonic", "--no-friction")["cycles"]
    assert number(page, "In") == theirs["input"]


def test_a_pressure_below_the_threshold_is_refused_in_the_words_of_the_command(visit, until):
    said = CliRunner().invoke(app, ["energy", "nylon", "--pressure", "0.5 bar"])
    option, sentence = str(said.exception).split(" ", 1)  # the command names its option, the page its field
    assert option == "--pressure" and "must be above the threshold" in sentence
    page = open_page(visit)
    before = number(page, "In")
    page.fill(".supply .field input", "0.5")
    page.keyboard.press("Tab")
    says(page, ".supply .said", f"pressure {sentence}", "The old value, 5, stays in use.")
    assert page.get_attribute(".supply .field input", "aria-invalid") == "true"
    assert number(page, "In") == before
    page.fill(".supply .field input", "5 furlong")
    page.keyboard.press("Tab")
    until(lambda: "the unit" in page.inner_text(".supply .said") or "must be" in page.inner_text(".supply .said"))
    page.fill(".supply .field input", "4")
    page.keyboard.press("Tab")
    until(lambda: number(page, "In") != before, 60.0)
    until(lambda: page.inner_text(".supply .said") == "")


def test_a_link_names_no_file_and_no_unknown_cycle(visit):
    page = open_page(visit, "?muscle=%2Fetc%2Fpasswd.toml&cycle=x&pressure=-3+bar&recording=..%2F..%2Fx.nc")
    says(
        page,
        ".e-under:not(.e-about)",
        "Unknown specimen '/etc/passwd.toml'. Known are",
        "Unknown cycle 'x'. Known are maximal",
    )
    page.wait_for_selector(".e-flow-place .err", timeout=LONG)
    says(page, ".e-flow-place", "must be a plain name")


def test_where_a_recordings_energy_went_is_what_the_command_says(visit, recorded):
    theirs = command("record", "energy", str(recorded), "--muscle", "nylon")
    page = open_page(visit, "?recording=broken.nc")
    page.wait_for_selector(".e-flow-place .err", timeout=LONG)
    page.get_by_label("Recording", exact=True).select_option("two-turns.nc")
    page.wait_for_selector(".e-flow tr[data-part]", state="attached", timeout=LONG)
    words = {"into": "in", "out": "out", "stored": "gained", "remainder": "left"}
    for part in theirs["exergy"]:
        name = f"{words[part['side']]}.{part['name'].replace('_', ' ')}"
        cell = page.locator(f'.e-flow tr[data-part="{name}"]')
        if cell.count():
            ours = cell.get_attribute("data-value")
            assert (None if ours == "null" else float(ours)) == part["value"], name
    assert page.locator('.e-flow tr[data-part="out.shaft work"]').count() == 1
    in_link(page, "recording=two-turns.nc")
    page.get_by_label("Stretch of the recording").select_option("2")
    in_link(page, "part=2")


def test_a_narrow_dark_page_does_not_scroll_sideways(visit):
    page = open_page(visit, width=390, height=844, color_scheme="dark")
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    for place in (".e-piston svg", ".e-tendon svg", ".e-curve svg"):
        assert page.locator(place).first.bounding_box()["width"] <= 390


def test_a_pressure_that_no_muscle_takes_is_said_beside_its_field(visit, until):
    page = open_page(visit)
    assert page.inner_text(".supply .said") == ""
    page.fill(".supply .field input", "50 MPa")
    page.keyboard.press("Tab")
    says(page, ".supply .said", "McKibben muscles take at most 10 bar", longest=60.0)
    assert page.get_attribute(".supply .field input", "aria-invalid") == "false"  # it is in use all the same
    page.fill(".supply .field input", "5")
    page.keyboard.press("Tab")
    until(lambda: page.inner_text(".supply .said") == "", 60.0)
