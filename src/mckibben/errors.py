"""All errors that the package raises on purpose.

All of them carry one clear sentence for a person. `InputError` means that the caller's input is wrong (the command line
exits with 2); the others name a state that could not be reached.
"""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Iterable
from typing import Any, TypeVar

LONGEST = 300  # characters of a text that is shown
T = TypeVar("T")
_NUMERIC = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?( [^\s\d]\S*)?")  # a number, with its unit


def compose_sentence(field: str, value: object, problem: str = "", known: Iterable[object] | None = None) -> str:
    """Compose the sentence that refuses a value.

    Args:
        field: dotted path or option that the value was given for.
        value: the value; None where `problem` says all of it.
        problem: what the field must be, beginning with "must"; the value follows it, before a semicolon. Any other
            clause follows the value, or the field where the value is None. With `known`, the words that begin their list.
        known: names that the field may have; the one that is closest to the value is suggested.

    Returns:
        Such as ``pressure must be between 0 bar and 6.9 bar, got 9 bar``, ``muscle.law is missing`` or
        ``Unknown kind 'volum'. Did you mean 'volume'? Known are junction, volume``.
    """
    name = shortened(field)
    if known is not None:
        names = [str(one) for one in known]
        intro = _capital(problem or "known are")
        word = field.rpartition(".")[2] if value is None else str(value)
        unknown = f"field {name!r}" if value is None else f"{name} {shortened(repr(str(value)))}"
        return f"Unknown {unknown}. {suggestion(word, names)}{intro} {', '.join(names) or 'none'}"
    if value is None:
        return f"{name} {problem}"
    shown = shortened(_shown(value))
    if problem.startswith("must "):
        demand, semicolon, rest = problem.partition("; ")
        return f"{name} {demand}, got {shown}{semicolon}{rest}"
    return f"{name} is {shown}: {problem}"


def choice(words: Iterable[object]) -> str:
    """Write words as a choice in a sentence: ``rk4, ros2 or auto``."""
    *most, last = [str(word) for word in words]
    return f"{', '.join(most)} or {last}" if most else last


def suggestion(word: str, known: list[str]) -> str:
    """The question after the known word that is closest to an unknown one, or nothing where none is close."""
    import difflib

    close = difflib.get_close_matches(word, known, n=1)
    return f"Did you mean {close[0]!r}? " if close else ""


def _capital(text: str) -> str:
    """A clause as a sentence; a name of the code that it begins with stays as it is."""
    return text[:1].upper() + text[1:] if text.partition(" ")[0].isalpha() else text


def shortened(text: str) -> str:
    """Shorten a text of a user or a file."""
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 20]}..{text[-18:]}"


def _shown(value: object) -> str:
    if isinstance(value, str):
        return value if _NUMERIC.fullmatch(value) else repr(value)
    if isinstance(value, float):
        return f"{value:.6g}"
    return str(value)


class MckibbenError(Exception):
    """Base of every error that this package raises on purpose; can be pickled.

    Examples:
        >>> import mckibben as mk
        >>> try:
        ...     mk.specimen("nylonn")
        ... except mk.MckibbenError as error:
        ...     print(error)
        Unknown specimen 'nylonn'. Did you mean 'nylon'? Give a .toml file or one of bridgestone, ...
    """

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (type(self), self.args), self.__dict__


def _restored(kind: type[MckibbenError], args: tuple[Any, ...]) -> MckibbenError:
    return kind.__new__(kind, *args)


# Arguments of Python that put right what a file does not say, by the first word of a remedy.
ARGUMENTS = {
    "column": "columns={{'{}': ..}}",
    "unit": "units={{'{}': ..}}",
    "scale": "scales={{'{}': ..}}",
    "decimal": "decimal='.' or decimal=','",
    "header": "header='name [unit], ..'",
    "rest_length": "rest_length='300 mm'",
    "sheet": "sheet='..'",
}


class InputError(MckibbenError, ValueError):
    """A value given by the user is not allowed.

    The message names where the value comes from, the field, the value and what is allowed: `compose_sentence` makes it of
    these, unless a whole `sentence` is given. `remedy` is what the caller could state to put it right, such as
    ``column pressure``: the message ends with the argument of Python, and an edge that has words of its own for it makes
    the error anew without.

    Examples:
        >>> import mckibben as mk
        >>> try:
        ...     mk.law("ideal", {"thread_length": -0.2, "turns": 3.2})
        ... except mk.InputError as error:
        ...     print(error)
        ideal.thread_length must be between 0.1 cm and 1e+04 cm, got -20 cm
    """

    def __init__(
        self,
        field: str,
        value: object = None,
        problem: str = "",
        *,
        known: Iterable[object] | None = None,
        where: str | None = None,
        sentence: str | None = None,
        remedy: str = "",
    ) -> None:
        self.field, self.value, self.problem, self.where = field, value, problem, where
        self.known = None if known is None else tuple(known)
        self.sentence, self.remedy = sentence, remedy
        shown = where if where is None or where.isprintable() else repr(where)  # a name may have several lines
        place = f"{shown}: " if shown else ""
        kind, _, name = remedy.partition(" ")
        hint = f", with {ARGUMENTS[kind].format(name)}" if kind in ARGUMENTS else ""
        super().__init__(place + (sentence or compose_sentence(field, value, problem, self.known)) + hint)

    def at(self, where: str) -> InputError:
        """Return the error with its source, such as a file, the outermost first."""
        return self.changed(where=f"{where}: {self.where}" if self.where else where)

    def changed(
        self,
        *,
        field: str | None = None,
        value: object = None,
        problem: str | None = None,
        where: str | None = None,
        sentence: str | None = None,
        remedy: str | None = None,
    ) -> InputError:
        """Return the error with some of its parts replaced; an empty `where` leaves the source out."""
        return InputError(
            self.field if field is None else field,
            self.value if value is None else value,
            self.problem if problem is None else problem,
            known=self.known,
            where=self.where if where is None else where,
            sentence=self.sentence if sentence is None else sentence,
            remedy=self.remedy if remedy is None else remedy,
        )


