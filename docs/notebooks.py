"""Convert a notebook to a page: run it in a kernel of its own, in an empty folder, and insert the outputs of its cells.

Notebooks are stored without outputs. A cell that raises or writes to standard error, for instance a warning, fails the
build. The metadata of a cell may contain ``alt``, the alternative text of its figure.
"""

from __future__ import annotations

import base64
import os
import re
import tempfile
from pathlib import Path
from typing import Any

from examples import ExampleError
from links import site_page

CELL_TIMEOUT = 600  # of one cell, on a busy machine [s]
FIGURES = {"image/svg+xml": "svg", "image/png": "png"}


def run_notebook(path: Path, name: str, figures: Path) -> str:
    """Return a notebook as a page, and save its figures in a folder.

    Args:
        path: path of the notebook.
        name: name of the page, relative to the folder of the documentation.
        figures: folder for the figures.
    """
    import nbformat
    from nbclient import NotebookClient
    from nbclient.exceptions import CellExecutionError
    from traitlets.config import Config

    book = nbformat.read(path, as_version=4)
    with tempfile.TemporaryDirectory() as folder:
        # Sockets between processes if available, instead of a network port that other users could listen to.
        sockets = {} if os.name == "nt" else {"transport": "ipc", "ip": os.path.join(folder, ".kernel")}
        options: dict[str, Any] = {"timeout": CELL_TIMEOUT, "resources": {"metadata": {"path": folder}}}
        try:
            NotebookClient(book, config=Config({"KernelManager": sockets}), **options).execute()
        except CellExecutionError as error:
            raise ExampleError(f"{name}:\n{_plain(str(error))}") from None
    back = "../" * name.count("/")
    parts = []
    for number, cell in enumerate(book.cells, 1):
        if cell.cell_type == "markdown":
            parts.append(site_page(cell.source, name))
            continue
        parts.append(f"```python\n{cell.source}\n```")
        for place, output in enumerate(_joined(cell.outputs)):
            where = f"{back}assets/generated/{Path(name).stem}"
            parts.append(_shown(output, cell, f"{name}, cell {number}", f"cell-{number}-{place}", figures, where))
    note = f"This page is a notebook: [{path.name}]({path.name}) runs on your machine, without a network."
    return "\n\n".join([parts[0], note, *parts[1:]]) + "\n"


def _joined(outputs: list[Any]) -> list[Any]:
    """Return the outputs of a cell with consecutive text of the same stream joined, because its division is arbitrary."""
    found: list[Any] = []
    for output in outputs:
        if found and output.output_type == "stream" == found[-1].output_type and output.name == found[-1].name:
            found[-1].text += output.text
        else:
            found.append(output)
    return found


def _shown(output: Any, cell: Any, place: str, figure: str, figures: Path, where: str) -> str:
    """Return one output of a cell as Markdown, after saving a figure to a file."""
    if output.output_type == "stream":
        if output.name == "stderr":
            raise ExampleError(f"{place} wrote to standard error:\n{output.text}")
        return f"```text\n{_plain(output.text)}\n```"
    data = output.data
    for kind, ending in FIGURES.items():
        if kind in data:
            file = figures / f"{figure}.{ending}"
            file.write_bytes(data[kind].encode() if ending == "svg" else base64.b64decode(data[kind]))
            alt = cell.metadata.get("alt")
            if not alt:
                raise ExampleError(f"{place} shows a figure, so its metadata must contain the alternative text `alt`")
            return f"![{alt}]({where}/{file.name})"
    return f"```text\n{_plain(data['text/plain'])}\n```"


def _plain(text: str) -> str:
    return re.sub(r"[ \t]+$", "", re.sub(r"\x1b\[[0-9;]*m", "", text), flags=re.M).strip("\n")
