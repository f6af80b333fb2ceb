"""Figures that a page states are those of the file of results that lies beside their benchmark."""

import importlib
import json
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
BENCHMARKS = ROOT / "benchmarks"
MARK = re.compile(r"<!-- .*?written by benchmarks/(\w+)\.py.*? -->")
WRITERS = sorted(path.stem for path in BENCHMARKS.glob("*.py") if re.search(r"^WRITTEN = ", path.read_text(), re.M))


@pytest.fixture(scope="module")
def benchmark_module() -> Iterator[Callable[[str], ModuleType]]:
    """The benchmarks' modules by name, which are scripts and no package."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(BENCHMARKS))
        before = set(sys.modules)
        yield importlib.import_module
        for name in set(sys.modules) - before:
            if str(getattr(sys.modules[name], "__file__", "")).startswith(str(BENCHMARKS)):
                del sys.modules[name]


@pytest.mark.parametrize("name", WRITERS)
def test_a_page_states_what_the_file_of_results_says(benchmark_module, name: str) -> None:
    results = json.loads((BENCHMARKS / f"{name}.json").read_text(encoding="utf-8"))
    for part in benchmark_module(name).WRITTEN:
        page, expected = part.in_page(results)
        assert page == expected, (
            f"docs/{part.page} is not what benchmarks/{name}.json says: write it by {name}.py --draw"
        )


def test_every_part_that_names_a_benchmark_is_held_against_it(benchmark_module) -> None:
    marked = {
        (path.relative_to(ROOT / "docs").as_posix(), found[0])
        for path in (ROOT / "docs").rglob("*.md")
        for found in MARK.finditer(path.read_text(encoding="utf-8"))
    }
    held = {(part.page, part.begin) for name in WRITERS for part in benchmark_module(name).WRITTEN}
    assert marked == held


def test_the_table_of_all_intervals_has_what_each_benchmark_counted(benchmark_module) -> None:
    kept = json.loads((BENCHMARKS / "intervals.json").read_text(encoding="utf-8"))
    assert benchmark_module("intervals").gathered() == kept, "gather them anew: python benchmarks/intervals.py"


def results(name: str) -> Any:
    return json.loads((ROOT / name).read_text(encoding="utf-8"))


def said_of_muscles() -> list[str]:
    rows = {(one["task"], one["readings"]): one["declared"] for one in results("benchmarks/between.json")}
    unread = [100 * rows[name, "none"]["max"] for name in ("DMSP-10-250", "DMSP-20-300")]
    at_rest = [100 * rows[name, "rest"]["coverage"] for name in ("DMSP-10-250", "DMSP-20-300")]
    return [
        f"were off by up to {unread[0]:.0f} and {unread[1]:.0f} %",
        f"with a reading at rest hold nearly all instead of {at_rest[0]:.0f} %, and those of `DMSP-20-300` less than half"
        f" instead of {at_rest[1]:.0f} %.",
    ]


def said_of_points() -> list[str]:
    scores = {(one["task"], one["model"]): one for one in results("docs/reference/benchmark.json")["scores"]}
    loop, other = (100 * scores["loop", m]["rms"] for m in ("friction", "friction_discrepancy"))
    pair = [100 * scores["antagonist", m]["rms"] for m in ("friction", "friction_discrepancy")]
    rows = {(one["task"], one["law"]): one for one in results("benchmarks/coverage_measured.json")}
    law, above = "seated_hyperelastic_braid", "map-above-4-bar"
    folds, missed = rows["map-length-out", law]["folds"], 100 * (1.0 - rows["map-length-out", law]["inside"])
    assert rows["map-length-out", law]["points"] == 100
    assert [name for name, share in folds.items() if share < 1.0] == ["DMSP-20-300, 237 mm", "DMSP-20-300, 296 mm"]
    by_pressure = [rows["map-pressure-out", one]["folds"] for one in (law, "seated_braid")]
    assert [n for n in by_pressure[0] if all(one[n] == 0.0 for one in by_pressure)] == ["DMSP-10-250, 4.414 bar"]
    return [
        f"lowers the error of the hidden half from {loop:.2f} to {other:.2f} % of the stroke",
        f"({pair[0]:.2f} to {pair[1]:.2f} %)",
        f"Of the {missed:.0f} points that `{law}` misses where a length is left out",
        f"above 4 bar `{law}` errs by {100 * scores[above, law]['rms']:.1f} % rms, and its interval of"
        f" {100 * rows[above, law]['half_width']:.1f} % does not know that",
    ]


def said_of_laws() -> list[str]:
    scores = {(one["task"], one["model"]): one for one in results("docs/reference/benchmark.json")["scores"]}
    law, task, braid = "seated_hyperelastic_braid", "other-lengths", "seated_braid"
    both = [[100 * scores[task, one][name] for name in ("rms", "largest")] for one in (law, braid)]
    most = {one: 100 * scores[one, law]["largest"] for one in ("map-pressure-out", "map-above-4-bar", "data-sheet")}
    lengths = results("benchmarks/lengths.json")
    ours, ends = lengths["laws"][law], [lengths["laws"][one]["trends"]["end"] for one in (braid, law)]
    without = [ours["without"][name]["sd_of_set_length"] for name in ("83 mm", "182 mm", "281 mm")]
    narrow, wide = lengths["longest_length_out"]
    middle = [[*one["reading"].values()][1]["largest"] for one in (narrow, wide)]  # at half the pressure
    half = [r for bar, r in wide["reading"].items() if float(bar.split()[0]) > 2.0]
    perfect, rubber = ours["perfect_law"], [one["parameters"]["ogden_exponent"]["with"] for one in (narrow, wide)]
    return [
        *(f"yes: {value:.2f} %" for value in most.values()),
        f"comes out as {rubber[0]['value']:.1f}, {rubber[1]['value']:.1f} and",
        f"intervals of {rubber[0]['low']:.1f} to {rubber[0]['high']:.1f}, {rubber[1]['low']:.1f} to {rubber[1]['high']:.1f}",
        "no: {:.2f} % rms, {:.1f} % at most; `seated_braid` {:.2f} % and {:.1f} %".format(*both[0], *both[1]),
        f"{100 * narrow['plain']['largest']:.1f} % and {100 * wide['plain']['largest']:.1f} %; with one reading there,"
        f" {100 * middle[0]:.1f} % and {100 * middle[1]:.1f} %",
        f"would leave {100 * perfect['rms'][0]:.1f} % rms and {100 * perfect['largest'][0]:.1f} % at most. It would meet"
        f" both goals in {100 * perfect['goals_met'][2]:.0f} of 100 such experiments",
        f"in {100 * ours['perfect_law_over_sd']['0.3']['goals_met'][2]:.0f} if the scatter is at the lower end",
        f"`{braid}` asks for {ends[0]['slope']:.0f} ± {ends[0]['standard_error']:.0f} mm",
        f"for {ends[1]['slope']:.0f} ± {ends[1]['standard_error']:.0f} mm",
        f"as {without[0]:.1f}, {without[1]:.1f} and {without[2]:.1f} mm",
        "does: {:.1f} to {:.1f} % rms and {:.1f} to {:.1f} % at most".format(
            *(100 * end(one[name] for one in half) for name in ("rms", "largest") for end in (min, max))
        ),
    ]


def said_of_friction() -> list[str]:
    made = results("benchmarks/friction_in_time.json")
    law, both = made["models"]["law"], made["models"]["friction and creep"]
    scores = {(one["task"], one["model"]): one for one in results("docs/reference/benchmark.json")["scores"]}
    every, tenth = (made["command"][one]["parameters"]["per_pressure"] for one in ("1", "10"))
    assert 9.0 < every[0] / tenth[0] < 14.0 and tenth[2] < every[1]  # a tenth, and far outside of either interval
    assert 0.3 < both["bias_venting"] / law["bias_venting"] < 0.5  # more than halved
    return [
        f"only {100 * (1.0 - both['held_back'] / law['held_back']):.0f} % better",
        f"{both['rms']:.1f} of the {law['rms']:.1f} N are left to the law",
        f"within {100 * scores['loop', 'friction']['rms']:.2f} % of the stroke, and",
        f"within {100 * scores['loop', 'friction_discrepancy']['rms']:.2f} % with [a discrepancy]",
    ]


def said_of_characterisations() -> list[str]:
    made = results("benchmarks/characterise.json")
    drifts = [r["gain_change"] for r in made["muscles"] if r.get("gain_change")]
    hidden = sum(abs(value) - nearest > 0.003 for value, nearest in (one["sound"] for one in drifts))
    change = 100 * made["summary"]["sound"]["change without a drift, largest"]
    return [
        f"The table is of the {made['summary']['all']['muscles']} muscles of seed {made['seed']}",
        f"as in {hidden} of {len(drifts)} (the change of {change:.1f} % is one of these)",
    ]


def said_of_faults() -> list[str]:
    made = results("benchmarks/diagnosis.json")
    assert made["faulty"]["turns"] == 1
    return [
        "is of the first of their rounds, one run of each fault on each case",
        f"shown at 95 % by {made['sound']['runs']:,} sound runs without an alarm",
        f"The seed of these runs, {made['seed']}, was never used before",
    ]


SAID = {
    "how-far-to-trust-a-number": said_of_muscles, "uncertainty": said_of_points, "laws": said_of_laws,
    "friction": said_of_friction, "characterise-a-muscle": said_of_characterisations, "diagnosis": said_of_faults,
}  # fmt: skip


@pytest.mark.parametrize("name", SAID)
def test_a_sentence_beside_a_table_states_what_the_file_of_results_says(name: str) -> None:
    (path,) = (ROOT / "docs").rglob(f"{name}.md")
    page = " ".join(path.read_text(encoding="utf-8").split())
    assert [] == [sentence for sentence in SAID[name]() if sentence not in page]


def test_a_figure_that_was_changed_on_a_page_is_found(benchmark_module, tmp_path: Path, monkeypatch) -> None:
    written = benchmark_module("written")
    monkeypatch.setattr(written, "DOCS", tmp_path)
    part = written.WrittenPart("page.md", "<!-- begin -->", "<!-- end -->", lambda result: f"{result['share']:.0f} %")
    (tmp_path / "page.md").write_text("before\n<!-- begin -->\n\n95 %\n\n<!-- end -->\nbehind\n")
    assert part.in_page({"share": 94.0}) == (
        "before\n<!-- begin -->\n\n95 %\n\n<!-- end -->\nbehind\n",
        "before\n<!-- begin -->\n\n94 %\n\n<!-- end -->\nbehind\n",
    )
    written.write([part], {"share": 94.0})
    assert part.in_page({"share": 94.0})[0] == part.in_page({"share": 94.0})[1]