def each_once(field: str, values: Iterable[T], *, where: str | None = None) -> list[T]:
    """Return values as a list, or refuse what stands there twice: it would have one name in an answer, or twice the weight.

    Raises:
        InputError: names the value; spellings of one path are one.
    """
    listed = list(values)
    known: set[tuple[str, object]] = set()
    for one in listed:
        path = str(one) if isinstance(one, str | os.PathLike) else ""
        number = isinstance(one, int | float)
        key = ("path", os.path.normpath(path)) if path else ("number", one) if number else ("object", id(one))
        if key in known:
            name = getattr(one, "name", None) or getattr(one, "__name__", None) or str(one)
            raise InputError(field, name, "must be stated once; it is there twice", where=where)
        known.add(key)
    return listed


def refuse_unknown(names: Iterable[str], known: Collection[str], said: str = "", *, where: str | None = None) -> None:
    """Raise an `InputError` at the first of the names of arguments that is not known; `said` begins the list of those."""
    for name in names:
        if name not in known:
            raise InputError(name, None, said, known=known, where=where)


def not_found(path: object, kind: str = "file", *, where: str | None = None) -> InputError:
    """Return the error about a file or folder that does not exist, such as ``File not found: x.csv``."""
    text = str(path)
    shown = shortened(text if text == text.strip() and text.isprintable() else repr(text))
    return InputError(kind.removesuffix(" file"), text, sentence=f"{_capital(kind)} not found: {shown}", where=where)


class MissingLibraryError(InputError):
    """A library of an extra is not installed; the message states which, and how to install it."""

    def __init__(self, purpose: str, library: str, extra: str, *, instead: str = "", where: str | None = None) -> None:
        self.purpose, self.library, self.extra, self.instead = purpose, library, extra, instead
        problem = f"pip install 'mckibben[{extra}]'"
        if library.startswith("mckibben-"):
            own = "" if extra == library.removeprefix("mckibben-") else f"[{extra}]"
            problem += f", or in a copy of the repository pip install './packages/{library}{own}'"
        sentence = f"{purpose} {library}, which is not installed: {problem}" + (f"; {instead}" if instead else "")
        super().__init__(library, None, problem, where=where, sentence=sentence)

    def at(self, where: str) -> MissingLibraryError:
        """Return the error with its source, the outermost first."""
        place = f"{where}: {self.where}" if self.where else where
        return MissingLibraryError(self.purpose, self.library, self.extra, instead=self.instead, where=place)


class MissingParametersError(InputError):
    """A law lacks parameters that it cannot do without; `missing` has their names and declarations."""

    def __init__(self, law: str, missing: list[tuple[str, Any]], problem: str, *, where: str | None = None) -> None:
        super().__init__(f"{law}.{missing[0][0]}", None, f"is missing: {problem}", where=where)
        self.law, self.missing = law, missing


class UnreachableError(MckibbenError):
    """No state satisfies the request, for example a tension that no allowed pressure gives."""


class NoVolumeError(MckibbenError):
    """The law determines changes of volume, but not the volume itself."""


class ConvergenceError(MckibbenError):
    """A fit or a solver ended without reaching its tolerance."""


class LineLostError(MckibbenError):
    """A real machine no longer answers, or answers wrongly; the message states connection, event and action."""


class EmptyRunError(MckibbenError):
    """A run ended before its first recorded step; the message states why."""


class StageError(MckibbenError):
    """A stage of a characterisation could not be finished, or its outcome refuses what follows.

    Args:
        stage: name of the stage.
        problem: what happened, as the rest of a sentence.
    """

    def __init__(self, stage: str, problem: str) -> None:
        """Compose the sentence."""
        super().__init__(f"stage {stage}: {problem}")
        self.stage, self.problem = stage, problem


class EngineError(MckibbenError):
    """The requested engine cannot run a function: an operation without a kernel, no driver, or no GPU."""


class PlausibilityWarning(UserWarning):
    """A value that no muscle takes and that is most likely a slip of the unit; the sentence names the likely one."""


class MissingDataError(MckibbenError):
    """Requested measured data do not ship with the package and were not found."""
