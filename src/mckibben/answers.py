"""What must be said with an answer, kept in the answer itself, so that every face says the same.

An answer is an immutable value with `cautions`, `balances` and `sources`. Where a question returns plain numbers, as
`Muscle.tension` does, its cautions go out as Python warnings by `warn`.
"""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from .errors import PlausibilityWarning


@dataclass(frozen=True)
class Caution:
    """What must be known before an answer is used.

    Attributes:
        text: a sentence without capital and full stop.
        parameter: name of the parameter that it is about, beside which a face shows it; empty: of the whole answer.

    Examples:
        >>> str(Caution("a pressure of 3 Pa inflates no muscle; was 3 bar meant?", "pressure"))
        'a pressure of 3 Pa inflates no muscle; was 3 bar meant?'
    """

    text: str
    parameter: str = ""

    def __str__(self) -> str:
        return self.text


class Answer:
    """Base of answers: frozen data classes that carry what must be said with them.

    Attributes:
        cautions: in the order in which they are shown, each once.
        balances: by name, the share that a balance leaves open [1]; empty where nothing was balanced.
        sources: references and files that the numbers rest on.
    """

    cautions: tuple[Caution, ...] = ()
    balances: Mapping[str, float] = {}
    sources: tuple[str, ...] = ()


def collect(*cautions: Caution | None) -> tuple[Caution, ...]:
    """The cautions that there are, each once, in their order."""
    return tuple(dict.fromkeys(one for one in cautions if one is not None))


def warn(cautions: Iterable[Caution], *, stacklevel: int = 2) -> None:
    """Say cautions as `PlausibilityWarning`, for questions whose answer is a plain number."""
    for caution in cautions:
        warnings.warn(caution.text, PlausibilityWarning, stacklevel=stacklevel + 1)


FEW = 3  # entries that are shown one by one
SHOWN = 80  # characters of a value within `brief`


def brief(value: object) -> str:
    """The representation of a data class or named tuple in one line, however much it holds: `__repr__ = brief`.

    Examples:
        >>> from mckibben.batch import grid
        >>> grid({"rest_length": [0.1 + 0.001 * i for i in range(100)]})
        Variants(columns={'rest_length': array (100,)})
    """
    names = getattr(value, "_fields", None) or [f.name for f in dataclasses.fields(value) if f.repr]  # type: ignore[arg-type]
    return f"{type(value).__name__}({', '.join(f'{name}={_shown(getattr(value, name))}' for name in names)})"


def _shown(value: object) -> str:
    if isinstance(shape := getattr(value, "shape", None), tuple) and shape:
        return f"array {shape}"
    if isinstance(value, Mapping) and len(value) <= FEW:
        text = f"{{{', '.join(f'{key!r}: {_shown(one)}' for key, one in value.items())}}}"
    elif isinstance(value, list | tuple | Mapping | set) and len(value) > FEW and not hasattr(value, "_fields"):
        return f"{len(value):,} entries"
    else:
        text = repr(value)
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}.."
