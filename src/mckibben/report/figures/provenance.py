"""What a file of a figure says about itself: title, what was drawn, and the version that drew it."""

from __future__ import annotations

import html
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from .places import place_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ...recordings import Recording

_NAME = "_mckibben_source"


class Provenance(NamedTuple):
    """Title of a figure, the source of its data, and the program."""

    title: str
    source: str
    program: str


def describe(fig: Figure, source: str) -> None:
    """Record the source of what a figure shows."""
    setattr(fig, _NAME, source)


def of(fig: Figure) -> Provenance:
    """What a figure says about itself; its title is its first heading."""
    from ... import __version__

    texts = [t for ax in fig.axes for t in ax.texts if (p := place_of(t)) is not None and p.kind == "heading"]
    title = " ".join(texts[0].get_text().split()) if texts else ""
    return Provenance(title, str(getattr(fig, _NAME, "")), f"mckibben {__version__}")


def recording_source(recording: Recording) -> str:
    """Run, muscle, rig and seed of a recording, in one line."""
    meta = recording.meta
    named = {"protocol": "protocol", "specimen": "muscle", "rig": "rig", "circuit": "circuit", "seed": "seed"}
    parts = [f"{word} {_name(meta[key])}" for key, word in named.items() if meta.get(key) not in (None, "")]
    if meta.get("created"):
        parts.append(f"recorded {meta['created']}")
    return ", ".join(parts)


def _name(value: Any) -> str:
    if isinstance(value, Mapping):
        return str(next((value[key] for key in ("name", "id", "title") if value.get(key)), "of its own"))
    return str(value)


def entries(origin: Provenance, suffix: str) -> dict[str, str | None]:
    """Metadata of a PDF or PNG file, without a date."""
    if suffix == ".pdf":
        entries: dict[str, str | None] = {"Creator": origin.program, "Producer": None, "CreationDate": None}
        return entries | {k: v for k, v in (("Title", origin.title), ("Subject", origin.source)) if v}
    software: dict[str, str | None] = {"Software": origin.program}
    return software | {k: v for k, v in (("Title", origin.title), ("Description", origin.source)) if v}


def in_svg(text: str, origin: Provenance) -> str:
    """An SVG document with its metadata as Dublin Core."""
    words = {"title": origin.title, "description": origin.source, "creator": origin.program}
    terms = "".join(f"<dc:{name}>{html.escape(word)}</dc:{name}>" for name, word in words.items() if word)
    block = (
        '<metadata><rdf:RDF xmlns:dc="http://purl.org/dc/elements/1.1/" xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">'
        f'<rdf:Description rdf:about="">{terms}</rdf:Description></rdf:RDF></metadata>'
    )
    return re.sub(r"(<svg\b[^>]*>)", lambda m: f"{m[1]}\n {block}", text, count=1)
