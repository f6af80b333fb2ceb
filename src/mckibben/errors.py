"""All errors that the package raises on purpose.

All of them carry one clear sentence for a person. `InputError` means that the caller's input is wrong (the command line
exits with 2); the others name a state that could not be reached.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

LONGEST = 300  # characters of a text that is shown

# Values that describe the state of an input and that nobody typed, which a sentence shows without quotation marks.
STATES = frozenset(
    "missing; not given; none; empty; alone; constant; damaged; nobody; unused; unreadable; not finite; not TOML; "
    "not known; not recorded; not installed; not relaxing; too long; too much; nested too deeply; no column; no unit; "
    "no samples; no channel; no numbers; no messages; no header; no variable; no pressure; no tension; no length; no width; "
    "no element; no turning point; no common time; no moving volume; another tree; another shape; asked for; by direction; "
    "beside cycles; commanded; does not rise; none at the machine; none at the device; none that can be read; shut off; "
    "not finite or no row; set and varied; varied twice; too few samples; without a head; without a step; dates; idle; "
    "without a protocol; without stiffness; without enough variety; without a step that lasts".split("; ")
)
_NUMERIC = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?( [^\s\d]\S*)?")  # a number, with its unit
_RANGE = re.compile(r"(?:from )?([-+]?[\d.].*?) to ([-+]?[\d.].*)")
_WORDS = re.compile(r"[\w-]+(?:, [\w-]+)+")
_HINT = re.compile(r"did you mean (\S+)\? ?", re.IGNORECASE)
_CONDITION = re.compile(r"(after|with|without|while|beside|for|on|in|here) ")


def compose_sentence(field: str, value: object, allowed: str) -> str:
    """Compose the sentence that refuses a value.

    Args:
        field: dotted path or option that the value was given for.
        value: the value, or one of `STATES`.
        allowed: what the field must be, beginning with "must be" or "allowed is"; the known names, beginning with
            "known are"; or a clause that says what is wrong. It may begin with what `suggest` returns.

    Returns:
        Such as ``pressure must be between 0 bar and 6.9 bar, got 9 bar`` or ``Unknown kind 'volum'. Did you mean 'volume'?``
    """
    hint = ""
    match = _HINT.match(allowed)
    if match:
        hint, allowed = f"Did you mean {match[1]!r}? ", allowed[match.end() :]
    value = value if isinstance(value, str | int | float) else str(value)
    shown, name = _short(_shown(value)), _short(field)
    if allowed in ("no such file", "no such folder"):
        kind = allowed.removeprefix("no such ")
        owner = "" if name in ("file", "folder") or not name.isalpha() else f"{name} "
        path = str(value)
        return _capital(f"{owner}{kind} not found: {_short(path if path == path.strip() else repr(path))}")
    if value == "unknown":
        return f"Unknown field {name!r}. {hint}{_capital(allowed)}".rstrip()
    if value in STATES and allowed.startswith("known are "):
        return f"{name} is {value}. {_capital(allowed)}"
    if hint or allowed.startswith("known are "):
        return f"Unknown {name} {_short(repr(value))}. {hint}{_capital(allowed)}".rstrip()
    required = re.match(r"(?:allowed (?:is|are)|must be) ", allowed)
    if allowed.startswith("must ") and not required:
        demand, tail = _parted(allowed)
        return f"{name} is {value}: it {allowed}" if value in STATES else f"{name} {demand}, got {shown}{tail}"
    if allowed == "it is required":
        return f"{name} is {value}" if value in STATES else f"{name} is missing"
    if not required:
        condition = allowed.removeprefix("allowed ")
        if condition != allowed:
            return f"{name} is allowed only {condition.removesuffix(' only')}"
        clause = re.sub(r"\ballowed (is|are) ", "it must be ", re.sub(r"^needed (is|are) ", "it needs ", allowed))
        return f"{name} is {shown}: {clause}"
    demand, tail = _parted(allowed[required.end() :])
    if _CONDITION.match(demand):
        return f"{name} is allowed only {demand}{tail}"
    between = _RANGE.fullmatch(demand)
    if between:
        demand = f"between {between[1]} and {between[2]}"
    elif _WORDS.fullmatch(demand):
        demand = f"{', '.join(demand.split(', ')[:-1])} or {demand.split(', ')[-1]}"
    if value in STATES:
        return f"{name} is {value}: it must be {demand}{tail}"
    return f"{name} must be {demand}, got {shown}{tail}"


def suggest(word: object, known: Iterable[object]) -> str:
    """The beginning of a clause that suggests the known word next to an unknown one, for `compose_sentence`.

    Args:
        word: the unknown word.
        known: the known words.

    Returns:
        ``did you mean volume? ``, or nothing if no known word is close.
    """
    import difflib

    close = difflib.get_close_matches(str(word), [str(one) for one in known], n=1)
    return f"did you mean {close[0]}? " if close else ""


def _parted(text: str) -> tuple[str, str]:
    """A demand, and the explanation that follows it after a semicolon or a colon outside of parentheses."""
    match = re.match(r"(?:[^;:(]|[;:](?! )|\([^)]*\)?)*(?=[;:] )", text)
    return (text[: match.end()], text[match.end() :]) if match else (text, "")


def _capital(text: str) -> str:
    """A clause as a sentence; a name of the code that it begins with stays as it is."""
    return text[:1].upper() + text[1:] if text.partition(" ")[0].isalpha() else text


def _short(text: str) -> str:
    """Shorten a text of a user or a file."""
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 20]}..{text[-18:]}"


def _shown(value: object) -> str:
    if isinstance(value, str):
        return value if value in STATES or _NUMERIC.fullmatch(value) else repr(value)
    if isinstance(value, float):
        return f"{value:.6g}"
    return str(value)


class MckibbenError(Exception):
    """Base of every error that this package raises on purpose; can be pickled."""

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (type(self), self.args), self.__dict__


def _restored(kind: type[MckibbenError], args: tuple[Any, ...]) -> MckibbenError:
    return kind.__new__(kind, *args)


class InputError(MckibbenError, ValueError):
    """A value given by the user is not allowed.

    The message names where the value comes from, the field, the value and what is allowed: `compose_sentence` makes it of
    these, unless a `sentence` that says the same is given. `remedy` is what the caller could state to put it right, such as
    ``column pressure``, for an edge that has words of its own for it.
    """

    def __init__(
        self,
        field: str,
        value: object,
        allowed: str,
        *,
        where: str | None = None,
        sentence: str | None = None,
        remedy: str = "",
    ) -> None:
        self.field, self.value, self.allowed, self.where = field, value, allowed, where
        self.sentence, self.remedy = sentence, remedy
        place = f"{where}: " if where else ""
        super().__init__(place + (sentence or compose_sentence(field, value, allowed)))

    def at(self, where: str) -> InputError:
        """Return the error with its source, such as a file, the outermost first."""
        place = f"{where}: {self.where}" if self.where else where
        return self.changed(where=place)

    def changed(self, **parts: Any) -> InputError:
        """Return the error with some of its parts replaced."""
        names = ("field", "value", "allowed", "where", "sentence", "remedy")
        kept = {name: getattr(self, name) for name in names} | parts
        return InputError(kept.pop("field"), kept.pop("value"), kept.pop("allowed"), **kept)


class MissingLibraryError(InputError):
    """A library of an extra is not installed; the message states which, and how to install it."""

    def __init__(self, purpose: str, library: str, extra: str, *, instead: str = "", where: str | None = None) -> None:
        self.purpose, self.library, self.extra, self.instead = purpose, library, extra, instead
        super().__init__(library, "not installed", f"pip install 'mckibben[{extra}]'", where=where)
        sentence = f"{purpose} {library}, which is not installed: {self.allowed}"
        self.args = (f"{where}: " * bool(where) + sentence + (f"; {instead}" if instead else ""),)

    def at(self, where: str) -> MissingLibraryError:
        """Return the error with its source, the outermost first."""
        place = f"{where}: {self.where}" if self.where else where
        return MissingLibraryError(self.purpose, self.library, self.extra, instead=self.instead, where=place)


class MissingParametersError(InputError):
    """A law lacks parameters that it cannot do without; `missing` has their names and declarations."""

    def __init__(self, law: str, missing: list[tuple[str, Any]], allowed: str, **more: Any) -> None:
        super().__init__(f"{law}.{missing[0][0]}", "missing", allowed, **more)
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


class EngineError(MckibbenError):
    """The requested engine cannot run a function: an operation without a kernel, no driver, or no GPU."""


class PlausibilityWarning(UserWarning):
    """A value that no muscle takes and that is most likely a slip of the unit; the sentence names the likely one."""


class MissingDataError(MckibbenError):
    """Requested measured data do not ship with the package and were not found."""
