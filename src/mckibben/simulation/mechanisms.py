"""What the muscles of a simulation move: a weight, a spring, a plate, a joint with two muscles, a chain of joints.

Lengths, masses and the like are numbers in SI units, or words such as ``"2 cm"``. A muscle is the id of a specimen, the path
of its file, or a `Muscle`. A mechanism is a value: it holds what it is made of, and `load` builds what moves.
"""

from __future__ import annotations

import abc
import dataclasses
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from ..answers import Caution, brief, collect
from ..assembly.build import Assumption, rig_cord, unit_assumptions, unit_from_muscle, unit_from_specimen
from ..assembly.loads import Body, ChainLink, JointLoad, LinkChain, Load, MomentArm, PlateLoad
from ..assembly.loads.joint import STOP_STIFFNESS
from ..assembly.muscle_unit import MuscleUnit
from ..components import Module
from ..errors import InputError, UnreachableError, refuse_unknown
from ..muscles import Muscle
from ..muscles.elements import Tendon
from ..muscles.evidence import law_cautions
from ..muscles.plausible import (
    HIGHEST_PRESSURE,
    argument_cautions,
    parameter_cautions,
    span_cautions,
    span_limits,
    working_span,
)
from ..quantities import amount, amounts, declared, has_dimension, parse, with_unit
from ..specimens import Specimen, muscle_specimen
from .stepping import CommandInput

Amount = float | str
StartPressure = Amount | Mapping[str, Amount]  # of all muscles, or by muscle
"""A number in the SI unit, or words with a unit."""

TendonOption = Tendon | Amount | None
"""A tendon, its stiffness [N/m], or None for a muscle that is tied to its anchors."""

AnyMuscle = Any
"""Id or file of a specimen, a `Specimen`, a `Muscle`, or a `MuscleUnit`."""

GRAVITY = 9.80665  # [m/s^2]
USUAL_SPAN = "nine tenths of the rest length, or more where the muscle contracts little"
# Sizes that are usual, beyond which an argument is said to be a slip [SI].
MASSES, INERTIAS, ARMS, ANGLES = (5e-3, 1e3), (1e-5, 1.0), (1e-3, 0.5), (2e-2, 7.0)
FORCES, MOMENTS = (0.0, 2e4), (0.0, 1e3)


def in_si(value: Amount, unit: str, field: str) -> float:
    """A number in an SI unit, from words or from itself.

    Raises:
        InputError: it is no finite number, or has another unit; names the field.
    """
    if isinstance(value, str):
        return parse(value, unit, field=field)
    try:
        if isinstance(value, bool):
            raise TypeError
        number = float(value)
    except (TypeError, ValueError):
        raise InputError(field, repr(value), f"must be a number [{unit}] or words with a unit") from None
    if not np.isfinite(number):
        raise InputError(field, number, "must be a finite number")
    return number


def ends_in_si(pair: Any, unit: str, field: str) -> tuple[float, float]:
    """The smallest and the largest value of a range in an SI unit; raises `InputError` where it is none."""
    if not isinstance(pair, tuple | list) or len(pair) != 2:
        raise InputError(field, str(pair), "must be a pair, the smallest and the largest value")
    low, high = (in_si(one, unit, field) for one in pair)
    if not low < high:
        raise InputError(field, str(pair), "must be the smallest and then the largest value")
    return low, high


def muscle_unit(muscle: AnyMuscle, field: str = "muscle", tendon: TendonOption = None) -> MuscleUnit:
    """A muscle from whatever names it: tied to its anchors, or with a tendon.

    Args:
        muscle: id or file of a specimen, a `Specimen`, a `Muscle`, or a unit, which keeps its own tendon.
        field: that a complaint names.
        tendon: between the muscle and what it moves; its stiffness is enough, toe and loss are then those of `rig_cord`.

    Raises:
        InputError: it is no muscle, or the tendon is none; names the field.
    """
    cord = tendon
    if cord is not None and not isinstance(cord, Tendon):
        cord = rig_cord().replace(stiffness=in_si(cord, "N/m", "tendon"))
    if isinstance(muscle, MuscleUnit):
        return muscle if cord is None else muscle.replace(tendon=cord)
    if isinstance(muscle, str | os.PathLike | Specimen):
        return unit_from_specimen(muscle, tendon=cord)
    if isinstance(muscle, Muscle):
        return unit_from_muscle(muscle, tendon=cord)
    raise InputError(field, type(muscle).__name__, "must be the id of a specimen, its file, or a muscle")


