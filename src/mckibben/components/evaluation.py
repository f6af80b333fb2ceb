"""Formulas evaluated on plain numbers by kernels, for which JAX need not be loaded.

A formula is written once, for JAX. Called with numbers or NumPy arrays, it is a kernel that was lowered from it and is kept
on disk: microseconds a call, in place of the tens of operations that JAX would do one by one. Called with arrays of JAX or
inside a function that JAX traces, it is traced as it is written.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from lanewise import LoweringError, Program, UnavailableError

from .._jax import Tree, is_jax_array, is_traced, jax
from .module import flatten
from .programs import find_program, lower_or_load

NUMBERS = (float, int, np.ndarray, np.generic)
# Lanes up to which one core is enough, and beyond which a call goes by blocks on all of them.
SINGLE_CORE = 20_000
MOST_KNOWN = 256  # formulas with the structures of their owners that are remembered
Method = TypeVar("Method", bound=Callable[..., Any])
_known: dict[Any, Any] = {}


def evaluated(method: Method) -> Method:
    """Let a method of a module, elementwise in its arguments, be evaluated by a kernel where all its numbers are plain.

    Its results are then NumPy's; they agree with those of JAX to rounding.

    Args:
        method: method of a module whose leaves are numbers, or a function whose first argument is one; it returns one array,
            or a tuple of arrays.
    """
    names = list(inspect.signature(method).parameters)[1:]
    defaults = getattr(method, "__defaults__", None) or ()  # a function that JAX transforms has none

    @functools.wraps(method)
    def call(self: Any, *arguments: Any, **options: object) -> Any:
        if options:
            return method(self, *arguments, **options)
        missing = len(names) - len(arguments)
        if 0 < missing <= len(defaults):
            arguments = (*arguments, *defaults[len(defaults) - missing :])
        if len(arguments) != len(names) or not all(isinstance(x, NUMBERS) for x in arguments):
            return method(self, *arguments)
        leaves, structure = flatten(self)
        if not (all(map(_is_number, leaves)) and all(map(np.size, arguments)) and _has_hash(structure)):
            return method(self, *arguments)
        try:
            return _call(_kernel(method, self, structure, len(arguments)), leaves, arguments)
        except (LoweringError, UnavailableError):  # an operation that no kernel can do, or no LLVM
            return method(self, *arguments)

    return call  # type: ignore[return-value]


def _has_hash(structure: Any) -> bool:
    """Whether all static fields of a structure have a hash."""
    try:
        hash(structure)
    except TypeError:
        return False
    return True


def _is_number(leaf: Any) -> bool:
    """Whether a leaf is one number that is known."""
    return (isinstance(leaf, NUMBERS) or is_jax_array(leaf)) and not np.shape(leaf) and not is_traced(leaf)


def _kernel(method: Callable[..., Tree], owner: Any, structure: Any, count: int) -> tuple[Program, Tree]:
    """The program of a method, and a tree like its results; what could not be lowered once raises at once."""
    key = (method, structure)
    known = _known.get(key)
    if known is None:
        while len(_known) >= MOST_KNOWN:
            _known.pop(next(iter(_known)), None)
        try:
            known = _load_or_lower(method, (owner, *[0.0] * count))
        except LoweringError as error:
            known = error
        _known[key] = known
    if isinstance(known, LoweringError):
        raise known
    return known


def _load_or_lower(method: Callable[..., Tree], examples: tuple[Tree, ...]) -> tuple[Program, Tree]:
    known = find_program(method, *examples)
    if known is not None:
        return known
    program, tree = lower_or_load(method, *examples, title=method.__qualname__)
    return program, jax.tree.unflatten(tree, [0.0] * tree.num_leaves)


def _call(run: tuple[Program, Tree], leaves: list[Any], arguments: tuple[Tree, ...]) -> Any:
    """Results for arguments of any shapes that broadcast."""
    program, example = run
    values = [np.asarray(x, float) for x in arguments]
    shape = np.broadcast_shapes(*(x.shape for x in values))
    results: list[Any] = []
    if shape:
        lanes = int(np.prod(shape))
        flat = [np.broadcast_to(x, shape).reshape(lanes) for x in values]
        threads = 1 if lanes <= SINGLE_CORE else None
        for column in program.call([*leaves, *flat], lanes=lanes, mode="strict", threads=threads):
            array = np.asarray(column)
            results.append(np.full(shape, array) if array.ndim == 0 else array.reshape(shape))
    else:
        for number in program.call([*leaves, *values], mode="strict"):
            results.append(np.asarray(number)[()])
    if isinstance(example, tuple):
        return type(example)(*results) if hasattr(example, "_fields") else tuple(results)
    return results[0]
