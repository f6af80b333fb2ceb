"""What the labels of columns in files of others say: quantity, unit, absolute or gauge, and which column is the time."""

from __future__ import annotations

import functools
import re
import unicodedata
from collections.abc import Sequence
from typing import NamedTuple

from ..errors import InputError
from .table import si_of
from .text import split_header

# Names under which quantities are known, without accents; of a force map the first that a header holds is taken. English,
# German, French, Spanish, Italian, Portuguese and the letters of papers.
COLUMNS = {
    "length": ("length", "braid_length", "test_length", "muscle_length", "l", "muscle.length", "lange", "laenge",
               "muskellange", "longueur", "longitud", "lunghezza", "comprimento"),
    "contraction": ("contraction", "contraction_ratio", "strain", "eps", "kappa", "epsilon", "kontraktion",
                    "contraccion", "contrazione", "contracao", "shortening", "verkurzung", "raccourcissement"),
    "pressure": ("pressure", "p", "gauge_pressure", "muscle.pressure", "muscle_pressure", "druck", "uberdruck",
                 "pression", "presion", "pressione", "pressao"),
    "tension": ("tension", "force", "f", "pull", "muscle.tension", "muscle_force", "kraft", "zugkraft", "fuerza",
                "forza", "forca", "load", "weight", "mass", "last", "gewicht", "masse", "peso", "massa"),
    "rest_length": ("rest_length", "resting_length", "l0", "initial_length", "ruhelange", "ruhelaenge"),
    "branch": ("branch", "direction", "richtung"),
    "run": ("run", "run_id", "trial", "test_id", "versuch", "lauf", "essai", "ensayo", "prova", "ensaio"),
    "diameter": ("diameter", "inner_diameter", "rest_diameter", "bore", "durchmesser", "diametre", "diametro"),
}  # fmt: skip
TIMES = tuple(
    "time t timestamp time_stamp elapsed_time zeit zeitstempel temps tiempo tempo tout times timestamps time_stamps".split()
)
# Names that end so are times too, where no column is called one of `TIMES`: "Total Time", "Prüfzeit", "epoch_ms".
_TIMELIKE = re.compile(r"(?:.*[_ ])?(?:time|epoch|datetime|uhrzeit|timestamp)|.*zeit")
DAYS = ("date", "datum", "day", "fecha")  # of a date beside a time of day
# Names that say nothing: what such a column holds follows from its unit, if no other column has one of that kind.
_NAMELESS = re.compile(r"(?:(?:ch|chan|channel|kanal|sensor|signal|ai|col|column|value|y|x|f|p|l)[_ ]?\d*)")
_KINDS = {"length": "m", "pressure": "Pa", "tension": "N"}
# Units that a header may hold after an underscore; in brackets any unit is read.
_UNDERSCORED = frozenset(
    "Pa kPa MPa hPa bar mbar psi bara barg psia psig s ms us m mm cm inch N kN mN lbf kgf V mV A mA K degC kg g rad deg Hz"
    " percent % fraction cN daN gf kp MN ozf l/min kg/s".split()
)
_BRACKETS = re.compile(r"(?P<name>.*?\S)\s*[\[(](?P<unit>[^\[\]()]+(?:\([^()]*\))?)[\])]\s*")
ABSOLUTE, GAUGE = ("abs", "absolute", "a"), ("gauge", "rel", "g")
_PRESSURE_WORD = re.compile(
    r"([kMh]?Pa|m?bar|psi|atm|at|Torr|mmHg|inH2O|cmH2O|N/m\^2|N/mm\^2|kgf/cm\^2|kp/cm\^2)\b", re.I
)
_SUFFIXED = ("bara", "barg", "mbara", "mbarg", "psia", "psig")


class ColumnSource(NamedTuple):
    """Source of a channel: column number from 0, name for messages, unit, and absolute or gauge if stated."""

    at: int
    label: str
    unit: str | None = None
    reference: str | None = None


def split_reference(unit: str) -> tuple[str, str | None]:
    """A unit of pressure and what it refers to: ``psia`` and ``psi abs`` -> psi, absolute; ``bar(g)`` -> bar, gauge."""
    word, *more = re.sub(r"[()]", " ", unit).split() or [unit]
    if not more and word.lower() in _SUFFIXED:
        word, more = word[:-1], [word[-1]]
    said = {one.lower() for one in more}
    if not said or not said <= {*ABSOLUTE, *GAUGE}:
        return unit, None
    return word, "absolute" if said & {*ABSOLUTE} else "gauge"


