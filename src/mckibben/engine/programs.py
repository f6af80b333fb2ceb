"""Programs that were lowered before, from disk: neither traced nor lowered again.

The structure of a program's results is kept with it, as words and lists: tables, tuples and modules by the places where
their types stand. Only types of this package that are loaded are found again, and they are put together without calling
anything that a file names. What cannot be said so, or has no `program_key`, is lowered anew in every process.
"""

from __future__ import annotations

import dataclasses
import json
import sys
from collections.abc import Callable
from typing import Any

import jax

from lanewise import Leaf, Program, cache, lower

from ..components import Module
from . import program_key


def lower_or_load(function: Callable[..., Any], *examples: Any, title: str = "") -> tuple[Program, Any]:
    """Find a function's program and the structure of its results on disk, or lower it; see `lanewise.lower`."""
    key = None if cache.cache_folder() is None else program_key.key(function, examples)
    known = None if key is None else _known(f"{key}.program")
    if known is not None:
        return known
    program, tree = lower(function, *examples, title=title)
    if key is not None:
        _keep(f"{key}.program", program, tree)
    return program, tree


def _known(file: str) -> tuple[Program, Any] | None:
    found = cache.load(file)
    if found is None:
        return None
    data, about = found
    try:
        given, wanted = ([Leaf(n, k, tuple(s)) for n, k, s in about[part]] for part in ("arguments", "results"))
        tree: Any = jax.tree.structure(_built(about["tree"]))
        if tree.num_leaves != len(wanted):
            return None
        return Program.from_parts(data, given, wanted, about["title"]), tree
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError):
        return None


def _keep(file: str, made: Program, tree: Any) -> None:
    """Keep a program, if the structure of its results can be said and is understood."""
    try:
        said = json.loads(json.dumps(_said(jax.tree.unflatten(tree, [0.0] * tree.num_leaves))))
    except TypeError:
        return
    if jax.tree.structure(_built(said)) != tree:
        return
    about = {"arguments": list(map(list, made.arguments)), "results": list(map(list, made.results))}
    cache.store(file, made.serialised, {**about, "title": made.title, "tree": said})


def _said(value: Any) -> Any:
    """A tree as words and lists; raises TypeError where there are none for it."""
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if type(value) is dict:
        return {"dict": [[k, _said(v)] for k, v in value.items()]}
    if type(value) in (list, tuple):
        return {type(value).__name__: [_said(v) for v in value]}
    kind = type(value)
    place = f"{kind.__module__}:{kind.__qualname__}"
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return {"named": place, "parts": [_said(v) for v in value]}
    if isinstance(value, Module):
        return {"module": place, "fields": [[f.name, _said(vars(value)[f.name])] for f in dataclasses.fields(value)]}
    raise TypeError(place)


def _built(said: Any) -> Any:
    """The inverse of `_said`."""
    if not isinstance(said, dict):
        return said
    if "dict" in said:
        return {k: _built(v) for k, v in said["dict"]}
    if "list" in said:
        return [_built(v) for v in said["list"]]
    if "tuple" in said:
        return tuple(_built(v) for v in said["tuple"])
    if "named" in said:
        kind = _own_type(said["named"], tuple)
        parts = [_built(v) for v in said["parts"]]
        if len(parts) != len(kind._fields):
            raise ValueError(said["named"])
        return tuple.__new__(kind, parts)
    kind = _own_type(said["module"], Module)
    fields = {name: _built(v) for name, v in said["fields"]}
    if list(fields) != [f.name for f in dataclasses.fields(kind)]:
        raise ValueError(said["module"])
    made = object.__new__(kind)  # its constructor would check numbers, and there are none
    vars(made).update(fields)
    return made


def _own_type(place: str, base: type) -> Any:
    """A type of this package by the place where it stands; nothing is imported, and nothing but a type is found.

    Raises:
        KeyError: there is no such place, or it is of another package.
        TypeError: no type stands there, or none of that kind.
    """
    home, _, name = place.partition(":")
    if home.partition(".")[0] != program_key.OWN:
        raise KeyError(place)
    found: Any = sys.modules[home]
    for part in name.split("."):
        found = vars(found)[part]
    if not (isinstance(found, type) and issubclass(found, base)) or (found.__module__, found.__qualname__) != (
        home,
        name,
    ):
        raise TypeError(place)
    return found
