"""A muscle as one object: law, friction, creep and published data, with the questions that a user asks; and made by name.

Lengths, pressures and forces go in as SI numbers, as arrays, or as text with a unit, and come out as SI: a number for
numbers and texts, a NumPy array for arrays, a JAX array or tracer for what JAX hands in.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike

from .._jax import is_jax_array, is_traced, jnp
from ..accessors import Accessor, implementation
from ..answers import Caution, collect, warn
from ..components import Hysteresis, MemoryElement, Module, Scalar, field
from ..documents import JsonValue
from ..errors import InputError
from ..quantities import declared, in_si, with_unit
from ..registry import is_reference, named_by_person
from ..specimens import Specimen, SpecimenNumber, muscle_specimen, save_specimen
from .build import (
    at_rest_length,
    biological_from_specimen,
    build_law,
    law_from_specimen,
    parameters_in_si,
    rest_length_of,
)
from .elements import MaxwellChain
from .evidence import LawError, check_geometry, error_of, law_cautions, own_numbers, tension_range
from .hysteresis import HYSTERESES, Coulomb, FrictionLimit, MaxwellSlip
from .law import LawState, TensionLaw, law_name
from .laws import LAWS
from .plausible import free_length_caution, length_caution, measured_length_caution, pressure_caution, stretch_caution
from .sleeve import from_braid

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

    def __check_init__(self) -> None:
        if isinstance(self.law, str | os.PathLike | Specimen):
            problem = "must be a tension law; mckibben.muscle(..) makes the muscle of a name, a file or a specimen"
            raise InputError("law", str(getattr(self.law, "id", self.law)), problem)

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
        if _ends(drive) and not self.is_biological:
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
        return self.law.pressure_for(force, span, highest=_scalar(in_si(highest, "Pa", field="highest"), "highest"))

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
        return error_of(self.specimen, self.law)

    @functools.cached_property
    def cautions(self) -> tuple[Caution, ...]:
        """What must be known of every answer of this muscle, such as a large error; said as warnings with each."""
        return law_cautions(self.specimen, self.law)

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
        """Write the specimen to a ``.toml`` file that every command takes, with this muscle's law, friction and creep.

        Returns:
            Its path.

        Raises:
            InputError: the muscle was made without a specimen, or of a part that a file cannot state.
        """
        if self.specimen is None:
            raise InputError("specimen", None, "is missing: only a muscle of a specimen, a braid or a fit can be saved")
        spec = self.stated_specimen()
        again = built_muscle(spec)
        for name in ("law", "friction", "creep"):
            if (part := getattr(self, name)) != getattr(again, name):
                here, there = (type(one).__name__ for one in (part, getattr(again, name)))
                said = f"{here} cannot be saved: read again from the file it would be {there}"
                raise InputError(name, None, said if here != there else f"{said} with other numbers")
        save_specimen(spec, path)
        return Path(path)

    def stated_specimen(self) -> Specimen:
        """The specimen as this muscle is: its law, friction and creep, with the numbers that differ from its file.

        Raises:
            InputError: the muscle was made without a specimen.
        """
        spec, name = self.specimen, self.law_name
        if spec is None:
            raise InputError("specimen", None, "is missing: the muscle was made without one")
        if name not in spec.laws:
            return spec
        fibre = self.is_biological
        before = biological_from_specimen(spec, name, {}) if fibre else law_from_specimen(spec, name)
        numbers = {key: (getattr(self.law, key), getattr(before, key), q.unit) for key, q in declared(self.law).items()}
        changed = {
            key: SpecimenNumber(value=float(value), unit=unit, note="stated for this muscle")
            for key, (value, of_file, unit) in numbers.items()
            if float(value) != float(of_file)
        }
        made = dataclasses.replace(spec, law=name, laws=spec.laws | {name: spec.laws[name] | changed})
        if own_numbers(spec, self.law):  # what was found is of the numbers of the file
            properties = {key: one for key, one in spec.properties.items() if key != "tension_uncertainty"}
            errors = {law: group for law, group in spec.errors.items() if law != name}
            made = dataclasses.replace(made, errors=errors, between={}, properties=properties)
        usual = built_muscle(made)
        if self.friction != usual.friction:
            mine = self.friction and {HYSTERESES.stated_as(type(self.friction), made.friction): _numbers(self.friction)}
            made = dataclasses.replace(made, friction=mine or {})
        if self.creep != usual.creep:
            chain = {} if self.creep is None else _numbers(self.creep)
            other = {key: value for key, value in made.properties.items() if key not in _CREEP.values()}
            made = dataclasses.replace(made, properties=other | {_CREEP.get(k, k): v for k, v in chain.items()})
        return made

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
        far = length_caution(largest, longest, text=text) or stretch_caution(most, longest, self.specimen)
        others = [one for one in (least, most) if far is None or (one <= longest and one != largest)]
        return collect(far, measured_length_caution(others, self.specimen))

    # ---- values in, values out

    def _length(self, value: Quantity) -> Any:
        length = _quantity(value, "m", "length")
        ends = _ends(length)
        if ends and self.longest_length is not None:
            warn(self.length_cautions(ends, text=_typed(value, max(ends, key=abs))), stacklevel=3)
        return length

    def _drive(self, value: Quantity) -> Any:
        if self.is_biological:
            activation = _quantity(value, "1", "activation")
            for end in _ends(activation):
                if not 0.0 <= end <= 1.0:
                    raise InputError("activation", _typed(value, end), "must be between 0 and 1")
            return activation
        pressure = _quantity(value, "Pa", "pressure")
        if ends := _ends(pressure):
            furthest = dict.fromkeys((ends[1], min(ends[0], 0.0)))
            said = (pressure_caution(one, self.specimen, text=_typed(value, one)) for one in furthest)
            warn(collect(*said), stacklevel=3)
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


_CREEP = {"stiffness": "creep_stiffness", "time_constant": "creep_time_constants"}  # of a chain, as a file states them


def _numbers(part: Module) -> dict[str, SpecimenNumber]:
    """Numbers of a friction and its limit, or of a creep, as a file states them."""
    found = {key: (getattr(part, key), q.unit) for key, q in declared(part).items()}
    found |= {f.name: (getattr(part, f.name), "1") for f in dataclasses.fields(part) if f.type in ("int", int)}
    values = {key: (np.asarray(value, float).tolist(), unit) for key, (value, unit) in found.items()}
    limit = getattr(part, "limit", None)
    said = "stated for this muscle"
    numbers = {key: SpecimenNumber(value=value, unit=unit, note=said) for key, (value, unit) in values.items()}
    return numbers if limit is None else numbers | _numbers(limit)


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


def _ends(value: Any) -> tuple[float, ...]:
    """The least and the largest value; nothing of what JAX traces, of nothing, and of what is no number."""
    if type(value) is float:
        return () if math.isnan(value) else (value, value)
    numbers = np.asarray([] if is_traced(value) else value)
    numbers = numbers[~np.isnan(numbers)] if numbers.dtype.kind == "f" else numbers
    if numbers.dtype.kind not in "fiu" or not numbers.size:
        return ()
    return float(numbers.min()), float(numbers.max())


def _typed(value: Any, largest: float) -> str:
    return value if isinstance(value, str) else f"{largest:g}"


# ---- muscles by name


def built_muscle(
    name: str | os.PathLike[str] | Specimen,
    *,
    law: str | type[TensionLaw] | None = None,
    friction: str | Hysteresis | None = None,
    creep: MemoryElement | None = None,
    **parameters: Any,
) -> Muscle:
    """A muscle as `MuscleFactory` makes it, of names that may stand in a file and allow no code."""
    if not (creep is None or isinstance(creep, MemoryElement)):
        raise InputError("creep", None, f"must be an element such as MaxwellChain, got {creep!r}")
    if not (friction is None or isinstance(friction, str | Hysteresis)):
        raise InputError("friction", None, f"must be a friction such as MaxwellSlip, or its name, got {friction!r}")
    for key, value in parameters.items():
        if not isinstance(value, str) and np.ndim(value):
            raise InputError(key, None, f"must be one number, got {value!r}")
    if isinstance(name, str) and name in LAWS:
        if law is not None:
            raise InputError("law", None, f"is allowed only with a specimen; {name} is a law itself")
        built = build_law(name, parameters_in_si(name, parameters))
        check_geometry(built, rest_length_of(None, built))
        return Muscle(built, _own(friction), creep, stated=tuple(parameters))
    spec = name if isinstance(name, Specimen) else muscle_specimen(name)
    chosen = (law if isinstance(law, str) else LAWS.stated_as(law, spec.laws)) if law else spec.law
    spec, changes = at_rest_length(spec, chosen, parameters_in_si(chosen, parameters))
    if spec.kind == "biological":
        fibre = cast(TensionLaw, biological_from_specimen(spec, chosen, changes))  # it answers the questions of a law
        return Muscle(fibre, _own(friction), creep, specimen=spec)
    built = law_from_specimen(spec, chosen, changes=changes)
    check_geometry(built, rest_length_of(spec, built))
    chain = creep or _stated_creep(spec)
    return Muscle(built, _usual_friction(spec, friction), chain, specimen=spec, stated=tuple(parameters))


class MuscleFactory:
    """Makes a `Muscle` of what names one: a specimen's id, a ``.toml`` file, or a law and its parameters."""

    def __call__(
        self,
        name: str | os.PathLike[str] | Specimen,
        *,
        law: str | type[TensionLaw] | None = None,
        friction: str | Hysteresis | None = None,
        creep: MemoryElement | None = None,
        **parameters: Any,
    ) -> Muscle:
        """A muscle from a specimen, or from a law.

        Args:
            name: id of a specimen, path of a ``.toml`` file, a specimen that was read, or the name of a law.
            law: one of the laws that the specimen states, or the class of one that it states as ``my.py:MyLaw``; its default
                law where left out.
            friction: one of the frictions that the specimen states, a friction, or a class in a file such as
                ``my.py:MyFriction``. Where left out the specimen's own such class, else Maxwell-slip, and where only
                Coulomb's is stated Maxwell-slip elements with its limit, for a friction without memory chatters at rest.
            creep: viscoelastic elements beside the braid.
            **parameters: of the law, in place of those that the specimen states: numbers [SI] or text with a unit.

        Raises:
            InputError: the name is unknown, or names a valve; or a parameter is missing, unknown or out of bounds.

        Examples:
            >>> import mckibben as mk
            >>> mk.muscle("nylon")
            Muscle('nylon', linear_threshold + MaxwellSlip, 14 cm at rest)
            >>> mk.muscle("ideal", thread_length="16 cm", turns=3.2)
            Muscle(own, ideal)
        """
        named_by_person(name, law, friction)
        return built_muscle(name, law=law, friction=friction, creep=creep, **parameters)

    def from_braid(self, **dimensions: float | str) -> Muscle:
        """A muscle from the dimensions of its sleeve and bladder, with nothing measured.

        Args:
            **dimensions: ``rest_length``, ``diameter``, ``braid_angle``, ``thread_diameter`` and ``bladder_thickness``, and
                ``shore``, see `muscles.sleeve.from_braid`.

        Raises:
            InputError: a dimension is missing, unknown or out of its bounds, or bladder and threads fill the braid.

        Examples:
            >>> import mckibben as mk
            >>> mk.muscle.from_braid(rest_length="300 mm", diameter="12 mm", braid_angle="25 deg", thread_diameter="0.25 mm",
            ...     bladder_thickness="1 mm")
            Muscle('braid', linear_threshold + MaxwellSlip, 30 cm at rest)
        """
        try:
            inspect.signature(from_braid).bind(**dimensions)
        except TypeError:
            known = inspect.signature(from_braid).parameters
            for name in dimensions:
                if name not in known:
                    raise InputError("dimension", name, known=known) from None
            missing = [n for n, p in known.items() if p.default is p.empty and n not in dimensions]
            raise InputError("dimensions", None, f"of a braid are incomplete without {', '.join(missing)}") from None
        return self(from_braid(**cast(Any, dimensions)))