def published(muscle: AnyMuscle) -> Specimen | None:
    """The specimen behind a muscle; None where there is none."""
    if isinstance(muscle, str | os.PathLike):
        return muscle_specimen(muscle)
    return muscle.specimen if isinstance(muscle, Muscle) else muscle if isinstance(muscle, Specimen) else None


def rest_length(muscle: AnyMuscle, unit: MuscleUnit) -> float:
    """Length of a muscle at rest [m]: what its specimen or its law states, else the longest length of the law."""
    stated_by = published(muscle)
    if stated_by is not None and "rest_length" in stated_by.properties:
        return float(stated_by.property_si("rest_length", "m"))
    stated = getattr(unit.law, "rest_length", None)
    return float(unit.law.length_range()[1] if stated is None else stated)


def carrying_pressure(unit: MuscleUnit, tension: float, span: float) -> float:
    """The gauge pressure at which a muscle carries a tension [N] at a span [m], with which it starts [Pa].

    Raises:
        InputError: no pressure does; says which way the start must go, and where the muscle carries it without pressure.
    """
    try:
        if tension < 0.0:
            problem = f"must be one where the muscle pulls: what it carries there pushes it with {-tension:.4g} N"
            raise InputError("start", with_unit(span, "m"), problem)
        return unit.law.pressure_for(tension, span)
    except UnreachableError as error:
        if tension < (least := float(unit.law.tension(span, 0.0))):
            problem = f"must be a shorter span: at {with_unit(span, 'm')} the muscle pulls with {least:.4g} N without "
            problem += f"pressure, more than the {tension:.4g} N that it carries"
        elif tension > (most := float(unit.law.tension(longest := span_limits(unit.law)[2], HIGHEST_PRESSURE))):
            problem = f"must carry less: {tension:.4g} N is not reached: with {with_unit(HIGHEST_PRESSURE, 'Pa')} "
            problem += f"the muscle pulls with {most:.4g} N at {with_unit(longest, 'm')}, its longest"
        else:
            problem = f"must be a longer span: {str(error)[:1].lower() + str(error)[1:]}"
        raise InputError("start", None, problem) from None


class Stated:
    """A data class whose arguments are declared by `quantities.amount`: checked when it is made, read by `si`."""

    __dataclass_fields__: ClassVar[dict[str, dataclasses.Field[Any]]]

    def __new__(cls, *_: Any, **named: Any) -> Self:
        """Refuse what is no argument of it."""
        refuse_unknown(named, cls.__dataclass_fields__, where=cls.__name__)
        return super().__new__(cls)

    def __post_init__(self) -> None:
        for name in amounts(self):
            value = getattr(self, name)
            for one in value if isinstance(value, tuple | list) else (value,):
                if one is not None and not isinstance(one, Module):  # a moment arm, or a model of heat
                    in_si(one, amounts(self)[name][0], name)
        if "stops" in amounts(self):
            _check_stops(self)

    def si(self, name: str) -> float:
        """An argument in its SI unit."""
        return in_si(getattr(self, name), amounts(self)[name][0], name)


def _check_stops(joint: Any) -> None:
    if not (isinstance(joint.stops, tuple | list) and len(joint.stops) == 2):
        raise InputError("stops", str(joint.stops), "must be a pair, the smallest and the largest angle")
    low, high = (in_si(one, "rad", "stops") for one in joint.stops)
    for name, angle in (("lower_stop", low), ("upper_stop", high)):
        least, most = declared(JointLoad)[name].bounds
        if not least <= angle <= most:
            raise InputError("stops", f"{angle:g} rad", f"must be from {least:g} rad to {most:g} rad")
    if not low < high:
        raise InputError("stops", f"{low:g} and {high:g} rad", "must be the smallest and then the largest angle")
    if not low <= joint.si("start") <= high:
        problem = f"must be within the stops, {low:g} rad to {high:g} rad"
        raise InputError("start", f"{joint.si('start'):g} rad", problem)


def _hinge(joint: Any) -> dict[str, float]:
    """What a joint and the joint of a link state alike [SI]."""
    low, high = (in_si(one, "rad", "stops") for one in joint.stops)
    stated = {name: joint.si(name) for name in ("damping", "stiffness", "start", "stop_stiffness")}
    return stated | {"lower_stop": low, "upper_stop": high}


