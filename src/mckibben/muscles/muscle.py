"""A muscle as one object: its law, friction, creep and published data, with the questions that a user asks of a muscle.

Lengths, pressures and forces go in as SI numbers, as arrays, or as text with a unit, and come out as SI: a number for
numbers and texts, a NumPy array for arrays, a JAX array or tracer for what JAX hands in.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .._jax import is_jax_array, is_traced, jnp
from ..accessors import Accessor, implementation
from ..answers import Caution, collect, warn
from ..components import Hysteresis, MemoryElement, Module, Scalar, field
from ..documents import JsonValue
from ..errors import InputError
from ..quantities import declared, in_si, with_unit
from ..specimens import Specimen, SpecimenNumber, save_specimen
from .evidence import LawError, error_of, law_cautions, tension_range
from .law import LawState, TensionLaw, law_name
from .plausible import free_length_caution, length_caution, measured_length_caution, pressure_caution, stretch_caution

if TYPE_CHECKING:
    from ..accessors import MusclePlots

Quantity = ArrayLike | str  # an SI number, an array of them, or text with a unit


class ParameterRow(NamedTuple):
    """One parameter of a muscle: path, symbol, value [unit], SI unit, meaning, and the source that prints it."""

    name: str
    symbol: str
    value: float | list[float]
    unit: str
    meaning: str
    source: str


class Muscle(Module):
    """A muscle: a tension law, with friction, creep and the specimen that states them where there are any; immutable.

    Args:
        law: tension over length and gauge pressure; of a biological muscle over length and activation [1].
        friction: friction of the braid with memory.
        creep: viscoelastic elements beside the braid.
        specimen: where the numbers come from.
        stated: names of the parameters of the law that a person has given, in place of the specimen's or the defaults.

    Examples:
        >>> import mckibben as mk
        >>> muscle = mk.muscle("nylon")
        >>> round(muscle.tension("12 cm", "5 bar"), 1)
        32.1
        >>> round(mk.Muscle(mk.law("ideal", {"thread_length": 0.16, "turns": 3.2})).free_length(5e5), 4)
        0.0924
    """

    law: TensionLaw
    friction: Hysteresis | None = None
    creep: MemoryElement | None = None
    specimen: Specimen | None = field(static=True, default=None)
    stated: tuple[str, ...] = field(static=True, default=())

    plot: ClassVar[Accessor[MusclePlots]] = Accessor("MusclePlots")
    """Plots: ``plot.force_map``, ``plot.free_length``, ``plot.volume`` and ``plot.braid``, see `report.figures.plots`."""

    def __eq__(self, other: object) -> bool:
        # who stated a number is told with it, and makes no other muscle
        theirs = other.with_fields(stated=()) if isinstance(other, Muscle) else other
        return Module.__eq__(self.with_fields(stated=()), theirs)

    __hash__ = Module.__hash__

    # ---- questions

    def tension(self, length: Quantity, pressure: Quantity) -> Scalar:
        """Tension on the anchors [N], never negative; without friction.

        Args:
            length: distance between the anchors [m].
            pressure: gauge pressure [Pa]; of a biological muscle the activation [1].
        """
        tension: Scalar = self._ask("tension", self._length(length), self._drive(pressure))
        return tension

    def volume(self, length: Quantity, pressure: Quantity) -> Scalar:
        """Gas volume [m^3] at a length [m] and gauge pressure [Pa].

        Raises:
            NoVolumeError: if the law knows only how the volume changes.
        """
        volume: Scalar = self._ask("volume", self._length(length), self._drive(pressure))
        return volume

    def stiffness(self, length: Quantity, pressure: Quantity) -> Scalar:
        """dF/dL [N/m] at a length [m] and constant gauge pressure [Pa], zero when slack."""
        stiffness: Scalar = self._ask("stiffness", self._length(length), self._drive(pressure))
        return stiffness

    def free_length(self, pressure: Quantity) -> Scalar:
        """Length at which the unloaded muscle settles [m] at a gauge pressure [Pa]."""
        drive = self._drive(pressure)
        length: Scalar = self._ask("free_length", drive)
        if _largest(drive) is not None and not self.is_biological:
            warn(collect(free_length_caution(self.law, np.ravel(drive), self.specimen)), stacklevel=3)
        return length

    def state(self, length: Quantity, pressure: Quantity) -> LawState:
        """Everything that the law says at a length [m] and gauge pressure [Pa] at once."""
        state: LawState = self._ask("state", self._length(length), self._drive(pressure))
        return state

    def pressure_for(self, tension: Quantity, length: Quantity, *, highest: Quantity = 10e5) -> float:
        """The lowest gauge pressure [Pa] that gives a tension; of a biological muscle the activation [1].

        Args:
            tension: wanted tension [N].
            length: distance between the anchors [m].
            highest: gauge pressure up to which it is sought [Pa].

        Raises:
            UnreachableError: if no pressure in that range gives the tension.
        """
        force, span = _scalar(in_si(tension, "N", field="tension"), "tension"), _scalar(self._length(length), "length")
        if self.is_biological:
            fibre: Any = self.law
            return float(fibre.activation_for(force, span))
        return self.law.pressure_for(force, span, highest=float(in_si(highest, "Pa", field="highest")))

    def quasi_static_tension(self, span: Quantity, pressure: Quantity, direction: Scalar) -> Scalar:
        """Tension while the muscle is moved slowly one way [N], the law with constant friction.

        Args:
            span: distance between the anchors [m].
            pressure: gauge pressure [Pa].
            direction: +1 while lengthening, -1 while shortening, 0 for the hypothetical static tension.

        Returns:
            max(F + direction Fc(P'), 0): the paper's suggestion where a simple friction is enough (eqs. 12, 13).
        """
        length, gauge = in_si(span, "m", field="span"), in_si(pressure, "Pa", field="pressure")
        if not is_traced(direction) and not np.all(np.isin(_quantity(direction, "1", "direction"), (-1, 0, 1))):
            raise InputError(
                "direction", None, f"must be 1 while lengthening, -1 while shortening, or 0, got {direction!r}"
            )
        force = self.law.braid_tension(length, gauge)
        if self.friction is not None:
            force = force + direction * self.friction.largest_force(gauge)
        return jnp.maximum(force, 0.0)

    def length_at(self, contraction: Quantity) -> Scalar:
        """Length [m] at a contraction from the rest length, L = L0 (1 - contraction).

        Args:
            contraction: share of the rest length [1], a number, an array, or text such as ``"20 %"``; negative if stretched.

        Raises:
            InputError: the muscle states no rest length, or the contraction is not between -100 % and 100 %.
        """
        rest = self.rest_length
        if rest is None:
            said = f"needs a rest length, which {self.title} does not state; give a length"
            raise InputError("contraction", None, said)
        share = in_si(contraction, "1", field="contraction")
        if not is_traced(share) and not np.all(np.abs(np.asarray(share, float)) < 1.0):
            raise InputError("contraction", str(contraction), "must be between -100 % and 100 %")
        return rest * (1.0 - share)

    def tension_range(self, length: Quantity, pressure: Quantity) -> tuple[Scalar, Scalar]:
        """Lowest and highest tension [N] that the ranges of the specimen's numbers leave at a length [m] and pressure [Pa].

        Raises:
            InputError: the specimen states no ranges from which one could be computed; see `muscles.evidence.tension_range`.
        """
        at, gauge = np.asarray(in_si(length, "m", field="length")), np.asarray(in_si(pressure, "Pa", field="pressure"))
        found = tension_range(self.specimen, self.law_name, self.law, at, gauge)
        if found is None:
            said = f"must state ranges of numbers that were not measured; {self.title} does not"
            raise InputError("specimen", None, said)
        low, high = (end if end.ndim else end.item() for end in found)
        return low, high

    def calibrate(self, *readings: Any, same_rig: bool = False) -> Muscle:
        """Return the muscle with its law moved to one to three readings of it, and with the interval that they leave.

        All parameters move together, as far as muscles of the make differ in them; correcting one number by hand, such as
        the length, makes other lengths worse. Take the readings at rest and 4 % shortened, at 5 to 6 bar; of a muscle from
        another laboratory take the second at the most contracted length that is used.

        Args:
            *readings: each a length, a gauge pressure and a tension: ``"126.75 mm, 5.5 bar, 140 N"``.
            same_rig: it is mounted on the rig on which the muscles of the make were measured.

        Raises:
            InputError: a reading is refused, or the specimen does not state how far muscles of its make differ.

        Examples:
            >>> import mckibben as mk
            >>> import warnings
            >>> warnings.simplefilter("ignore")
            >>> mk.muscle("festo-10mm", rest_length="132 mm").calibrate("132 mm, 5.5 bar, 330 N")
            Muscle('festo-10mm-calibrated', seated_braid, 13.2 cm at rest)
        """
        made: Muscle = implementation("calibrate")(self, list(readings), same_rig=same_rig)
        return made

    # ---- what it is

    @property
    def error(self) -> LawError | None:
        """How far the law is from what was measured of this muscle, as its specimen states it; None where it does not."""
        return error_of(self.specimen, self.law_name)

    @functools.cached_property
    def cautions(self) -> tuple[Caution, ...]:
        """What must be known of every answer of this muscle, such as a large error; said as warnings with each."""
        return law_cautions(self.specimen, self.law_name)

    @property
    def law_name(self) -> str:
        """Name under which the law is addressed."""
        return "biological" if self.is_biological else law_name(self.law)

    @property
    def is_biological(self) -> bool:
        """Whether the muscle is driven by an activation instead of a pressure."""
        return not isinstance(self.law, TensionLaw)

    @property
    def title(self) -> str:
        """Title of the specimen, else of the law."""
        return self.specimen.title if self.specimen is not None else self.law.title

    @property
    def rest_length(self) -> float | None:
        """Rest length L0 [m] of the law, else as the specimen states it; None where neither has one."""
        own = getattr(self.law, "rest_length", None)
        if own is not None:
            return float(own)
        stated = {} if self.specimen is None else self.specimen.properties
        return self.specimen.property_si("rest_length", "m") if self.specimen and "rest_length" in stated else None

    @functools.cached_property
    def longest_length(self) -> float | None:
        """Longest length [m] that the law is made for; None while JAX traces the law's parameters."""
        longest = self.law.length_range()[1]
        return None if is_traced(longest) else float(longest)

    def parameters(self) -> list[ParameterRow]:
        """All parameters of law, friction and creep, each with its unit, meaning and source."""
        stated = {} if self.specimen is None else self.specimen.laws.get(self.law_name, {})
        rows = _rows("law", self.law, stated)
        for name in ("friction", "creep"):
            rows += _rows(name, getattr(self, name), {})
        return rows

    def to_dict(self) -> dict[str, JsonValue]:
        """Id, law and parameters [SI] as plain values, for JSON."""
        return {
            "specimen": None if self.specimen is None else self.specimen.id,
            "law": self.law_name,
            "parameters": {row.name: row.value for row in self.parameters()},
        }

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the specimen to a ``.toml`` file that every command takes; returns its path.

        Raises:
            InputError: the muscle was made without a specimen.
        """
        if self.specimen is None:
            raise InputError("specimen", None, "is missing: only a muscle of a specimen, a braid or a fit can be saved")
        save_specimen(self.specimen, path)
        return Path(path)

    def __repr__(self) -> str:
        name = repr(self.specimen.id) if self.specimen is not None else "own"
        parts = [self.law_name, *(type(p).__name__ for p in (self.friction, self.creep) if p is not None)]
        size = "" if self.rest_length is None else f", {with_unit(self.rest_length, 'm')} at rest"
        return f"Muscle({name}, {' + '.join(parts)}{size})"

    def _repr_html_(self) -> str:
        return str(implementation("muscle_html")(self))

    def length_cautions(self, lengths: ArrayLike, *, text: str | None = None) -> tuple[Caution, ...]:
        """Cautions about lengths between the anchors [m]: the longest far from its law, and those beyond the measured ones.

        Args:
            lengths: [m].
            text: as the one that is longest was typed.
        """
        known, longest = np.asarray(lengths, float).ravel(), self.longest_length
        known = known[~np.isnan(known)]
        if not known.size or longest is None:
            return ()
        least, most = float(known.min()), float(known.max())
        largest = max(least, most, key=abs)
        far = length_caution(largest, longest, text=text) or stretch_caution(most, longest)
        others = [one for one in (least, most) if far is None or (one <= longest and one != largest)]
        return collect(far, measured_length_caution(others, self.specimen))

    # ---- values in, values out

    def _length(self, value: Quantity) -> Any:
        length = _quantity(value, "m", "length")
        largest = _largest(length)
        if largest is not None and self.longest_length is not None:
            warn(self.length_cautions(length, text=_typed(value, largest)), stacklevel=3)
        return length

    def _drive(self, value: Quantity) -> Any:
        if self.is_biological:
            return _quantity(value, "1", "activation")
        pressure = _quantity(value, "Pa", "pressure")
        largest = _largest(pressure)
        if largest is not None:
            warn(collect(pressure_caution(largest, self.specimen, text=_typed(value, largest))), stacklevel=3)
        return pressure

    def _ask(self, question: str, *arguments: Any) -> Any:
        try:
            np.broadcast_shapes(*map(np.shape, arguments))
        except ValueError:
            shapes = " and ".join(str(np.shape(one)) for one in arguments)
            drive = "activation" if self.is_biological else "pressure"
            raise InputError("length", None, f"and {drive} must have shapes that fit together, got {shapes}") from None
        answer = getattr(self.law, question)(*arguments)
        parts = answer if isinstance(answer, LawState) else (answer,)
        if any(map(is_jax_array, arguments)) or any(map(is_traced, parts)):
            return answer
        warn(self.cautions, stacklevel=3)
        plain = [np.asarray(part) if np.ndim(part) else np.asarray(part).item() for part in parts]
        return LawState(*plain) if isinstance(answer, LawState) else plain[0]


def _rows(path: str, part: Any, stated: dict[str, SpecimenNumber]) -> list[ParameterRow]:
    if not isinstance(part, Module):
        return []
    rows = []
    for name, quantity in declared(part).items():
        value = getattr(part, name)
        if value is None:
            continue
        number = stated.get(name)
        source = "" if number is None else "inferred" if number.inferred else number.source
        values = np.asarray(value).tolist()
        rows.append(ParameterRow(f"{path}.{name}", quantity.symbol, values, quantity.unit, quantity.doc, source))
    inside = {name: value for name, value in vars(part).items() if isinstance(value, Module)}
    return rows + [row for name, value in inside.items() for row in _rows(f"{path}.{name}", value, {})]


def _quantity(value: Any, unit: str, field: str) -> Any:
    """A quantity as SI; what is neither number nor text is refused, for NumPy would make a number of it."""
    if value is None or isinstance(value, bool | Mapping | set):
        raise InputError(field, None, f"must be a number in {unit}, an array or text with a unit, got {value!r}")
    return in_si(value, unit, field=field)


def _scalar(value: Any, field: str) -> float:
    """One number; several are refused."""
    if np.ndim(value):
        raise InputError(field, None, f"must be one number, got {np.size(value)} of them")
    return float(value)


def _largest(value: Any) -> float | None:
    """The value of the largest size; None of what JAX traces, of nothing, and of what is no number."""
    if is_traced(value):
        return None
    numbers = np.asarray(value)
    numbers = numbers[~np.isnan(numbers)] if numbers.dtype.kind == "f" else numbers
    if numbers.dtype.kind not in "fiu" or not numbers.size:
        return None
    return float(numbers.flat[int(np.argmax(np.abs(numbers)))])


def _typed(value: Any, largest: float) -> str:
    return value if isinstance(value, str) else f"{largest:g}"
