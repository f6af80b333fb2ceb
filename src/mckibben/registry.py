"""Registries of kinds by name: those of this package, and those that installed packages add by entry points.

A package that has a tension law, a valve, a step of a protocol, a sensor or an import format of its own names it in its
``pyproject.toml``::

    [project.entry-points."mckibben.laws"]
    my_law = "my_package.laws:MyLaw"

A class in a file of one's own needs no package: its name is ``my.py:MyLaw``, on the command line, in Python and in files.
A name in a file runs nothing by itself. It resolves once a person has named the Python file, in an option such as ``--law``
or ``--code``, in Python by `allow_code` or as an argument, or in the environment variable ``MCKIBBEN_CODE``.

The groups are ``mckibben.laws``, ``mckibben.frictions``, ``mckibben.valves``, ``mckibben.steps``, ``mckibben.sensors``,
``mckibben.models`` and ``mckibben.formats``. Distributions of this repository that are installed by themselves (`PACKAGES`)
announce commands by ``mckibben.commands``, names of ``import mckibben`` by ``mckibben.names``, pages of the web interface by
``mckibben.pages``, backends of real test machines by ``mckibben.hardware``, and what papers print of a muscle by
``mckibben.printed``.
"""

from __future__ import annotations

import functools
import hashlib
import importlib
import importlib.util
import os
import re
import sys
import types
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Generic, TypeVar

from .errors import InputError, MissingLibraryError, not_found, shortened, suggestion

T = TypeVar("T")
# Distributions of this repository that are installed by themselves, by the extra that brings each of them.
PACKAGES = {
    "benchmark": "mckibben-benchmark",
    "hardware": "mckibben-hardware",
    "hosts": "mckibben-hosts",
    "papers": "mckibben-papers",
}
# Packages whose sources are watched, so that what is lowered from their functions is kept: see `components.programs`.
WATCHED = {__name__.partition(".")[0]}


@functools.cache
def plugins(group: str) -> dict[str, Any]:
    """Load what installed packages add to a group, by name.

    Raises:
        InputError: an entry point names what cannot be imported.
    """
    return {name: loaded(point) for name, point in entry_points(group).items()}


def entry_points(group: str) -> dict[str, Any]:
    """What installed packages add to a group, by name, before it is loaded by `loaded`."""
    return {point.name: point for point in _entry_points() if point.group == group}


def loaded(point: Any) -> Any:
    """Load what an entry point names.

    Raises:
        InputError: it names what cannot be imported.
    """
    try:
        return point.load()
    except (ImportError, AttributeError) as error:
        demand = f"the entry point {point.value} of {point.group} cannot be loaded: {error}"
        raise InputError(point.name, point.value, demand, sentence=f"{point.name}: {demand}") from None


def announced(group: str, name: str, package: str, purpose: str, *, extra: str | None = None) -> Any:
    """Load what one of `PACKAGES` announces; no other distribution is searched, and nothing else is loaded.

    Args:
        group: of the entry point, such as ``mckibben.commands``.
        name: of the entry point.
        package: that announces it, one of `PACKAGES`.
        purpose: what needs it, with the verb, such as ``"mckibben export needs"``.
        extra: that brings it with a library; that of the package alone by default.

    Raises:
        MissingLibraryError: the package is not installed.
        InputError: its version announces nothing of that name, or what cannot be imported.
    """
    distribution, point = _announcement(group, name, package)
    if distribution is None:
        raise MissingLibraryError(purpose, PACKAGES[package], extra or package)
    if point is not None:
        return loaded(point)
    problem = f"another version of {PACKAGES[package]} than {distribution.version}: pip install 'mckibben[{package}]'"
    raise InputError(name, None, problem, sentence=f"{purpose} {problem}")


def announced_folder(group: str, name: str, package: str) -> Path | None:
    """Folder of a package that one of `PACKAGES` announces, without loading it; None where it is not installed."""
    _, point = _announcement(group, name, package)
    spec = importlib.util.find_spec(point.module) if point is not None else None
    return None if spec is None or spec.origin is None else Path(spec.origin).parent


def _announcement(group: str, name: str, package: str) -> tuple[Any, Any]:
    """The distribution of one of `PACKAGES` and its entry point of that name, each None where it is not there."""
    from importlib import metadata

    try:
        distribution = metadata.distribution(PACKAGES[package])
    except metadata.PackageNotFoundError:
        return None, None
    points = (point for point in distribution.entry_points if (point.group, point.name) == (group, name))
    return distribution, next(points, None)


