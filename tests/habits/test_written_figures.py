"""Figures that a page states are those of the file of results that lies beside their benchmark."""

import importlib
import json
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

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