muscle = MuscleFactory()
"""A muscle by name, see `MuscleFactory`: ``mckibben.muscle("nylon")``, ``mckibben.muscle.from_braid(..)``."""


def from_specimen(spec: Specimen, law: str | None = None, friction: str | None = None) -> Any:
    """A `Muscle` of a McKibben specimen, or the `BiologicalMuscle` of a biological one.

    Args:
        spec: the specimen, as read from a file.
        law: one of the laws it states; its default law by default.
        friction: one of the frictions it states; the first by default, none if it states none.
    """
    if spec.kind == "biological":
        return biological_from_specimen(spec, law or spec.law, {})
    chosen = friction or next(iter(spec.friction), None)
    return Muscle(
        law=law_from_specimen(spec, law),
        friction=None if chosen is None else _stated_friction(spec, chosen),
        specimen=spec,
    )


def _own(friction: str | Hysteresis | None) -> Hysteresis | None:
    if not isinstance(friction, str):
        return friction
    if is_reference(friction):
        return _build_friction(friction, {}, "friction", None)
    raise InputError("friction", friction, "must be a friction such as MaxwellSlip; only specimens state one by name")


def _usual_friction(spec: Specimen, friction: str | Hysteresis | None) -> Hysteresis | None:
    if isinstance(friction, Hysteresis):
        return friction
    own = next((name for name in spec.friction if is_reference(name)), None)
    usual = "maxwell_slip" if "maxwell_slip" in spec.friction else next(iter(spec.friction), None)
    chosen = friction or own or usual
    if chosen is None:
        return None
    if chosen not in spec.friction and is_reference(chosen):
        return _own(chosen)
    built = _stated_friction(spec, chosen)
    return MaxwellSlip.geometric(built.limit) if isinstance(built, Coulomb) and friction is None else built


