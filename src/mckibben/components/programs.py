"""Formulas as programs: evaluated on plain numbers by kernels, which are found on disk where they were lowered before.

A formula is written once, for JAX. Called with numbers or NumPy arrays, one that is `evaluated` is a kernel that was
lowered from it and is kept on disk: microseconds a call, in place of the tens of operations that JAX would do one by one.
Called with arrays of JAX or inside a function that JAX traces, it is traced as it is written.

A program is found by its key, a hash of all that tracing a function for examples of its arguments depends on:

* the sources of the compiler and of this package, without those packages above all that the function comes from, which it
  cannot import; and those of other packages that it comes from;
* the function: where it stands, and what is bound to it (`functools.partial`);
* the examples: structure, with types and static fields, and shapes and types of the leaves, not their values;
* the modules that all these come from and those they use: their plain constants, as they are now, and the names of their
  functions and types, for either may have been replaced;
* how JAX counts: with 64 bits, and by which promotion.

Its last digits are of the versions of Python, JAX and NumPy. What a wheel brings in `LOWERED` is found by the others: the
programs of what is called first, which are the same equations whichever of these versions lowered them.

A file of the user's own (`registry.load_reference`) is known by its content, after which its module is named, if it imports
nothing that nobody watches and its other values are plain or arrays.

Neither the key nor the program needs JAX, which is loaded where something has to be lowered.

What has no sure name has no key: lambdas and what is defined inside a function, methods of objects that are no trees, and
all types and functions that are neither this package's, nor those of one that has joined it (`registry.join`), nor a
library's named above.

The structure of a program's results is kept with it, as words and lists: tables, tuples and modules by the places where
their types stand. Only types of these packages that are loaded are found again, and they are put together without calling
anything that a file names. What cannot be said so, or has no key, is lowered again in every process.
"""

from __future__ import annotations

import dataclasses
import enum
import functools
import hashlib
import importlib
import importlib.util
import inspect
import json
import os
import sys
import threading
import types
import weakref
from collections.abc import Callable, Container, Iterable, Sequence
from importlib.machinery import ModuleSpec
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np

import lanewise
from lanewise import Leaf, LoweringError, Program, UnavailableError, cache

from .._jax import Tree, is_jax_array, is_loaded, is_traced, jax
from .._lazy import LazyModule
from ..registry import FILE_MODULE, WATCHED
from .module import Module, flatten

OWN = __name__.partition(".")[0]
LIBRARIES = frozenset({"builtins", "functools", "operator", "math", "jax", "jaxlib", "numpy", "lanewise"})
PLAIN = (bool, int, float, str, bytes, type(None))
# The upper layers of this package, from the top: none is imported by those after it, as the contract in pyproject.toml says.
LAYERS = "cli web report studies control batch bench/identification/simulation analysis"
UPPER = [layer.split("/") for layer in LAYERS.split()]
INSTALLED = str(Path(__file__).parents[2])  # the same program serves every place
LOWERED = Path(__file__).parents[1] / "lowered"  # absent in a copy of the sources; `tests/wheel/check.py` makes it
DIGITS = 32  # of a key that are not of versions
cache.use_cache("mckibben", "MCKIBBEN_KERNELS")


class UnnamedError(Exception):
    """An object has no unambiguous name, so that there is no key."""


def program_key(function: Callable[..., Tree], examples: Sequence[Tree]) -> str | None:
    """The key of a function's program; None if it has none.

    Args:
        function: the function to trace.
        examples: trees like its arguments.
    """
    name = _Name()
    try:
        name.static(function)
        name.tree(tuple(examples))
        name.constants()
    except UnnamedError:
        return None
    return name.digest.hexdigest()[:DIGITS] + _versions()


@functools.cache
def _versions() -> str:
    """The last digits of a key, which differ for other versions of Python, NumPy and JAX, which is not loaded for it."""
    place = Path(str(cast(ModuleSpec, importlib.util.find_spec("jax")).origin)).with_name("version.py")
    return hashlib.sha256(repr((sys.version, np.__version__, place.read_bytes())).encode()).hexdigest()[: 40 - DIGITS]


@functools.cache
def source_digest(top: int, joined: tuple[str, ...] = ()) -> bytes:
    """Part of every key that depends on sources only.

    Args:
        top: number of layers of `UPPER` that are left out.
        joined: packages beside this one, which are loaded.
    """
    digest = hashlib.sha256()
    without = {name for layer in UPPER[:top] for name in layer}
    others = [str(Path(str(sys.modules[name].__file__)).parent) for name in ("lanewise", *joined)]
    for folder, left_out in ((str(Path(__file__).parents[1]), without), *((folder, set()) for folder in others)):
        for path in sources(folder, left_out):
            data, inside = Path(path).read_bytes(), path.removeprefix(folder).replace(os.sep, "/")
            digest.update(f"{inside} {len(data)}\n".encode() + data)
    return digest.digest()