@dataclass(frozen=True)
class Mechanism(Stated, abc.ABC):
    """What muscles move. Subclasses say which muscles, and build the load of `assembly` that holds them."""

    @property
    @abc.abstractmethod
    def muscles(self) -> dict[str, AnyMuscle]:
        """The muscles by name, as they were given."""

    def tendons(self) -> dict[str, TendonOption]:
        """The tendons of the muscles by name, as they were given; None for a muscle that is tied to its anchors."""
        return dict.fromkeys(self.muscles, getattr(self, "tendon", None))

    def units(self) -> dict[str, MuscleUnit]:
        """The muscles by name, as parts of a machine."""
        tendons = self.tendons()
        return {name: muscle_unit(muscle, name, tendons[name]) for name, muscle in self.muscles.items()}

    def assumptions(self, units: Mapping[str, MuscleUnit]) -> tuple[Assumption, ...]:
        """What was left at a default that the muscles decide; see `Simulation.assumptions`."""
        spans, made = self.usual_spans(units), list[Assumption]()
        for name, muscle in self.muscles.items():
            if not isinstance(muscle, MuscleUnit):
                tendon = self.tendons()[name]
                made += unit_assumptions(
                    name, units[name], muscle, usual_tendon=tendon is not None and not isinstance(tendon, Tendon)
                )
        return (*made, *(Assumption(field, span, "m", note) for field, (span, note) in spans.items()))

    def usual_spans(self, units: Mapping[str, MuscleUnit]) -> dict[str, tuple[float, str]]:
        """Spans that were left out, by what they are: [m], and how they were chosen."""
        return {}

    @abc.abstractmethod
    def load(self, units: Mapping[str, MuscleUnit]) -> Load:
        """The load that holds the muscles.

        Raises:
            InputError: names what does not fit.
        """

    @abc.abstractmethod
    def drives(self, units: Mapping[str, MuscleUnit] | None = None) -> tuple[CommandInput, ...]:
        """The commands that act on the mechanism itself, such as a force; those of known muscles with their ranges."""

    def start_commands(self, units: Mapping[str, MuscleUnit]) -> dict[str, float]:
        """Commands of the mechanism at the start [SI]; zero where it says nothing."""
        return {}

    def start_pressures(self, units: Mapping[str, MuscleUnit]) -> dict[str, float]:
        """Gauge pressures at the start [Pa]; zero where it says nothing."""
        return {}

    def start_angles(self) -> dict[str, float]:
        """Angle at the start of the joint that each muscle turns [rad]; none where there is no joint."""
        return {}

    def fields(self) -> dict[str, str]:
        """Fields of an observation beside those of the muscles, with the outputs that they show."""
        return {}

    @abc.abstractmethod
    def spans(self, units: Mapping[str, MuscleUnit]) -> dict[str, float]:
        """Span of each muscle at the start [m]."""

    def cautions(self, units: Mapping[str, MuscleUnit]) -> tuple[Caution, ...]:
        """What can hardly be meant of the arguments, and of the spans at which the muscles begin.

        Raises:
            InputError: a muscle cannot be as long as its span; names the lengths that it can take.
        """
        said = list(argument_cautions(self))
        for name, span in self.spans(units).items():
            called = "span" if len(units) == 1 else f"span of {name}"
            if angle := self.start_angles().get(name):  # nobody has stated the span there
                called += f" at the start angle of {with_unit(angle, 'rad')}"
            said += mounted_cautions(self.muscles[name], units[name], span, called)
        return collect(*said)


@dataclass(frozen=True)
class SingleMuscle(Mechanism):
    """What one muscle moves."""

    muscle: AnyMuscle = "nylon"

    @property
    def muscles(self) -> dict[str, AnyMuscle]:
        """Names of the muscles: ``muscle`` alone."""
        return {"muscle": self.muscle}


@dataclass(frozen=True)
class PulledMass(SingleMuscle):
    """A mass in line with one muscle, on which the command ``force`` [N] acts."""

    def drives(self, units: Mapping[str, MuscleUnit] | None = None) -> tuple[CommandInput, ...]:
        """A force from outside."""
        return (
            CommandInput("force", "force", unit="N", meaning="force from outside, positive lengthening", usual=FORCES),
        )

    def fields(self) -> dict[str, str]:
        """Position, which is the span [m], and velocity [m/s]."""
        return {"position": "load.position", "velocity": "load.velocity"}