def join(package: str) -> None:
    """Have the sources of an imported package watched, so that kernels of its functions are kept as those of this one."""
    WATCHED.add(package)


@functools.cache
def _entry_points() -> tuple[Any, ...]:
    """Entry points of the package's groups; searching all installed packages takes some milliseconds."""
    from importlib.metadata import distributions

    every = (point for package in distributions() for point in package.entry_points)
    return tuple(point for point in every if point.group.startswith("mckibben."))


# A class or value of a Python file, such as ``my.py:MyLaw``, and what the modules of such files are named after.
_REFERENCE = re.compile(r"(?P<path>.+\.py):(?P<name>[A-Za-z_]\w*)")
FILE_MODULE = "mckibben_file_"
LONGEST_FILE = 1 << 20  # [B]; a longer one is no source
CODE = "MCKIBBEN_CODE"  # environment: Python files that may run, parted as in PATH; processes that are begun inherit it
FIXED = "MCKIBBEN_CODE_FIXED"  # environment: where set, what is named from now on allows nothing, as on a server
_MOST_PLACES = 1000
# Where files have stated references: file and field, for the sentence that refuses them.
_places: dict[str, tuple[str, str]] = {}


def is_reference(name: object) -> bool:
    """Whether a name stands for something in a Python file, such as ``my.py:MyLaw``."""
    return isinstance(name, str) and _REFERENCE.fullmatch(name) is not None


def with_own_references(document: object, where: str | os.PathLike[str], field: str = "") -> Any:
    """The tables of a file with every reference such as ``my.py:MyLaw``, key or value, found from the folder of the file.

    Args:
        document: the tables.
        where: the file that they come from.
        field: dotted path of the tables in it.
    """
    if isinstance(document, Mapping):
        below = {key: with_own_references(v, where, f"{field}.{key}".lstrip(".")) for key, v in document.items()}
        return {_placed(key, where, field): value for key, value in below.items()}
    if isinstance(document, list):
        return [with_own_references(value, where, field) for value in document]
    return _placed(document, where, field) if isinstance(document, str) else document


def _placed(name: str, where: str | os.PathLike[str], field: str) -> str:
    """A name that a file states; the path in a reference such as ``my.py:MyLaw`` begins at the folder of that file."""
    found = str(Path(where).parent / name) if is_reference(name) else name
    if found is not name and len(_places) < _MOST_PLACES:
        _places[found] = os.fspath(where), field
    return found


def allow_code(path: str | os.PathLike[str]) -> None:
    """Let names such as ``my.py:MyLaw`` in files stand for what a Python file holds, in this process and those it begins.

    Loading what a file names runs the Python file: allow those that you would run as a program.

    Raises:
        InputError: there is no such file, it is no Python file, or this process is a server, which takes no further ones.
    """
    if os.environ.get(FIXED):
        raise InputError("code", str(path), "must be named when the server is started: mckibben serve --code FILE.py")
    if Path(path).suffix != ".py":
        raise InputError("code", str(path), "must be a Python file, such as my.py")
    if not Path(path).is_file():
        raise not_found(path)
    if not _is_allowed(Path(path)):
        os.environ[CODE] = os.pathsep.join(filter(None, (os.environ.get(CODE), str(Path(path).resolve()))))


def named_by_person(*names: object) -> None:
    """Allow the files of references that a person has named, as an option or an argument; other things pass."""
    for name in names:
        match = _REFERENCE.fullmatch(name) if isinstance(name, str) else None
        if match is not None and Path(match["path"]).is_file() and not os.environ.get(FIXED):
            allow_code(match["path"])


def fix_code() -> None:
    """Allow no further Python files, as a server does, whose names come from elsewhere; processes that it begins neither."""
    os.environ[FIXED] = "1"


def _is_allowed(path: Path) -> bool:
    return path.resolve() in (Path(one).resolve() for one in os.environ.get(CODE, "").split(os.pathsep) if one)


def registered_name(kind: object) -> str | None:
    """The name under which a class was loaded from a file or a package, or added; None for classes of this package."""
    name: str | None = vars(kind).get("registered_name") if isinstance(kind, type) else None
    return name


