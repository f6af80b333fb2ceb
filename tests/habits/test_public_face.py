"""What users write: pages and examples import nothing private, and the examples of docstrings are right."""

import doctest
import importlib
import re
import warnings
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
TEXTS = sorted([ROOT / "README.md", *DOCS.rglob("*.md"), *DOCS.rglob("*.ipynb"), *(ROOT / "examples").glob("*.py")])
IMPORT = re.compile(r"(?:from|import) (mckibben[\w.]*)(?: import ([\w, ]+))?")
# Objects whose examples take less than a second; those of a run or a sizing are the pages of the documentation.
QUICK = ("muscles.muscle:Muscle", "muscles.build:MuscleFactory")


@pytest.mark.parametrize("path", TEXTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_pages_and_examples_import_nothing_private(path):
    imports = IMPORT.findall(path.read_text(encoding="utf-8"))
    private = [f"{module} {names}" for module, names in imports if re.search(r"(^|[. ,])_\w", f"{module} {names}")]
    assert not private


def test_the_page_of_the_python_interface_needs_one_import():
    page = (DOCS / "tutorials/python.md").read_text(encoding="utf-8")
    assert {module for module, _ in IMPORT.findall(page)} == {"mckibben"}


def test_no_notebook_types_how_a_figure_becomes_a_picture():
    for book in DOCS.rglob("*.ipynb"):
        assert "to_svg" not in book.read_text(encoding="utf-8")


@pytest.mark.parametrize("place", QUICK)
def test_the_examples_of_docstrings_are_right(place):
    module, _, name = place.partition(":")
    found = doctest.DocTestFinder().find(getattr(importlib.import_module(f"mckibben.{module}"), name), name)
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for test in found:
            runner.run(test)
    assert runner.summarize(verbose=False).failed == 0 and any(test.examples for test in found)