@dataclass(frozen=True)
class Weight(PulledMass):
    """A mass that hangs from a muscle.

        mk.Weight("nylon", mass="5 kg")

    The command ``force`` [N] pulls it down further. At the start it hangs at rest, by the pressure that carries it there.

    Args:
        muscle: that carries it.
        mass: [kg].
        start: span of the muscle at the start [m]; where left out nine tenths of its rest length, or more where
            it contracts little (`muscles.plausible.working_span`).
        damping: viscous loss [N s/m].
        gravity: [m/s^2].
        tendon: between muscle and weight: a `Tendon` or its stiffness [N/m]; none by default.

    Examples:
        >>> import mckibben as mk
        >>> [drive.command for drive in mk.Weight("nylon", mass="5 kg").drives()]
        ['force']
    """

    mass: Amount = amount("kg", (2e-2, MASSES[1]), default=5.0)
    start: Amount | None = amount("m", default=None)
    damping: Amount = amount("N*s/m", (1e-2, 1e3), default=0.0)
    gravity: Amount = amount("m/s^2", (0.1, 100.0), default=GRAVITY)
    tendon: TendonOption = None

    def spans(self, units: Mapping[str, MuscleUnit]) -> dict[str, float]:
        """The span at the start [m]."""
        return {"muscle": _span(self.start, "start", self.muscle, units["muscle"])}

    def usual_spans(self, units: Mapping[str, MuscleUnit]) -> dict[str, tuple[float, str]]:
        """The start, where it was left out."""
        return {} if self.start is not None else {"start": (self.spans(units)["muscle"], USUAL_SPAN)}

    def load(self, units: Mapping[str, MuscleUnit]) -> Load:
        """A body in line with the muscle."""
        return Body(
            held=("muscle",),
            start=self.spans(units)["muscle"],
            mass=self.si("mass"),
            weight=self.si("mass") * self.si("gravity"),
            damping=self.si("damping"),
            signal="force",
        )

    def start_pressures(self, units: Mapping[str, MuscleUnit]) -> dict[str, float]:
        """The pressure that carries the weight."""
        weight = self.si("mass") * self.si("gravity")
        return {"muscle": carrying_pressure(units["muscle"], weight, self.spans(units)["muscle"])}


@dataclass(frozen=True)
class Spring(PulledMass):
    """A spring that a muscle pulls, with a mass between the two.

        mk.Spring("nylon", stiffness="2 N/mm", weight="20 N")

    The command ``force`` [N] acts on the mass, positive away from the muscle. The spring is relaxed at the start, unless it
    is stated where it is. What spring and weight pull at the start is carried by the pressure of the muscle.

    Args:
        muscle: that pulls.
        stiffness: stiffness of the spring [N/m].
        mass: between muscle and spring [kg].
        start: span of the muscle at the start [m], or the tension at which it starts [N], as in ``"30 N"``, where spring and
            weight pull with it; the rest length by default.
        damping: viscous loss [N s/m].
        weight: constant force that pulls the mass away from the muscle [N].
        relaxed: span at which the spring is relaxed [m]; the start by default, and the rest length where that is a tension.
        tendon: between muscle and mass: a `Tendon` or its stiffness [N/m]; none by default.

    Examples:
        >>> import mckibben as mk
        >>> [drive.command for drive in mk.Spring("nylon", stiffness="2 N/mm").drives()]
        ['force']
    """

    stiffness: Amount = amount("N/m", (10.0, 1e6), default=2000.0)
    mass: Amount = amount("kg", (1e-3, 50.0), default=0.1)
    start: Amount | None = amount("m", default=None)
    damping: Amount = amount("N*s/m", (1e-2, 500.0), default=1.0)
    tendon: TendonOption = None
    weight: Amount = amount("N", (1e-2, FORCES[1]), default=0.0)
    relaxed: Amount | None = amount("m", default=None)

    def __post_init__(self) -> None:
        if self._tension is None:
            super().__post_init__()
        else:
            dataclasses.replace(self, start=None)  # which checks all else

    @property
    def _tension(self) -> float | None:
        """Tension at the start [N], where that is stated and not the span."""
        stated = isinstance(self.start, str) and has_dimension(self.start, "N")
        return parse(str(self.start), "N", field="start") if stated else None

    def spans(self, units: Mapping[str, MuscleUnit]) -> dict[str, float]:
        """The span at the start [m]."""
        rest = rest_length(self.muscle, units["muscle"])
        if self._tension is not None:
            relaxed = rest if self.relaxed is None else self.si("relaxed")
            return {"muscle": relaxed + (self.si("weight") - self._tension) / self.si("stiffness")}
        return {"muscle": rest if self.start is None else self.si("start")}

    def _relaxed(self, units: Mapping[str, MuscleUnit]) -> float:
        """Span at which the spring is relaxed [m]."""
        if self.relaxed is not None:
            return self.si("relaxed")
        return self.spans(units)["muscle"] if self._tension is None else rest_length(self.muscle, units["muscle"])

    def start_pressures(self, units: Mapping[str, MuscleUnit]) -> dict[str, float]:
        """The pressure that carries what spring and weight pull at the start."""
        span = self.spans(units)["muscle"]
        pull = self.si("weight") + self.si("stiffness") * (self._relaxed(units) - span)
        return {} if pull == 0.0 else {"muscle": carrying_pressure(units["muscle"], pull, span)}

    def usual_spans(self, units: Mapping[str, MuscleUnit]) -> dict[str, tuple[float, str]]:
        """The start, where it was left out."""
        return {} if self.start is not None else {"start": (self.spans(units)["muscle"], "the rest length")}

    def load(self, units: Mapping[str, MuscleUnit]) -> Load:
        """A body on a spring in line with the muscle."""
        start = self.spans(units)["muscle"]
        if not self.si("stiffness") > 0.0:
            raise InputError("stiffness", f"{self.si('stiffness'):g} N/m", "must be above 0 N/m")
        return Body(
            held=("muscle",),
            start=start,
            mass=self.si("mass"),
            weight=self.si("weight"),
            spring_rest=self._relaxed(units),
            stiffness=self.si("stiffness"),
            damping=self.si("damping"),
            signal="force",
        )


