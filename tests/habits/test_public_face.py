"""What users write: pages and examples import nothing private, and the examples of docstrings are right."""

import importlib.util
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
TEXTS = sorted([ROOT / "README.md", *DOCS.rglob("*.md"), *DOCS.rglob("*.ipynb"), *(ROOT / "examples").glob("*.py")])
IMPORT = re.compile(r"(?:from|import) (mckibben[\w.]*)(?: import ([\w, ]+))?")


def docstrings():
    """The script of the documentation's build that runs the examples of docstrings."""
    spec = importlib.util.spec_from_file_location("docstrings", DOCS / "docstrings.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


EXAMPLES = docstrings()


@pytest.mark.parametrize("path", TEXTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_pages_and_examples_import_nothing_private(path):
    imports = IMPORT.findall(path.read_text(encoding="utf-8"))
    private = [f"{module} {names}" for module, names in imports if re.search(r"(^|[. ,])_\w", f"{module} {names}")]
    assert not private


# Modules that pages import from, since a name of theirs is that of a module of their package, or since they are a subject.
MODULES = {
    "mckibben.assembly.pair_map": "the function has the name of its module",
    "mckibben.components.paths": "paths.put",
}


def test_pages_and_examples_import_from_packages_not_from_modules_inside_them():
    """So that a reader learns `mckibben.pneumatics`, and a module can move within it."""
    deep = set()
    for path in TEXTS:
        for module, _ in IMPORT.findall(path.read_text(encoding="utf-8")):
            place = ROOT / "src" / module.replace(".", "/")
            if "decisions" not in path.parts and module.count(".") > 1 and not (place / "__init__.py").is_file():
                deep.add(module)
    assert deep == set(MODULES)


def test_no_notebook_types_how_a_figure_becomes_a_picture():
    for book in DOCS.rglob("*.ipynb"):
        assert "to_svg" not in book.read_text(encoding="utf-8")


@pytest.mark.parametrize("name", EXAMPLES.names())
def test_a_public_name_has_an_example_and_a_quick_one_is_right(name):
    """Those that take seconds are run by the build of the documentation, on the page of the reference."""
    if name in EXAMPLES.LONG:
        assert EXAMPLES.examples(name)
    else:
        assert EXAMPLES.failures(name) == ""


USERS = sorted([*DOCS.glob("tutorials/*.*"), *DOCS.glob("jobs/*.md"), DOCS / "index.md", ROOT / "README.md"])


@pytest.mark.parametrize("path", USERS, ids=lambda path: str(path.relative_to(ROOT)))
def test_lessons_and_jobs_need_one_import(path):
    imports = IMPORT.findall(path.read_text(encoding="utf-8"))
    assert {module for module, _ in imports} <= {"mckibben"}