def _stated_creep(spec: Specimen) -> MemoryElement | None:
    if "creep_stiffness" not in spec.properties:
        return None
    where = spec.where or spec.id
    values = {}
    for name, unit in (("creep_stiffness", "N/m"), ("creep_time_constants", "s")):
        if name not in spec.properties:
            raise InputError(f"properties.{name}", None, "is missing: creep has stiffnesses and times", where=where)
        value = spec.properties[name].si(unit, field=f"properties.{name}", where=where)
        values[name] = np.atleast_1d(np.asarray(value, float))
    stiffness, times = values.values()
    if stiffness.shape != times.shape:
        allowed = f"must be as many as creep_stiffness, {len(stiffness)}, got {len(times)}"
        raise InputError("properties.creep_time_constants", None, allowed, where=where)
    known = declared(MaxwellChain)
    for name, numbers in (("stiffness", stiffness), ("time_constant", times)):
        known[name].check(f"creep.{name}", numbers, where=where)
    return MaxwellChain(stiffness=stiffness, time_constant=times)


# Parameters of the limit of a friction, and of Maxwell-slip elements with spread travels, in a specimen file; SI units.
_LIMIT_UNITS = {"constant": "N", "per_pressure": "m^2"}
_SPREAD_UNITS = {"elements": "1", "shortest": "m", "longest": "m", "at_pressure": "Pa"}