@dataclass(frozen=True)
class Plate(SingleMuscle):
    """A plate that holds a muscle at a span, which the command ``span`` [m] moves.

        mk.Plate("nylon", span="13 cm")

    The plate goes straight to a commanded span, and is there at the end of the step.

    Args:
        muscle: between its anchor and the plate.
        span: at the start [m]; where left out nine tenths of its rest length, or more where
            it contracts little (`muscles.plausible.working_span`).
        tendon: between muscle and plate: a `Tendon` or its stiffness [N/m]; none by default.

    Examples:
        >>> import mckibben as mk
        >>> [drive.command for drive in mk.Plate("nylon", span="13 cm").drives()]
        ['span']
    """

    span: Amount | None = amount("m", default=None)
    tendon: TendonOption = None

    def load(self, units: Mapping[str, MuscleUnit]) -> Load:
        """A plate whose position is a signal."""
        return PlateLoad(held=("muscle",), signal="span")

    def drives(self, units: Mapping[str, MuscleUnit] | None = None) -> tuple[CommandInput, ...]:
        """The span, which the muscle can take."""
        meaning = "span at which the plate holds the muscle"
        least, most, longest = (1e-3, math.inf, math.inf) if units is None else span_limits(units["muscle"].law)
        return (
            CommandInput(
                "span", "span", straight=True, unit="m", meaning=meaning,
                range=(least, most), hard=True, usual=(0.5 * longest, longest),
            ),
        )  # fmt: skip

    def spans(self, units: Mapping[str, MuscleUnit]) -> dict[str, float]:
        """The span at the start [m]."""
        return {"muscle": _span(self.span, "span", self.muscle, units["muscle"])}

    def start_commands(self, units: Mapping[str, MuscleUnit]) -> dict[str, float]:
        """The span at the start [m]."""
        return {"span": self.spans(units)["muscle"]}

    def usual_spans(self, units: Mapping[str, MuscleUnit]) -> dict[str, tuple[float, str]]:
        """The span, where it was left out."""
        return {} if self.span is not None else {"span": (self.spans(units)["muscle"], USUAL_SPAN)}

    def fields(self) -> dict[str, str]:
        """The span [m]."""
        return {"span": "muscle.span"}


