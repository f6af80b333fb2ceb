"""The Circuit page: valve, tube, volume and muscle from parts, with diagram and step response."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ....errors import InputError
from ...shelf import Shelf
from ...shell import asked
from ...workspace import Workspace

if TYPE_CHECKING:
    from starlette.requests import Request


def build(workspace: Workspace, request: Request) -> None:
    """Build the page."""
    from .document import read_text, starts, unpacked
    from .page import CircuitPage

    shelf = Shelf(workspace.recordings.folder / "circuits", (".toml",))
    view = asked(request, "part", "sensors", "flows", "models", "file")
    document, said, word = next(iter(starts().values())), "", request.query_params.get("c", "")
    try:
        if word:
            document = unpacked(word)
        elif "file" in view:
            document = read_text(shelf.found(f"{view['file']}.toml").read_text(encoding="utf-8"))
    except InputError as error:
        said = str(error)
    CircuitPage(workspace, shelf, document, view).build(said)