def _stated_friction(spec: Specimen, name: str) -> Hysteresis:
    if name not in spec.friction:
        raise InputError("friction", name, f"{spec.id} states", known=spec.friction, where=spec.where)
    return _build_friction(name, spec.friction[name], f"friction.{name}", spec.where)


def _build_friction(name: str, stated: Mapping[str, SpecimenNumber], path: str, where: str | None) -> Hysteresis:
    """A friction from the numbers that a file states; what it declares beyond has its defaults."""
    kind = HYSTERESES.find(name, field=path, where=where)
    has_limit = any(f.name == "limit" for f in dataclasses.fields(kind))
    known = {key: q.unit for key, q in declared(kind).items()} | (_LIMIT_UNITS if has_limit else {})
    whole = {f.name for f in dataclasses.fields(kind) if f.type in ("int", int)}
    known |= dict.fromkeys(whole, "1")
    if kind is MaxwellSlip:
        known |= _SPREAD_UNITS
        whole.add("elements")
    parameters: dict[str, Any] = {}
    for key, number in stated.items():
        if key not in known:
            raise InputError(f"{path}.{key}", None, f"{name} has", known=known, where=where)
        value = number.si(known[key], field=f"{path}.{key}", where=where)
        if key in declared(kind):
            declared(kind)[key].check(f"{path}.{key}", value, where=where)
        parameters[key] = int(value) if key in whole and not isinstance(value, list) else value
    if has_limit:
        limit = {key: parameters.pop(key, 0.0) for key in _LIMIT_UNITS}
        parameters["limit"] = FrictionLimit(**limit)
    # Elements of equal force with spread travels are how a source states Maxwell-slip; single stiffnesses are measured.
    make: Any = MaxwellSlip.geometric if kind is MaxwellSlip and "stiffness" not in parameters else kind
    try:
        built: Hysteresis = make(**parameters)
    except TypeError as error:
        raise InputError(path, ", ".join(parameters), str(error).split(") ")[-1], where=where) from None
    return built
