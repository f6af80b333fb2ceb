"""The circuit page: the numbers of the command line, parts put in and taken out, links, bad input, the way to the bench."""

import json
import re
import tomllib

import pytest
from screen_server import says

from mckibben.assembly.circuit_file import read_circuit
from mckibben.bench.circuit_run import run_circuit
from mckibben.errors import InputError
from mckibben.web.pages.circuit.document import packed, planned, starts, unpacked

READY = ".curve figure.chart"
TANK = starts()["Filling a tank through a tube"]
DIRECT = starts()["Valve, tube and muscle"]


def opened(visit, document=TANK, query="", **options):
    page = visit(f"/circuit?models=none&c={packed(document)}{query}", **options)
    page.wait_for_selector(READY, timeout=120_000)  # a topology is compiled once
    return page


def circuit_of(page):
    """The document of the page's link."""
    return unpacked(re.search(r"[?&]c=([^&]+)", page.evaluate("location.href"))[1])


def lines_of(page):
    spec = page.locator(READY).first.get_attribute("data-chart")
    return {line["label"]: line["y"] for line in json.loads(spec)["lines"]}


@pytest.mark.slow
def test_a_circuit_is_taken_to_the_bench_with_its_muscle(visit, served, until, status):
    elements = {**DIRECT["elements"], "tube": {**DIRECT["elements"]["tube"], "length": "77 cm"}}
    nodes = {**DIRECT["nodes"], "muscle": {**DIRECT["nodes"]["muscle"], "specimen": "fiberglass", "length": "20 cm"}}
    document = {**DIRECT, "elements": elements, "nodes": nodes}
    assert planned(document)
    page = visit(f"/circuit?models=none&c={packed(document)}", control=True)
    page.get_by_role("button", name="Use on the bench").click()
    page.wait_for_url("**/?muscle=fiberglass&rig=circuit", timeout=60_000)
    rig = tomllib.loads((served.folder / "rigs" / "circuit.toml").read_text())
    assert rig["plumbing"]["direct"]["tube"]["length"] == "77 cm"
    until(lambda: page.evaluate("window.lab.lab.parts.setup?.rig") == "circuit")
    assert page.evaluate("window.lab.lab.parts.setup.muscle") == "fiberglass"


def test_a_saved_circuit_runs_on_the_command_line_and_gives_the_same_curve(visit, served, until):
    page = opened(visit, query="&part=tube")
    page.get_by_role("button", name="Save as").click()
    page.fill("#circuit-name", "../outside")
    page.get_by_role("button", name="Save", exact=True).click()
    page.get_by_text("must be a plain name").wait_for()
    page.fill("#circuit-name", "tank")
    page.get_by_role("button", name="Save", exact=True).click()
    file = served.folder / "circuits" / "tank.toml"
    until(file.exists, 60.0)
    assert tomllib.loads(file.read_text()) == TANK
    ours = run_circuit(read_circuit(file))["tank.pressure"] / 1e5
    shown = lines_of(page)["P\u2081 tank"]
    # the chart is sent with seven digits, and the kernel differs from the run by rounding alone
    assert len(shown) == len(ours)
    assert max(abs(a - b) for a, b in zip(shown, ours, strict=True)) < 1e-6
    page.locator(".chip", has_text="mass balance").wait_for(timeout=120_000)


def test_a_part_is_put_in_by_one_drag_or_two_keys_and_comes_out_again(visit, until):
    page = opened(visit)
    page.locator("[data-add=tube]").drag_to(page.locator(".diagram .part[data-part=tank]"))
    until(lambda: "tube2" in circuit_of(page)["elements"], 60.0)
    page.locator(".diagram .part.on[data-part=tube2]").wait_for()
    page.keyboard.press("Insert")
    page.keyboard.press("o")
    until(lambda: "orifice" in circuit_of(page)["elements"])
    page.keyboard.press("Control+z")
    until(lambda: "orifice" not in circuit_of(page)["elements"])
    page.locator(".diagram .part.on[data-part=tube2]").wait_for()
    page.keyboard.press("Delete")
    until(lambda: circuit_of(page) == TANK)


def test_a_refused_value_stands_beside_its_field_and_the_old_one_stays_in_use(visit, until):
    page = opened(visit, query="&part=tube")
    field = page.locator(".ins .f", has_text="Diameter")
    field.locator("input").fill("-3 mm")
    field.locator("input").press("Enter")
    said = field.inner_text
    until(lambda: "The old value, 0.2, stays in use." in said())
    assert circuit_of(page) == TANK
    field.locator("input").fill("3 mm")
    field.locator("input").press("Enter")
    until(lambda: circuit_of(page)["elements"]["tube"]["diameter"] == "0.3 cm")
    until(lambda: "stays in use" not in said())


def test_a_link_restores_the_view_and_one_that_reaches_outside_is_refused(visit, until):
    page = opened(visit, {**TANK, "run": {"duration": "500 ms"}}, "&part=tube")
    assert page.locator(".part.on").get_attribute("data-part") == "tube"
    until(lambda: len(next(iter(lines_of(page).values()))) == 501)
    nodes = {**DIRECT["nodes"], "muscle": {**DIRECT["nodes"]["muscle"], "specimen": "/etc/passwd"}}
    table = {"pressure": {"kind": "table", "file": "/etc/passwd"}}
    for word in ("x.y", packed(TANK)[:60], packed({**DIRECT, "nodes": nodes}), packed({**DIRECT, "signals": table})):
        with pytest.raises(InputError):
            unpacked(word)
    cut = visit(f"/circuit?models=none&c={packed(TANK)[:60]}")
    says(cut, ".circuit-said", "it was cut or changed on its way")
    until(lambda: cut.locator(".diagram .part").count() > 4)  # the page is there all the same


@pytest.mark.slow
def test_a_changed_value_is_redrawn_within_a_tenth_of_a_second(visit):
    page = opened(visit, DIRECT, "&part=tube")
    took = page.evaluate(
        """async () => {
        const found = []
        for (let i = 0; i < 40 && Math.min(999, ...found) >= 100; i++) {
          const field = document.querySelector('.ins .f:has(label.L) input')
          const was = document.querySelector('.curve figure').dataset.chart
          field.value = String(60 + i)
          const begin = performance.now()
          field.dispatchEvent(new Event('change', {bubbles: true}))
          while (document.querySelector('.curve figure').dataset.chart === was || !document.querySelector('.curve .uplot')) {
            await new Promise(requestAnimationFrame)
          }
          await new Promise(requestAnimationFrame)
          found.push(performance.now() - begin)
          await new Promise(r => setTimeout(r, 150))
        }
        return found
    }"""
    )
    assert min(took) < 100.0, took  # [ms]; the best: others work on this machine too
