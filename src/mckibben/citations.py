"""Citations of a run: keys are collected where papers are used, and printed at the end of a report."""

from __future__ import annotations

import functools
import re
from collections.abc import Iterable
from importlib import resources

from .errors import InputError


@functools.cache
def _entries() -> dict[str, str]:
    text = (resources.files(__package__) / "references.bib").read_text(encoding="utf-8")
    return {
        re.split(r"[{,]", entry, maxsplit=2)[1]: entry.strip()
        for entry in re.split(r"(?m)^(?=@)", text)
        if entry.strip()
    }


def known_keys() -> list[str]:
    """All citation keys."""
    return list(_entries())


def bibtex(keys: Iterable[str]) -> str:
    """The BibTeX entries of just these keys, in the order given, each once."""
    return "\n\n".join(_entry(key) for key in dict.fromkeys(keys)) + "\n"


def reference(key: str) -> str:
    """Format one reference as a line of text."""
    entry = _entry(key)
    *most, last = _field(entry, "author").split(" and ")
    authors = f"{', '.join(most)} and {last}" if most else last
    parts = [authors, f"({_field(entry, 'year')})", _field(entry, "title")]
    place = next(filter(None, (_field(entry, name) for name in ("journal", "booktitle", "publisher", "note"))), "")
    volume, number, pages = (_field(entry, name) for name in ("volume", "number", "pages"))
    if volume:
        place += f" {volume}" + (f"({number})" if number else "") + (f", {pages.replace('--', '-')}" if pages else "")
    doi = _field(entry, "doi")
    parts += [place, f"doi:{doi}" if doi else ""]
    head, *rest = (p for p in parts if p)
    return f"{head} " + ". ".join(rest) + "."


def doi(key: str) -> str | None:
    """The DOI of a reference, if it has one."""
    return _field(_entry(key), "doi") or None


def _entry(key: str) -> str:
    if key not in _entries():
        raise InputError("citation", key, known=_entries())
    return _entries()[key]


def _field(entry: str, name: str) -> str:
    match = re.search(rf"(?m)^\s*{name}\s*=\s*\{{(.*)\}},?\s*$", entry)
    if match is None:
        return ""
    accents = {"'a": "á", "'e": "é", "'o": "ó", "'i": "í", '"o': "ö", '"u': "ü"}
    text = re.sub(r"\{\\(['\"][a-z])\}", lambda m: accents.get(m.group(1), m.group(1)[-1]), match.group(1))
    return text.replace("{", "").replace("}", "")