@dataclass(frozen=True)
class Joint(Mechanism):
    """A hinge with two muscles: ``flexor`` turns it to positive angles, ``extensor`` back.

        mk.Joint(flexor="nylon", extensor="nylon", arm="2 cm", inertia=2e-3)

    The command ``moment`` [N m] acts from outside.

    Args:
        flexor: muscle with a positive moment arm.
        extensor: its antagonist; the same kind as the flexor by default.
        arm: moment arm of both at angle zero [m], or one for each as a pair; a `MomentArm` of `assembly` for a curve.
        inertia: about the axis [kg m^2].
        damping: viscous loss [N m s].
        stiffness: spring about the axis [N m/rad].
        gravity_moment: gravity moment of a limb that hangs down at angle zero [N m].
        span: span of both muscles at angle zero [m]; where left out nine tenths of the rest length of each, or more
            where it contracts little (`muscles.plausible.working_span`).
        start: angle at the start [rad].
        stops: smallest and largest angle [rad].
        stop_stiffness: stiffness of a stop [N m/rad]; it gives back all that it takes.
        tendon: between each muscle and the joint: a `Tendon` or its stiffness [N/m]; none by default.

    Examples:
        >>> import mckibben as mk
        >>> joint = mk.Joint(flexor="nylon", extensor="nylon", arm="2 cm", inertia=2e-3)
        >>> sorted(joint.muscles)
        ['extensor', 'flexor']
    """

    flexor: AnyMuscle = "nylon"
    extensor: AnyMuscle = None
    arm: Any = amount("m", ARMS, default=0.02)
    inertia: Amount = amount("kg*m^2", INERTIAS, default=2e-3)
    damping: Amount = amount("N*m*s", (1e-4, 5.0), default=0.01)
    stiffness: Amount = amount("N*m", (1e-3, 200.0), default=0.0)
    gravity_moment: Amount = amount("N*m", (2e-3, 500.0), default=0.0)
    span: Amount | None = amount("m", default=None)
    start: Amount = amount("rad", default=0.0)
    stops: tuple[Amount, Amount] = amount("rad", ANGLES, default=(-2.0, 2.0))
    stop_stiffness: Amount = amount("N*m", (1e2, 1e7), default=STOP_STIFFNESS)
    tendon: TendonOption = None

    @property
    def muscles(self) -> dict[str, AnyMuscle]:
        """Flexor and extensor."""
        return {"flexor": self.flexor, "extensor": self.flexor if self.extensor is None else self.extensor}

    def start_angles(self) -> dict[str, float]:
        """The start of the joint [rad]."""
        return dict.fromkeys(self.muscles, self.si("start"))

    def _arms(self, units: Mapping[str, MuscleUnit]) -> dict[str, MomentArm]:
        return _pair_of_arms(self.arm, self.span, self.muscles, units)

    def spans(self, units: Mapping[str, MuscleUnit]) -> dict[str, float]:
        """Span of each muscle at the angle of the start [m]."""
        return {name: float(arm.at(self.si("start"))) for name, arm in self._arms(units).items()}

    def load(self, units: Mapping[str, MuscleUnit]) -> Load:
        """A hinge with two moment arms."""
        return JointLoad(
            arms=self._arms(units),
            inertia=self.si("inertia"),
            gravity_moment=self.si("gravity_moment"),
            **_hinge(self),
            signal="moment",
        )

    def usual_spans(self, units: Mapping[str, MuscleUnit]) -> dict[str, tuple[float, str]]:
        """The spans at angle zero, where they were left out."""
        return _usual_spans(self.arm, self.span, self.muscles, units)

    def drives(self, units: Mapping[str, MuscleUnit] | None = None) -> tuple[CommandInput, ...]:
        """A moment from outside."""
        meaning = "moment from outside, positive towards positive angles"
        return (CommandInput("moment", "moment", unit="N*m", meaning=meaning, usual=MOMENTS),)

    def fields(self) -> dict[str, str]:
        """Angle [rad] and angular velocity [rad/s]."""
        return {"angle": "load.angle", "velocity": "load.angular_velocity"}


@dataclass(frozen=True)
class Link(Stated):
    """A link of a `Chain`, and the joint at its near end with its two muscles; either muscle may be left out as None.

    Args:
        length: to the next joint [m].
        mass: [kg].
        flexor: muscle that turns the joint to positive angles.
        extensor: its antagonist.
        arm: moment arm of both [m], or one for each as a pair; a `MomentArm` of `assembly` for a curve.
        centre: distance of the centre of mass from the joint [m]; half the length by default.
        inertia: about the centre of mass [kg m^2]; that of a thin rod by default.
        damping: viscous loss of the joint [N m s].
        stiffness: spring of the joint [N m/rad].
        span: span of both muscles at angle zero [m]; where left out nine tenths of the rest length of each, or more
            where it contracts little (`muscles.plausible.working_span`).
        start: angle of the joint at the start [rad].
        stops: smallest and largest angle of the joint [rad].
        stop_stiffness: stiffness of a stop [N m/rad]; it gives back all that it takes.
        tendon: between each muscle and the link: a `Tendon` or its stiffness [N/m]; none by default.

    Examples:
        >>> import mckibben as mk
        >>> mk.Link("30 cm", "0.6 kg", flexor="nylon", extensor=None, arm="2 cm").length
        '30 cm'
    """

    length: Amount = amount("m", (1e-2, 3.0))
    mass: Amount = amount("kg", (MASSES[0], 100.0))
    flexor: AnyMuscle = "nylon"
    extensor: AnyMuscle = "nylon"
    arm: Any = amount("m", ARMS, default=0.02)
    centre: Amount | None = amount("m", (1e-3, 3.0), default=None)
    inertia: Amount | None = amount("kg*m^2", INERTIAS, default=None)
    damping: Amount = amount("N*m*s", (1e-4, 5.0), default=0.01)
    stiffness: Amount = amount("N*m", (1e-3, 200.0), default=0.0)
    span: Amount | None = amount("m", default=None)
    start: Amount = amount("rad", default=0.0)
    stops: tuple[Amount, Amount] = amount("rad", ANGLES, default=(-2.0, 2.0))
    stop_stiffness: Amount = amount("N*m", (1e2, 1e7), default=STOP_STIFFNESS)
    tendon: TendonOption = None

    def chain_link(self, number: int) -> ChainLink:
        """The link as a part of the load; its outside moment is the signal ``moment_<number>``."""
        length = in_si(self.length, "m", f"length of link {number}")
        mass = in_si(self.mass, "kg", f"mass of link {number}")
        return ChainLink(
            length=length,
            mass=mass,
            centre=0.5 * length if self.centre is None else in_si(self.centre, "m", f"centre of link {number}"),
            inertia=mass * length**2 / 12.0 if self.inertia is None else self.si("inertia"),
            **_hinge(self),
            signal=f"moment_{number}",
        )


