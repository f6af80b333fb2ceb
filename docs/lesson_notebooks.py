"""Make a notebook of each lesson, to run it cell by cell: `python docs/lesson_notebooks.py` writes `examples/notebooks/`.

The cells are the blocks of the page in their order, which the build of the documentation executes on the page. A habit test
fails if a notebook is out of date.
"""

from __future__ import annotations

import json
import posixpath
import re
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parent
FOLDER = DOCS.parent / "examples" / "notebooks"
LESSONS = ("python", "first-muscle", "fit-your-data", "from-supply-to-muscle", "your-first-experiment")
PAGES = tuple(f"tutorials/{name}.md" for name in LESSONS)
NOTE = "To run this lesson cell by cell, take it as a notebook: [{name}.ipynb]({name}.ipynb)."
PIECE = re.compile(
    r"^```(?P<kind>python|console)\b[^\n]*\n(?P<body>.*?)^```[ \t]*$|^<!-- !\[(?P<alt>[^\]]*)\]\((?P<picture>[^)\s]+)\) -->$",
    re.M | re.S,
)


def notebook_of(text: str) -> str:
    """Return a page as a notebook without outputs, in JSON."""
    cells: list[dict[str, Any]] = []
    at = 0
    for match in PIECE.finditer(text):
        _add_words(cells, text[at : match.start()])
        at = match.end()
        if match["picture"]:
            name = posixpath.basename(match["picture"])
            _add_code(cells, f'from IPython.display import SVG\n\nSVG("{name}")', alt=match["alt"])
        elif match["kind"] == "console":
            commands = re.split(r"(?m)^\$ ", match["body"].replace("\\\n", " "))[1:]
            _add_code(cells, "\n".join("!" + re.sub(r" {2,}", " ", c).strip() for c in commands))
        else:
            _add_code(cells, match["body"].rstrip("\n"))
    _add_words(cells, text[at:])
    for number, cell in enumerate(cells, 1):
        cell["id"] = f"cell-{number}"
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    book = {"cells": cells, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}
    return json.dumps(book, indent=1, ensure_ascii=False) + "\n"


def _add_words(cells: list[dict[str, Any]], text: str) -> None:
    if text.strip():
        words = re.sub(r"\]\((?!https?:)([^)#\s]+)([^)\s]*)\)", _linked, text.strip("\n"))
        cells.append({"cell_type": "markdown", "metadata": {}, "source": words.splitlines(keepends=True)})


def _linked(match: re.Match[str]) -> str:
    """Return a link of a page as one of the folder of the notebooks."""
    place = posixpath.normpath(posixpath.join("docs/tutorials", match[1]))
    return f"]({posixpath.relpath(place, 'examples/notebooks')}{match[2]})"


def _add_code(cells: list[dict[str, Any]], code: str, *, alt: str = "") -> None:
    metadata = {"alt": alt} if alt else {}
    source = code.splitlines(keepends=True)
    cells.append({"cell_type": "code", "execution_count": None, "metadata": metadata, "outputs": [], "source": source})


def books() -> dict[Path, str]:
    """Return the notebooks of all lessons by their path."""
    texts = {name: (DOCS / "tutorials" / f"{name}.md").read_text(encoding="utf-8") for name in LESSONS}
    return {FOLDER / f"{name}.ipynb": notebook_of(text) for name, text in texts.items()}


if __name__ == "__main__":
    FOLDER.mkdir(parents=True, exist_ok=True)
    for path, book in books().items():
        path.write_text(book, encoding="utf-8", newline="\n")
        print(path.relative_to(DOCS.parent))