def sources(folder: str, without: Container[str] = ()) -> list[str]:
    """All Python files below a folder, in a fixed order, except those in some of its own folders."""
    files: list[str] = []
    for entry in os.scandir(folder):
        if entry.is_dir(follow_symlinks=False):
            files += [] if entry.name in without else sources(entry.path)
        elif entry.name.endswith(".py"):
            files.append(entry.path)
    return sorted(files)


class _Name:
    """A hash under construction, and the modules on which it depends."""

    def __init__(self) -> None:
        wide, promotion = True, os.environ.get("JAX_NUMPY_DTYPE_PROMOTION", "standard").lower()
        if is_loaded():
            wide, promotion = (jax.config.values[f"jax_{name}"] for name in ("enable_x64", "numpy_dtype_promotion"))
        self.digest = hashlib.sha256(repr((wide, getattr(promotion, "value", promotion))).encode())
        self.modules: set[str] = set()

    def word(self, *words: Any) -> None:
        """Plain values, of which none runs into the next."""
        self.digest.update(repr(words).encode() + b"\0")

    def tree(self, value: Any) -> None:
        if isinstance(value, Module):
            self.module(value, self.tree)
        elif _collection(value):
            self.collection(value, self.tree)
        elif value is None:
            self.word("none")
        elif isinstance(value, bool | int | float):
            self.word("leaf", (), str(np.result_type(type(value))))  # as that of an array without axes
        elif hasattr(value, "shape") and hasattr(value, "dtype"):
            self.word("leaf", tuple(value.shape), str(value.dtype))
        else:
            raise UnnamedError

    def static(self, value: Any) -> None:
        if isinstance(value, PLAIN):
            self.word(type(value).__name__, value)
        elif isinstance(value, Module):
            self.module(value, self.static)
        elif _collection(value):
            self.collection(value, self.static)
        elif isinstance(value, functools.partial):
            self.word("partial")
            self.static((value.func, value.args, value.keywords))
        elif isinstance(value, enum.Enum):
            self.place(type(value))
            self.word(value.name)
        elif (isinstance(value, np.ndarray | np.generic) or is_jax_array(value)) and not is_traced(value):
            array = np.asarray(value)
            if array.dtype.kind not in "biufc":
                raise UnnamedError
            self.word("array", array.shape, array.dtype.str)
            self.digest.update(np.ascontiguousarray(array).data)  # shape and type say where it ends
        elif is_loaded() and isinstance(value, jax.tree_util.PyTreeDef):
            self.word("structure")
            self.tree(jax.tree.unflatten(value, [0] * value.num_leaves))
        elif isinstance(value, np.dtype):
            self.word("dtype", str(value))
        elif isinstance(value, type) or (callable(value) and hasattr(value, "__qualname__")):
            self.place(value)
        else:
            raise UnnamedError

    def module(self, value: Any, inner: Callable[[Any], None]) -> None:
        self.place(type(value))
        known = vars(value)
        for field in dataclasses.fields(value):
            self.word(field.name)
            if field.name not in known:
                raise UnnamedError
            (self.static if field.metadata.get("static", False) else inner)(known[field.name])

    def collection(self, value: Any, inner: Callable[[Any], None]) -> None:
        if isinstance(value, dict):
            items = sorted(value.items())  # as JAX takes them
            self.static(tuple(k for k, _ in items))
            parts: Iterable[Any] = [v for _, v in items]
        else:
            parts = value
            if type(value) not in (tuple, list):
                self.place(type(value))
        self.word(type(value).__name__, len(value))
        for part in parts:
            inner(part)

    def place(self, value: Any) -> None:
        home, name = getattr(value, "__module__", None) or "builtins", value.__qualname__
        value_there: Any = sys.modules.get(home)
        for part in name.split("."):
            value_there = getattr(value_there, part, None)
        if value_there is not value and getattr(value_there, "__wrapped__", None) is not value:
            raise UnnamedError
        self.word(home, name)
        for one in value.__mro__ if isinstance(value, type) else ():
            self.home(one.__module__)
        self.home(home)

    def home(self, name: str) -> None:
        if self.known(name):
            self.modules.add(name)

    @staticmethod
    def known(name: str) -> bool:
        """Whether the sources of a module are watched; what is neither watched nor a library is refused."""
        root = name.partition(".")[0]
        if root.startswith(FILE_MODULE):
            return True
        if root not in WATCHED and root not in LIBRARIES and root not in sys.stdlib_module_names:
            raise UnnamedError
        return root in WATCHED

    def file(self, module: types.ModuleType) -> None:
        """A file of the user's own: its name tells its source, so that what else it may depend on is left."""
        for name, value in sorted(vars(module).items()):
            if name.startswith("__"):
                continue
            if isinstance(value, types.ModuleType):
                self.watched(value.__name__)
            elif isinstance(value, (*PLAIN, tuple, np.ndarray)) or is_jax_array(value):
                self.word(name)
                self.static(value)
            elif isinstance(home := getattr(value, "__module__", None), str):
                self.watched(home)
                self.word(name, home, getattr(value, "__qualname__", ""))
            else:
                raise UnnamedError

    def watched(self, name: str) -> None:
        """A module that a file of the user's own imports: this package's, a library's, or that file itself."""
        if name.startswith(FILE_MODULE) and name not in self.modules:
            raise UnnamedError
        self.known(name)

    def constants(self) -> None:
        joined = {name.partition(".")[0] for name in self.modules} & WATCHED - {OWN}
        self.digest.update(source_digest(_top_layer(self.modules), tuple(sorted(joined))))
        todo, visited = sorted(self.modules), set(self.modules)
        while todo:
            module = sys.modules[todo.pop()]
            if module.__name__.startswith(FILE_MODULE):
                self.file(module)
                continue
            for name, value in sorted(vars(module).items()):
                if name.startswith("__"):
                    continue
                if isinstance(value, float | int | str) or (type(value) is tuple and _plain(value)):
                    self.word(module.__name__, name, value.replace(INSTALLED, "") if isinstance(value, str) else value)
                    continue
                home = value.__name__ if isinstance(value, types.ModuleType) else getattr(value, "__module__", None)
                if callable(value) and isinstance(home, str) and home != "typing" and hasattr(value, "__qualname__"):
                    # another function may have been put into its place; versions of a library move what it has within it
                    place = home if self.known(home) else home.partition(".")[0]
                    self.word(name, place, value.__qualname__)
                if not isinstance(home, str) or home in visited or home.partition(".")[0] not in WATCHED:
                    continue
                if isinstance(value, LazyModule):  # it counts, whether it was used already or not
                    importlib.import_module(home)
                if home in sys.modules and not hasattr(sys.modules[home], "__path__"):
                    visited.add(home)
                    todo.append(home)


