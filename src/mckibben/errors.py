"""Every error raised on purpose.

All of them carry one clear line for a person. `InputError` means that the caller's input is wrong (the command line
exits with 2); the others name a state that the laboratory could not bring about.
"""

from __future__ import annotations

from typing import Any

LONGEST = 300  # signs of what is shown of a text


class MckibbenError(Exception):
    """Base of every error that this package raises on purpose; goes whole from one process to another."""

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, (type(self), self.args), self.__dict__


def _again(kind: type[MckibbenError], args: tuple[Any, ...]) -> MckibbenError:
    return kind.__new__(kind, *args)


class InputError(MckibbenError, ValueError):
    """A value given by the user is not allowed.

    The message names where the value comes from, the field, the value and what is allowed; it is composed of these, or is a
    whole `sentence` that says the same. `remedy` is what the caller could state to put it right, such as ``column
    pressure``, for an edge that has words of its own for it.
    """

    def __init__(
        self, field: str, value: object, allowed: str, *,
        where: str | None = None, sentence: str | None = None, remedy: str = "",
    ) -> None:  # fmt: skip
        self.field, self.value, self.allowed, self.where = field, value, allowed, where
        self.sentence, self.remedy = sentence, remedy
        place = f"{where}: " if where else ""
        super().__init__(place + (sentence or f"{_short(field)} is {_short(_shown(value))}; {allowed}"))

    def at(self, where: str) -> InputError:
        """The same complaint with the place it comes from, the outermost first."""
        place = f"{where}: {self.where}" if self.where else where
        return self.changed(where=place)

    def changed(self, **parts: Any) -> InputError:
        """The same complaint with some of its parts replaced."""
        names = ("field", "value", "allowed", "where", "sentence", "remedy")
        kept = {name: getattr(self, name) for name in names} | parts
        return InputError(kept.pop("field"), kept.pop("value"), kept.pop("allowed"), **kept)


class MissingLibraryError(InputError):
    """What was asked for needs a library that comes with an extra and is not installed; says which, and how to get it."""

    def __init__(self, purpose: str, library: str, extra: str, *, instead: str = "", where: str | None = None) -> None:
        self.purpose, self.library, self.extra, self.instead = purpose, library, extra, instead
        super().__init__(library, "not installed", f"pip install 'mckibben[{extra}]'", where=where)
        sentence = f"{purpose} {library}, which is not installed: {self.allowed}"
        self.args = (f"{where}: " * bool(where) + sentence + (f"; {instead}" if instead else ""),)

    def at(self, where: str) -> MissingLibraryError:
        """The same complaint with the place it comes from, the outermost first."""
        place = f"{where}: {self.where}" if self.where else where
        return MissingLibraryError(self.purpose, self.library, self.extra, instead=self.instead, where=place)


class MissingParametersError(InputError):
    """A law lacks parameters that it cannot do without; `missing` has their names and declarations."""

    def __init__(self, law: str, missing: list[tuple[str, Any]], allowed: str, **more: Any) -> None:
        super().__init__(f"{law}.{missing[0][0]}", "missing", allowed, **more)
        self.law, self.missing = law, missing


class UnreachableError(MckibbenError):
    """No state satisfies the wish, for example a tension that no allowed pressure gives."""


class NoVolumeError(MckibbenError):
    """The law says how the volume changes, but not how large it is."""


class ConvergenceError(MckibbenError):
    """A fit or a solver ended without reaching its tolerance."""


class LineLostError(MckibbenError):
    """A real machine does not answer any more, or not as it should; says which line, what happened and what was done."""


class EmptyRunError(MckibbenError):
    """A run ended before its first step that is recorded; says why it ended."""


class LoweringError(MckibbenError):
    """An operation cannot become part of a native kernel; names it, and where it is written."""

    def __init__(self, what: str, why: str, found: str | None = None, *, where: str | None = None) -> None:
        self.what, self.why, self.where = what, why, where
        place = f" ({where})" if where else ""
        more = f"; {found}" if found else ""
        super().__init__(f"{what}{place} cannot become a native kernel: {why}{more}")


class MissingDataError(MckibbenError):
    """Measured data that do not ship with the package were asked for and are not there."""


class CacheWarning(UserWarning):
    """A folder of kept machine code is not used, since other users own it or can write to it."""

    def __init__(self, folder: object, variable: str) -> None:
        super().__init__(
            f"The cache folder {folder} is not used, because other users own it or can write to it and the machine code in "
            f"it is run; take that permission away (chmod go-w), or name another folder with {variable}"
        )


def _short(text: str) -> str:
    """A text that a person gave or that stands in a file, cut where it would fill the screen."""
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 20]}..{text[-18:]}"


def _shown(value: object) -> str:
    if isinstance(value, str):
        return repr(value)
    if isinstance(value, float):
        return f"{value:.6g}"
    return str(value)
