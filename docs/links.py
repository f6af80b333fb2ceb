"""Links and pictures of the pages: what the repository shows, and what the site shows in their place.

In the repository a page may link only to what is stored there. Three things exist on the site alone:

    a generated page         linked as ``reference/index.md#nomenclature``, its heading on the page of the reference
    the page of a notebook   linked as the notebook, ``first.ipynb``
    a picture by an example  written as a comment, ``<!-- ![words](../assets/generated/PAGE/picture.svg) -->``

`site_page` turns these into the page, the page of the notebook, and the picture.
"""

from __future__ import annotations

import posixpath
import re

INDEX = "reference/index.md"
# Headings of the page of the reference, as the anchor of a link, and the generated page of each.
GENERATED = {
    "command-line": "reference/generated/cli.md",
    "nomenclature": "reference/generated/nomenclature.md",
    "glossary": "reference/generated/glossary.md",
    "parameters": "reference/generated/parameters.md",
    "specimens": "reference/generated/specimens.md",
    "parts": "reference/generated/catalogue.md",
    "rigs": "reference/generated/rigs.md",
    "boards": "reference/generated/boards.md",
    "conformance-of-hosts": "reference/generated/conformance.md",
    "the-papers-number-by-number": "reference/generated/papers.md",
    "literature": "reference/generated/literature.md",
    "python": "reference/api/mckibben.md",
}
PICTURE = re.compile(r"^<!-- (!\[[^\]]*\]\([^)\s]+\)) -->$", re.M)
LINK = re.compile(r"(?<!!)\]\(([^)\s]+)\)")
FENCED = re.compile(r"^(```.*?^```)", re.M | re.S)


def site_page(text: str, name: str) -> str:
    """Return a page as the site shows it.

    Args:
        text: the page as it is stored.
        name: its path in the folder of the documentation.
    """
    folder = posixpath.dirname(name)

    def linked(match: re.Match[str]) -> str:
        return f"]({_target(match[1], folder, name)})"

    pieces = FENCED.split(text)
    for i in range(0, len(pieces), 2):
        pieces[i] = LINK.sub(linked, PICTURE.sub(r"\1", pieces[i]))
    text = "".join(pieces)
    return _with_linked_headings(text) if name == INDEX else text


def _target(target: str, folder: str, name: str) -> str:
    if re.match(r"https?:", target):
        return target
    path, _, anchor = target.partition("#")
    place = posixpath.normpath(posixpath.join(folder, path)) if path else name
    if place == INDEX and anchor in GENERATED:
        return posixpath.relpath(GENERATED[anchor], folder or ".")
    return re.sub(r"\.ipynb(?=#|$)", ".md", target)


def _with_linked_headings(text: str) -> str:
    """Link the headings of the page of the reference to their pages."""

    def heading(match: re.Match[str]) -> str:
        page = GENERATED.get(github_anchor(match[1]))
        return match[0] if page is None else f"## [{match[1]}]({posixpath.relpath(page, posixpath.dirname(INDEX))})"

    return re.sub(r"^## (.+)$", heading, text, flags=re.M)


def github_anchor(heading: str) -> str:
    """Return the anchor that GitHub gives a heading."""
    words = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "")
    return re.sub(r"[^\w\- ]", "", words.lower()).strip().replace(" ", "-")


def site_anchor(heading: str) -> str:
    """Return the anchor that the site gives a heading."""
    words = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "")
    return re.sub(r"[\s-]+", "-", re.sub(r"[^\w\s-]", "", words).strip().lower())
