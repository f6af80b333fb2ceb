"""What a result shows of itself: a line or two, however much it holds."""

import ast
import contextlib
import dataclasses
import importlib
import inspect
import sys
import typing
from pathlib import Path

import numpy as np
import pytest

import mckibben
from mckibben.components.module import Module

MANY = 2000
# Rooms of the engine, whose states nobody is given; they are trees of arrays.
ENGINE = (
    "assembly.muscle_unit",
    "components",
    "engine",
    "muscles",
    "pneumatics",
    "assembly.loads",
    "bench.software",
    "bench.segment",
    "schema",
)
LONGEST = 2000  # characters: some 25 lines of a terminal, no more than a screen


def imported(module):
    """Names that a module imports, for type checkers only too."""
    names = {}
    package = module.__name__ if Path(module.__file__).name == "__init__.py" else module.__name__.rpartition(".")[0]
    for node in ast.walk(ast.parse(Path(module.__file__).read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            with contextlib.suppress(ImportError):  # of a library that is not installed
                source = importlib.import_module("." * node.level + (node.module or ""), package)
                names |= {n.asname or n.name: getattr(source, n.name) for n in node.names if hasattr(source, n.name)}
        elif isinstance(node, ast.Import):
            with contextlib.suppress(ImportError):
                modules = {n.asname or n.name.partition(".")[0]: n.name for n in node.names}
                names |= {k: importlib.import_module(v if k != v.partition(".")[0] else k) for k, v in modules.items()}
    return names


def hints(thing):
    try:
        return typing.get_type_hints(thing)
    except (NameError, TypeError):
        bases = [b for b in getattr(thing, "__mro__", (thing,)) if b.__module__.startswith("mckibben")]
        names = {"jax": importlib.import_module("jax")}  # which `_jax` loads on first use
        for base in bases:
            names |= imported(sys.modules[base.__module__])
        with contextlib.suppress(NameError, TypeError):  # of a library that is not installed
            return typing.get_type_hints(thing, localns=names)
        return {}


def classes_in(hint):
    if inspect.isclass(hint) and hint.__module__.startswith("mckibben"):
        yield hint
    for part in typing.get_args(hint):
        yield from classes_in(part)


def is_record(one):
    return dataclasses.is_dataclass(one) or (issubclass(one, tuple) and hasattr(one, "_fields"))


def result_types():
    """Types that public functions return, those that their methods return and their fields hold, and so on."""
    from mckibben.batch import drive, store, sweep

    known, todo = {}, [getattr(mckibben, name) for name in mckibben._SOURCES]
    todo += [store.read_results, drive.run_sweep, sweep.run_batch]
    while todo:
        thing = todo.pop()
        found = []
        if inspect.isclass(thing):
            if thing in known:
                continue
            known[thing] = None
            members = [v for name, v in vars(thing).items() if not name.startswith("_")]
            todo += [getattr(v, "fget", None) or getattr(v, "func", None) or getattr(v, "__func__", v) for v in members]
            found = [h for name, h in hints(thing).items() if not name.startswith("_")] if is_record(thing) else []
        elif inspect.isfunction(thing) and thing.__module__.startswith("mckibben"):
            found = [hints(thing).get("return")]
        todo += [one for hint in found for one in classes_in(hint) if one not in known]
    engine = tuple(f"mckibben.{room}" for room in (*ENGINE, "experiments.waveforms"))
    return [
        one for one in known
        if is_record(one) and not issubclass(one, Module) and not one.__module__.startswith(engine)
    ]  # fmt: skip


def generated(one):
    """Whether the representation is the one that Python makes of the fields."""
    source = one.__repr__
    place = getattr(getattr(source, "__wrapped__", source), "__code__", None)
    return place is None or place.co_filename == "<string>" or "collections" in place.co_filename


def filled(hint, depth=0):
    """A value of a type, with many entries where it may have many."""
    origin, parts = typing.get_origin(hint), typing.get_args(hint)
    if inspect.isclass(hint) and is_record(hint) and depth < 3 and not issubclass(hint, Module):
        fields = hints(hint)
        names = hint._fields if hasattr(hint, "_fields") else [f.name for f in dataclasses.fields(hint)]
        value = tuple.__new__(hint, [filled(fields[n], depth + 1) for n in names]) if hasattr(hint, "_fields") else None
        if value is None:
            value = object.__new__(hint)
            for name in names:
                object.__setattr__(value, name, filled(fields[name], depth + 1))
        return value
    if hint is np.ndarray:
        return np.linspace(0.0, 1.0, MANY)
    if origin is tuple and parts and parts[-1] is not ...:
        return tuple(filled(part, depth + 1) for part in parts)
    if origin is not None and inspect.isclass(origin) and issubclass(origin, dict | typing.Mapping):
        return {f"name{i}": 0.125 for i in range(MANY)}
    if origin in (list, tuple) or hint in (list, tuple):
        return (origin or hint)([0.125] * MANY)
    if origin is typing.Union or str(origin) == "<class 'types.UnionType'>":
        return filled(next(part for part in parts if part is not type(None)), depth)
    if origin is not None and "Sequence" in str(origin):
        return (0.125,) * MANY
    return "a word" if hint is str else 0.125


@pytest.mark.parametrize("one", [one for one in result_types() if generated(one)], ids=lambda c: c.__name__)
def test_a_result_shows_no_more_than_a_screen_of_itself(one):
    assert len(repr(filled(one))) <= LONGEST


def test_there_are_results_to_look_at():
    """The search goes through the annotations; an import that it cannot follow would leave it empty."""
    names = {one.__name__ for one in result_types()}
    assert {"Results", "Recording", "Fit", "Ranking", "Sizing", "MuscleTable", "WorkingCycles", "Diagnosis"} <= names