def _absolute(name: str) -> str:
    """A reference with the whole path of its file, so that it means the same in every folder; other names as they are."""
    match = _REFERENCE.fullmatch(name)
    return name if match is None else f"{Path(match['path']).resolve()}:{match['name']}"


def load_reference(reference: str, *, field: str, where: str | None = None) -> Any:
    """Load what a reference such as ``my.py:MyLaw`` names; a file that has changed is loaded again.

    Args:
        reference: path of a Python file and a name in it.
        field: what a complaint calls it.
        where: file for a complaint.

    Raises:
        InputError: nobody has allowed the file, there is no such file or name, or the file raises when it is run.
    """
    match = _REFERENCE.fullmatch(reference)
    if match is None:
        raise InputError(field, reference, "must be a file and a name in it, such as my.py:MyLaw", where=where)
    path, name = Path(match["path"]), match["name"]
    if not path.is_file():
        raise InputError(field, reference, "no such file", where=where, sentence=f"File not found: {path}")
    if not _is_allowed(path):
        stated, stated_field = _places.get(reference, (where, field))
        demand = f"names code, which a file cannot run by itself; if you trust {path}, allow it: --code {path}"
        said = f"{field if where else stated_field} {shortened(repr(reference))} {demand}"
        said = f"{said}, or mckibben.registry.allow_code in Python"
        raise InputError(field, reference, demand, where=where or stated, sentence=said)
    module = _module_of(path, field, reference, where)
    if not hasattr(module, name):
        own = [n for n, value in vars(module).items() if getattr(value, "__module__", None) == module.__name__]
        said = f"{path} has no {name!r}. {suggestion(name, own)}It has {', '.join(own) or 'nothing of its own'}"
        raise InputError(field, reference, "must be a name in the file", where=where, sentence=said)
    return _named(reference, getattr(module, name))


def _named(name: str, kind: T) -> T:
    """A kind that remembers the name under which it was loaded, where it is a class."""
    if isinstance(kind, type) and registered_name(kind) is None:
        kind.registered_name = name  # type: ignore[attr-defined]
    return kind


def _module_of(path: Path, field: str, reference: str, where: str | None) -> types.ModuleType:
    """The module of a file, named after its path and content, so that another content is another module."""
    source = path.read_bytes()
    if len(source) > LONGEST_FILE:
        raise InputError(field, reference, f"must be a Python file below {LONGEST_FILE >> 20} MB", where=where)
    digest = hashlib.sha256(str(path.resolve()).encode() + b"\0" + source).hexdigest()[:24]
    title = f"{FILE_MODULE}{digest}"
    if title in sys.modules:
        return sys.modules[title]
    module = types.ModuleType(title)
    module.__file__ = str(path.resolve())
    sys.modules[title] = module  # where the types of the file are looked for while they are made
    folder = str(path.resolve().parent)
    sys.path.insert(0, folder)
    try:
        exec(compile(source, str(path), "exec"), module.__dict__)  # noqa: S102 - running the user's file is the purpose
    except Exception as error:
        del sys.modules[title]
        line = error.lineno if isinstance(error, SyntaxError) else None
        trace = error.__traceback__
        while trace is not None:  # the innermost line of the file itself
            if trace.tb_frame.f_code.co_filename == str(path):
                line = trace.tb_lineno
            trace = trace.tb_next
        kind = "" if isinstance(error, InputError) else f"{type(error).__name__}: "
        said = f"{path}{f', line {line}' if line else ''}: {kind}{error}"
        raise InputError(field, reference, "must be a file that runs", where=where, sentence=said) from None
    finally:
        sys.path.remove(folder)
    return module