def parse_header(at: int, cell: str) -> tuple[str, ColumnSource]:
    """Read a header as channel name and column: ``Tank.Pressure_abs [kPa]`` -> tank.pressure_abs, kPa, absolute."""
    label = cell or f"column {at + 1}"
    bracket = _BRACKETS.fullmatch(cell)
    unit: str | None
    if bracket and bracket["unit"].strip():
        stem, tail = split_header(bracket["name"], ())
        unit = bracket["unit"].strip()
        head, *words = re.sub(r"[()]", " ", unit).split() or [unit]
        if {word.lower() for word in words} <= {*ABSOLUTE, *GAUGE}:  # [bar abs], [bar(g)], but not [Pa s]
            unit = head
        else:
            words = []
        said = [word.lower() for word in (*tail, *words)]
    else:
        stem, tail = split_header(cell, _UNDERSCORED)
        inch, _, last = cell.strip().rpartition("_")
        if last == "in" and quantity_of(inch) in ("length", "rest_length", "diameter"):
            return inch.lower(), ColumnSource(at, label, "inch")
        words = [word for word in tail if word in _UNDERSCORED]
        if len(words) > 1 and words != [words[0], "g"]:
            # Is velocity_m_s in m/s, torque_N_m in N/m? Only brackets can say.
            return "_".join([stem, *tail]).lower(), ColumnSource(at, label)
        unit = words[0] if words else None
        said = [word.lower() for word in tail if word != unit]
    if unit is not None and unit.lower() in _SUFFIXED:
        unit, suffix = unit[:-1], unit[-1].lower()
        said.append("abs" if suffix == "a" else "gauge")
    if unit is not None and not _PRESSURE_WORD.match(unit):
        # The gauge of "strain_gauge [V]" and the like belongs to the name.
        return "_".join([stem, *said]), ColumnSource(at, label, unit)
    if any(word in ABSOLUTE for word in said):
        return stem + "_abs", ColumnSource(at, label, unit, "absolute")
    return stem, ColumnSource(at, label, unit, "gauge" if said else None)


@functools.lru_cache(maxsize=1024)
def quantity_of(stem: str) -> str | None:
    """The quantity that a name stands for, a key of `COLUMNS` or ``time``; None where it is none of these."""
    plain = plain_stem(stem)
    if plain in TIMES:
        return "time"
    return next((quantity for quantity, names in COLUMNS.items() if plain in names), None)


def plain_stem(stem: str) -> str:
    """A name without accents and reference, in lower case: ``Druck_abs`` -> druck."""
    letters = unicodedata.normalize("NFKD", stem.casefold())
    word = "".join(letter for letter in letters if not unicodedata.combining(letter))
    return re.sub(r"[\s_]+", "_", word).removesuffix("_abs").removesuffix("_in")


def recognise_columns(labels: Sequence[str]) -> dict[str, list[str]]:
    """The columns of a force map by what they hold: by their names, and nameless ones by a unit that no other column has.

    Returns:
        Quantity -> labels; more than one where it is not clear which.
    """
    parsed = {label: parse_header(0, label) for label in labels}
    stems = {label: plain_stem(stem) for label, (stem, _) in parsed.items()}
    recognised: dict[str, list[str]] = {}
    for quantity, names in COLUMNS.items():
        matches = ([label for label in labels if stems[label] == name] for name in names)
        if match := next((m for m in matches if m), None):
            recognised[quantity] = match
    free = [label for label in labels if quantity_of(stems[label]) is None]
    for quantity, unit in _KINDS.items():
        alike = [label for label in free if (word := parsed[label][1].unit) and converts(word, unit)]
        missing = quantity not in recognised and not (quantity == "length" and "contraction" in recognised)
        if missing and len(alike) == 1 and _NAMELESS.fullmatch(stems[alike[0]]):
            recognised[quantity] = alike
    return recognised


def likely_columns(labels: Sequence[str]) -> dict[str, str]:
    """Columns of a force map that their units suggest, by quantity; none where several have a unit of the kind."""
    likely = {}
    for quantity, unit in _KINDS.items():
        alike = [label for label in labels if (word := parse_header(0, label)[1].unit) and converts(word, unit)]
        if len(alike) == 1:
            likely[quantity] = alike[0].partition(" [")[0]
    return likely


def time_column(labels: tuple[str, ...] | list[str]) -> int | None:
    """Place of the column that is the time by its name: one of `TIMES`, else the first that ends so, as "Total Time (s)"."""
    parsed = [parse_header(at, label) for at, label in enumerate(labels)]
    stems = [plain_stem(stem.rpartition(".")[2]) for stem, _ in parsed]
    named = [at for at, stem in enumerate(stems) if stem == "time"] or [
        at for at, stem in enumerate(stems) if stem in TIMES
    ]
    if named:
        return named[0] if len(named) == 1 else None
    return next(
        (
            at for at, (stem, (_, source)) in enumerate(zip(stems, parsed, strict=True))
            if _TIMELIKE.fullmatch(stem) and (source.unit is None or converts(source.unit, "s"))
        ),
        None,
    )  # fmt: skip


@functools.lru_cache(maxsize=1024)
def converts(word: str, unit: str) -> bool:
    """Whether a unit as text is one of an SI unit's kind."""
    try:
        return si_of(word, field="unit")[0] == unit
    except InputError:
        return False