@dataclass(frozen=True, init=False)
class Chain(Mechanism):
    """Links one after the other in a plane, the first joint on the ground, each joint with its two muscles.

        mk.Chain(mk.Link("30 cm", "0.6 kg", arm="2 cm"), mk.Link("25 cm", "0.4 kg", arm="1.5 cm"))

    The muscles are ``flexor_1``, ``extensor_1``, ``flexor_2`` and so on, and the outside moments ``moment_1``, ``moment_2``.
    The first link hangs straight down at angle zero, and every other one goes on in line with the one before it.

    Args:
        *links: from the ground outwards.
        gravity: [m/s^2], down at angle zero; zero for a chain in a horizontal plane.

    Examples:
        >>> import mckibben as mk
        >>> leg = mk.Chain(mk.Link("30 cm", "0.6 kg", arm="2 cm"), mk.Link("25 cm", "0.4 kg", arm="1.5 cm"))
        >>> sorted(leg.muscles)
        ['extensor_1', 'extensor_2', 'flexor_1', 'flexor_2']
    """

    links: tuple[Link, ...]
    gravity: Amount = amount("m/s^2", (0.1, 100.0), default=GRAVITY)

    __repr__ = brief

    def __init__(self, *links: Link, gravity: Amount = GRAVITY) -> None:
        if not links or not all(isinstance(link, Link) for link in links):
            given = ", ".join(type(link).__name__ for link in links) or None
            raise InputError("links", given, "must be one Link or more, such as Chain(Link(..), Link(..))")
        object.__setattr__(self, "links", links)
        object.__setattr__(self, "gravity", gravity)
        self.__post_init__()

    @property
    def muscles(self) -> dict[str, AnyMuscle]:
        """Those of all joints."""
        sides = ("flexor", "extensor")
        every = {f"{side}_{k}": getattr(link, side) for k, link in enumerate(self.links, 1) for side in sides}
        return {name: muscle for name, muscle in every.items() if muscle is not None}

    def tendons(self) -> dict[str, TendonOption]:
        """Those of the links."""
        return {name: self.links[int(name.rpartition("_")[2]) - 1].tendon for name in self.muscles}

    def start_angles(self) -> dict[str, float]:
        """The starts of the joints that the muscles turn [rad]."""
        return {name: self.links[int(name.rpartition("_")[2]) - 1].si("start") for name in self.muscles}

    def usual_spans(self, units: Mapping[str, MuscleUnit]) -> dict[str, tuple[float, str]]:
        """The spans at angle zero, where they were left out."""
        spans: dict[str, tuple[float, str]] = {}
        for k, link in enumerate(self.links, 1):
            pair = {f"{side}_{k}": getattr(link, side) for side in ("flexor", "extensor") if f"{side}_{k}" in units}
            spans |= _usual_spans(link.arm, link.span, pair, units)
        return spans

    def _arms(self, units: Mapping[str, MuscleUnit]) -> dict[str, tuple[int, MomentArm]]:
        """For each muscle the number of its joint, and its moment arm there."""
        arms: dict[str, tuple[int, MomentArm]] = {}
        for k, link in enumerate(self.links, 1):
            pair = {side: f"{side}_{k}" for side in ("flexor", "extensor") if f"{side}_{k}" in units}
            own = {side: units[name] for side, name in pair.items()}
            made = _pair_of_arms(link.arm, link.span, {side: getattr(link, side) for side in pair}, own)
            arms |= {pair[side]: (k, arm) for side, arm in made.items()}
        return arms

    def spans(self, units: Mapping[str, MuscleUnit]) -> dict[str, float]:
        """Span of each muscle at the angles of the start [m]."""
        return {name: float(arm.at(self.links[k - 1].si("start"))) for name, (k, arm) in self._arms(units).items()}

    def cautions(self, units: Mapping[str, MuscleUnit]) -> tuple[Caution, ...]:
        """Those of the chain, and of each link."""
        of_links = [argument_cautions(link, of=f" of link {k}") for k, link in enumerate(self.links, 1)]
        centres = [_centre_caution(link, k) for k, link in enumerate(self.links, 1)]
        return collect(*super().cautions(units), *(one for said in of_links for one in said), *centres)

    def load(self, units: Mapping[str, MuscleUnit]) -> Load:
        """Coupled links with the moment arms of their muscles."""
        links = {str(k): link.chain_link(k) for k, link in enumerate(self.links, 1)}
        arms = {name: {str(k): arm} for name, (k, arm) in self._arms(units).items()}
        return LinkChain(links, arms, order=tuple(links), gravity=self.si("gravity"))

    def drives(self, units: Mapping[str, MuscleUnit] | None = None) -> tuple[CommandInput, ...]:
        """A moment from outside about each joint."""
        about = "moment from outside about joint"
        return tuple(
            CommandInput(f"moment_{k}", f"moment_{k}", unit="N*m", meaning=f"{about} {k}", usual=MOMENTS)
            for k in range(1, len(self.links) + 1)
        )

    def fields(self) -> dict[str, str]:
        """Angle [rad] and angular velocity [rad/s] of each joint; tip from the first joint, across and up [m]."""
        numbers = range(1, len(self.links) + 1)
        angles = {f"angle_{k}": f"load.angle_{k}" for k in numbers}
        tip = {name: f"load.{name}" for name in ("tip_across", "tip_height")}
        return angles | {f"velocity_{k}": f"load.angular_velocity_{k}" for k in numbers} | tip