def _top_layer(modules: Iterable[str]) -> int:
    if any(not name.startswith(f"{OWN}.") for name in modules):  # a file or a package that may import every layer
        return 0
    packages = {name.split(".")[1] for name in modules}
    return next((k for k, layer in enumerate(UPPER) if not packages.isdisjoint(layer)), len(UPPER))


def _plain(value: tuple[Tree, ...]) -> bool:
    return all(isinstance(v, PLAIN) or (type(v) is tuple and _plain(v)) for v in value)


def _collection(value: Any) -> bool:
    return type(value) in (dict, list, tuple) or (isinstance(value, tuple) and hasattr(value, "_fields"))


def lower_or_load(function: Callable[..., Tree], *examples: Tree, title: str = "") -> tuple[Program, Tree]:
    """Find a function's program and the structure of its results on disk, or lower it; see `lanewise.lower`."""
    name = program_key(function, examples)
    if (known := load_program(name)) is not None:
        return known[0], jax.tree.structure(known[1])
    program, tree = lanewise.lower(function, *examples, title=title)
    if name is None:
        return program, tree
    try:
        said = json.loads(json.dumps(_said(jax.tree.unflatten(tree, [0.0] * tree.num_leaves))))
    except TypeError:  # results whose structure cannot be written
        return program, tree
    if jax.tree.structure(_built(said)) == tree:
        about = {"arguments": list(map(list, program.arguments)), "results": list(map(list, program.results))}
        cache.store(f"{name}.program", program.serialised, {**about, "title": program.title, "tree": said})
    return program, tree


def find_program(function: Callable[..., Tree], *examples: Tree) -> tuple[Program, Tree] | None:
    """The program of a function that was lowered before and a tree like its results, without JAX; None if none is kept."""
    return load_program(program_key(function, examples))


def load_program(key: str | None) -> tuple[Program, Tree] | None:
    """The program of a key and a tree like its results, without JAX; None if none is kept, or there is no key."""
    if key is None or (kept := cache.load(f"{key}.program") or cache.read(LOWERED / f"{key[:DIGITS]}.program")) is None:
        return None
    data, about = kept
    try:
        arguments, wanted = ([Leaf(n, k, tuple(s)) for n, k, s in about[part]] for part in ("arguments", "results"))
        tree = _built(about["tree"])
        if len(flatten(tree)[0]) != len(wanted):
            return None
        return Program.from_parts(data, arguments, wanted, about["title"]), tree
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError):
        return None