class Registry(Mapping[str, T], Generic[T]):
    """Kinds by name, those of this package first; a name such as ``my.py:MyLaw`` is a kind of the user's own file.

    Args:
        group: group of the entry points.
        noun: what a kind is called in an error message, such as ``law``.
        known: kinds of this package; a text ``module:name`` is imported on demand.
        accept: what of a file is such a kind: returns what it must be, such as ``a class derived from mckibben.TensionLaw``,
            or None where it is one. Without it no files are loaded.
    """

    def __init__(
        self, group: str, noun: str, known: Mapping[str, T | str], *, accept: Callable[[Any], str | None] | None = None
    ) -> None:
        self.group, self.noun, self.accept = group, noun, accept
        self._known: dict[str, Any] = dict(known)

    def __getitem__(self, name: str) -> T:
        if _absolute(name) not in self._known:
            return self._of_file(name) if self._is_file(name) else _named(name, plugins(self.group)[name])
        name = _absolute(name)
        entry = self._known[name]
        if isinstance(entry, str):
            module, _, attribute = entry.partition(":")
            entry = self._known[name] = getattr(importlib.import_module(module), attribute)
        result: T = entry
        return result

    def _is_file(self, name: object) -> bool:
        return self.accept is not None and is_reference(name)

    def _of_file(self, name: str, field: str = "", where: str | None = None) -> T:
        kind: T = load_reference(name, field=field or self.noun, where=where)
        assert self.accept is not None
        demand = self.accept(kind)
        if demand is not None:
            said = f"{name} must be {demand}"
            raise InputError(field or self.noun, name, f"must be {demand}", where=where, sentence=said)
        return kind

    def register(self, kind: T) -> str:
        """Name a kind that is given as itself, such as a class of a notebook; raises `InputError` where it is none."""
        for name, entry in self._known.items():
            if entry is kind:
                return name
        place = (
            f"{getattr(kind, '__module__', '')}:{getattr(kind, '__qualname__', '')}"  # of one that nobody has asked for
        )
        known = registered_name(kind) or next((name for name, entry in self._known.items() if entry == place), None)
        if known is not None:
            # a file named from another folder: its short name is another file here, or none
            file = getattr(sys.modules.get(getattr(kind, "__module__", "")), "__file__", None)
            whole = f"{file}:{known.rpartition(':')[2]}"
            return whole if is_reference(known) and whole != _absolute(known) else known
        demand = "a kind of its own" if self.accept is None else self.accept(kind)
        title = getattr(kind, "__name__", type(kind).__name__)
        if demand is not None:
            raise InputError(self.noun, title, f"must be {demand}", sentence=f"{title} must be {demand}")
        name, count = title, 1
        while name in self._known:  # an earlier class of that name, as of a cell that was run again
            count += 1
            name = f"{title}_{count}"
        self.add(name, kind)
        return name

    def stated_as(self, kind: T, stated: Iterable[str]) -> str:
        """The name of a kind that is given as itself, where a file states one by a reference, that: ``my.py:MyLaw``."""
        name, title = self.register(kind), getattr(kind, "__name__", "")
        references = [one for one in stated if is_reference(one) and one.rpartition(":")[2] == title]
        if name in stated or len(references) != 1:
            return name
        self.put(references[0], kind)
        return references[0]

    def __contains__(self, name: object) -> bool:
        return name in self._known or self._is_file(name) or name in plugins(self.group)

    def __iter__(self) -> Iterator[str]:
        return iter((*self._known, *(name for name in plugins(self.group) if name not in self._known)))

    def __len__(self) -> int:
        return len(list(iter(self)))

    def add(self, name: str, kind: T) -> None:
        """Add a kind for this process, as a script or a test does; a package names it as an entry point instead.

        Raises:
            InputError: there is one of that name.
        """
        if name in self._known:
            raise InputError(self.noun, name, f"another {self.noun} has that name")
        self._known[name] = _named(name, kind)

    def put(self, name: str, kind: T) -> None:
        """Name a kind that a file declares, such as a sensor of a rig, in place of any other of that name."""
        self._known[_absolute(name)] = kind

    def own(self) -> tuple[T, ...]:
        """Kinds of this package and registered ones, without a search for installed packages."""
        return tuple(self[name] for name in self._known)

    def find(self, name: str, *, field: str = "", where: str | None = None) -> T:
        """The kind of a name.

        Args:
            name: name of the kind.
            field: dotted path for an error message; the noun where it is left out.
            where: file for an error message.

        Raises:
            InputError: there is none of that name.
        """
        if self._is_file(name) and _absolute(name) not in self._known:
            return self._of_file(name, field, where)
        if name.endswith(".py"):
            said = f"{name} must be followed by the name of a {self.noun} in it, as in {name}:Name"
            raise InputError(field or self.noun, name, "must name what is meant in it", where=where, sentence=said)
        if name not in self:
            raise InputError(field or self.noun, name, known=self, where=where)
        return self[name]
