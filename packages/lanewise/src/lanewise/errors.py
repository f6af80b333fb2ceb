"""Errors that this package raises on purpose; each has a message of one sentence."""

from __future__ import annotations

LONGEST = 300  # characters of a sentence


class LanewiseError(Exception):
    """Base of every error that this package raises on purpose."""

    def __reduce__(self) -> tuple[object, ...]:
        return _rebuild, (type(self), self.args), self.__dict__


def _rebuild(kind: type[LanewiseError], args: tuple[object, ...]) -> LanewiseError:
    return kind.__new__(kind, *args)


class ArgumentError(LanewiseError, ValueError):
    """An argument is not allowed, or a file is not what it should be.

    Attributes:
        argument: the wrong argument, such as ``lanes``, or the name of an array.
        sentence: description of the error.
        source: the program or file that it belongs to, if there is one.
    """

    def __init__(self, argument: str, sentence: str, *, source: str | None = None) -> None:
        self.argument, self.sentence, self.source = argument, shorten(sentence), source
        super().__init__(f"{source}: {self.sentence}" if source else self.sentence)


class LoweringError(LanewiseError):
    """An operation cannot become part of a kernel; names the operation, and where it is written."""

    def __init__(self, operation: str, reason: str, detail: str | None = None, *, source: str | None = None) -> None:
        self.operation, self.reason, self.source = operation, reason, source
        place = f" ({source})" if source else ""
        more = f"; {detail}" if detail else ""
        super().__init__(f"{operation}{place} cannot become a native kernel: {reason}{more}")


class UnavailableError(LanewiseError):
    """A requested resource is missing: LLVM, a driver, or a GPU that is new enough."""


class DriverError(LanewiseError):
    """A GPU's driver refused a call; the message contains the driver's own text."""


class CacheWarning(UserWarning):
    """A cache folder is not used, since other users own it or can write to it."""

    def __init__(self, folder: object, variable: str) -> None:
        super().__init__(
            f"The cache folder {folder} is not used, because other users own it or can write to it and the machine code in "
            f"it is run; take that permission away (chmod go-w), or name another folder with {variable}"
        )


def shorten(text: str) -> str:
    """Shorten a long text in its middle."""
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 20]}..{text[-18:]}"