def _said(value: Any) -> Any:
    """Convert a tree to text and lists; raises TypeError if that is impossible."""
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
    """Find a type whose sources are watched by its import path; nothing is imported, and only types are found.

    Raises:
        KeyError: there is no such place, or it is of another package.
        TypeError: no type stands there, or none of that kind.
    """
    home, _, name = place.partition(":")
    if home.partition(".")[0] not in WATCHED:
        raise KeyError(place)
    member: Any = sys.modules[home]
    for part in name.split("."):
        member = vars(member)[part]
    if not (isinstance(member, type) and issubclass(member, base)):
        raise TypeError(place)
    if (member.__module__, member.__qualname__) != (home, name):
        raise TypeError(place)
    return member


NUMBERS = (float, int, np.ndarray, np.generic)
# Lanes up to which one core is enough, and beyond which a call goes by blocks on all of them.
SINGLE_CORE = 20_000
KINDS: dict[str | None, Any] = {"real": np.float64, "int": np.int64, "bool": np.bool_, None: np.float64}
MOST_KNOWN = 256  # formulas with the structures of their owners that are remembered
Method = TypeVar("Method", bound=Callable[..., Any])
_known: dict[Any, Any] = {}
_taken: dict[int, tuple[Callable[[], Any], list[float] | None, Any]] = {}  # modules taken apart, by identity
_own = threading.local()  # of each thread: by program, the places in which a call with plain numbers has them


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
        leaves, structure = _numbers_of(self)
        if leaves is None or not all(map(np.size, arguments)):
            return method(self, *arguments)
        try:
            return _call(_kernel(method, self, structure, len(arguments)), leaves, arguments)
        except (LoweringError, UnavailableError):  # an operation that no kernel can do, or no LLVM
            return jax.jit(method)(self, *arguments)

    return call  # type: ignore[return-value]


def _numbers_of(owner: Any) -> tuple[list[float] | None, Any]:
    """The numbers of a module and its structure, kept while it lives; no numbers where a kernel cannot take them."""
    known = _taken.get(id(owner))
    if known is not None and known[0]() is owner:
        return known[1:]
    leaves, structure = flatten(owner)
    try:
        hash(structure)  # of a static field without one no kernel can be remembered
        numbers = [float(leaf) for leaf in leaves] if all(map(_is_number, leaves)) else None
        reference = weakref.ref(owner)
    except TypeError:
        return None, structure
    while len(_taken) >= MOST_KNOWN:
        _taken.pop(next(iter(_taken)), None)
    _taken[id(owner)] = reference, numbers, structure
    return numbers, structure


def _is_number(leaf: Any) -> bool:
    return (isinstance(leaf, NUMBERS) or is_jax_array(leaf)) and not np.shape(leaf) and not is_traced(leaf)


def _kernel(method: Callable[..., Tree], owner: Any, structure: Any, count: int) -> tuple[Program, Tree]:
    key = (method, structure)
    known = _known.get(key)
    if known is None:
        while len(_known) >= MOST_KNOWN:
            _known.pop(next(iter(_known)), None)
        examples = (owner, *[0.0] * count)
        known = find_program(method, *examples)
        if known is None:
            try:
                program, tree = lower_or_load(method, *examples, title=method.__qualname__)
                known = program, jax.tree.unflatten(tree, [0.0] * tree.num_leaves)
            except LoweringError as error:
                known = error
        _known[key] = known
    if isinstance(known, LoweringError):
        raise known
    return known


Places = tuple[list[np.ndarray], list[np.ndarray], Callable[[], None]]


def _bound(program: Program) -> Places:
    """Where a program of this thread has its arguments and its results, one number each, and its call."""
    known: dict[Program, Places] = _own.__dict__.setdefault("bound", {})
    if program not in known:
        while len(known) >= MOST_KNOWN:
            known.pop(next(iter(known)))
        places, found = (
            [np.zeros((), KINDS[leaf.kind]) for leaf in side] for side in (program.arguments, program.results)
        )
        known[program] = places, found, program.bind(places, found, mode="strict")
    return known[program]


def _call(run: tuple[Program, Tree], leaves: list[Any], arguments: tuple[Tree, ...]) -> Any:
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
        places, found, run_bound = _bound(program)
        for place, value in zip(places, (*leaves, *values), strict=True):
            place[()] = value
        run_bound()
        results = [place[()] for place in found]
    if isinstance(example, tuple):
        return type(example)(*results) if hasattr(example, "_fields") else tuple(results)
    return results[0]