def _centre_caution(link: Link, number: int) -> Caution | None:
    """Caution about a centre of mass beyond the far end of its link."""
    length = link.si("length")
    if link.centre is None or link.si("centre") <= length:
        return None
    shown, ends = with_unit(link.si("centre"), "m"), with_unit(length, "m")
    name = f"centre of link {number}"
    return Caution(f"a {name} of {shown} is beyond its far end: the link is {ends} long", name)


def default_span(muscle: AnyMuscle, unit: MuscleUnit) -> float:
    """Span of a muscle where none is stated [m]; see `muscles.plausible.working_span` for the rule."""
    return working_span(unit.law, rest_length(muscle, unit), published(muscle))


def mounted_cautions(muscle: AnyMuscle, unit: MuscleUnit, span: float, name: str) -> tuple[Caution, ...]:
    """Cautions about a muscle's law and the span at which it is mounted [m]; see `muscles.plausible.span_cautions`."""
    spec = published(muscle)
    of_span = span_cautions(span, unit.law, rest_length(muscle, unit), spec, name=name)
    of_tendon = () if unit.tendon is None else parameter_cautions({"tendon": unit.tendon})
    return collect(*law_cautions(spec, unit.law), *of_span, *of_tendon)


def _span(stated: Amount | None, field: str, muscle: AnyMuscle, unit: MuscleUnit) -> float:
    return default_span(muscle, unit) if stated is None else in_si(stated, "m", field)


def _usual_spans(
    arm: Any, span: Amount | None, muscles: Mapping[str, AnyMuscle], units: Mapping[str, MuscleUnit]
) -> dict[str, tuple[float, str]]:
    """Spans at angle zero of muscles for which neither their arms nor a span state them."""
    if span is not None or isinstance(arm, MomentArm):
        return {}
    return {
        f"span of {name}": (_span(None, "span", muscle, units[name]), USUAL_SPAN) for name, muscle in muscles.items()
    }


def _pair_of_arms(
    arm: Any, span: Amount | None, muscles: Mapping[str, AnyMuscle], units: Mapping[str, MuscleUnit]
) -> dict[str, MomentArm]:
    """Moment arms of a flexor and an extensor, which has the opposite sign."""
    pair = arm if isinstance(arm, tuple | list) else (arm, arm)
    if len(pair) != 2:
        raise InputError("arm", str(arm), "must be one moment arm, or a pair of flexor and extensor")
    made = {}
    for side, one, sign in (("flexor", pair[0], 1.0), ("extensor", pair[1], -1.0)):
        if side not in units:
            continue
        if isinstance(one, MomentArm):
            mirrored = one if sign > 0.0 or float(one.arm(0.0)) < 0.0 else one.replace(coefficients=-one.coefficients)
            made[side] = mirrored
            continue
        size = in_si(one, "m", "arm")
        limits = declared(MomentArm)["coefficients"]
        if not 0.0 < size <= limits.bounds[1]:
            raise InputError("arm", f"{size:g} m", "must be a moment arm above 0 m and up to 1 m")
        made[side] = MomentArm(
            coefficients=np.array([sign * size]), span=_span(span, "span", muscles[side], units[side])
        )
    return made
