"""The command that this package adds to ``mckibben``: ``reproduce``, the papers' numbers row by row, and their figures."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from mckibben.cli._outputs import OBJECT, REPORT, TABLE, OutputFiles, OutputKinds
from mckibben.cli._progress import progress
from mckibben.cli._verb import VerbCommand
from mckibben.errors import InputError, not_found
from mckibben.report import document, document_pdf

from . import report as papers


def _check_places(given: Mapping[str, Any], files: OutputFiles) -> None:
    """Refuse places that cannot be written, before anything is computed, which takes minutes."""
    if len(files["folder"]) > 1:
        raise InputError("--out", str(files["folder"][1]), "must be one folder, beside files")
    for folder in files["folder"]:
        if not given["figures"] and not given["pdf"]:  # the flag is typed to leave it out
            document_pdf.compiler("--no-pdf writes the HTML report alone")
        if folder.exists() and not folder.is_dir():
            raise InputError("--out", str(folder), "must be a folder; it is a file")
        if not folder.absolute().parent.is_dir():
            raise not_found(folder.absolute().parent, "folder")
        for name in papers.REPORTS if folder.is_dir() and not given["figures"] else ():
            if not (name.endswith(".pdf") and given["pdf"]):
                document.checked_place(folder / name, field="--out")


@contextlib.contextmanager
def _reproducing(given: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    @contextlib.contextmanager
    def begun(count: int) -> Iterator[Callable[[str, float], None]]:
        with progress("reproducing", count) as bar:
            yield bar

    yield {"begun": begun}


reproduce_papers = VerbCommand(
    "mckibben_papers.report:reproduce_papers",
    OutputKinds("both reports, or with --figure the figures in --format,", report=REPORT, table=TABLE, result=OBJECT),
    ("reproduce --part IV --no-recordings --out energy.html",),
    options={"rows": "row", "figures": "figure", "figure_format": "format"},
    writes={"report": lambda answer, path: [answer.report(path)], "folder": lambda answer, folder: answer.save(folder)},
    check=_check_places,
    from_files=lambda given, files: {"draws": bool(given["figures"] or files["report"] or files["folder"])},
    around=_reproducing,
)
