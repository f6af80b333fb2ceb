"""What the muscles of a simulation move: a weight, a spring, a plate, a joint with two muscles, a chain of joints.

Lengths, masses and the like are numbers in SI units, or words such as ``"2 cm"``. A muscle is the id of a specimen, the path
of its file, or a `Muscle`. A mechanism is a value: it holds what it is made of, and `load` builds what moves.
"""

from __future__ import annotations

import abc
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..assembly.assumptions import Assumption, of_unit
from ..assembly.build import rig_cord, unit_from_muscle, unit_from_specimen
from ..assembly.loads import Body, ChainLink, JointLoad, LinkChain, Load, MomentArm, PlateLoad
from ..assembly.loads.joint import STOP_STIFFNESS
from ..assembly.muscle_unit import MuscleUnit
from ..errors import InputError
from ..muscles import Muscle
from ..muscles.elements import Tendon
from ..quantities import declared, parse
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
USUAL_SPAN = "nine tenths of the rest length"
WORKING_SHARE = 0.9  # of its rest length: where a muscle stands at angle zero unless stated otherwise


def in_si(value: Amount, unit: str, field: str) -> float:
    """A number in an SI unit, from words or from itself.

    Raises:
        InputError: it is no finite number, or has another unit; names the field.
    """
    if isinstance(value, str):
        return parse(value, unit, field=field)
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise InputError(field, repr(value), f"must be a number [{unit}] or words with a unit") from None
    if not np.isfinite(number):
        raise InputError(field, number, "must be a finite number")
    return number


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
    if isinstance(muscle, str | Specimen):
        return unit_from_specimen(muscle, tendon=cord)
    if isinstance(muscle, Muscle):
        return unit_from_muscle(muscle, tendon=cord)
    raise InputError(field, type(muscle).__name__, "must be the id of a specimen, its file, or a muscle")


def published(muscle: AnyMuscle) -> Specimen | None:
    """The specimen behind a muscle; None where there is none."""
    if isinstance(muscle, str):
        return muscle_specimen(muscle)
    return muscle.specimen if isinstance(muscle, Muscle) else muscle if isinstance(muscle, Specimen) else None


def rest_length(muscle: AnyMuscle, unit: MuscleUnit) -> float:
    """Length of a muscle at rest [m]: what its specimen or its law states, else the longest length of the law."""
    stated_by = published(muscle)
    if stated_by is not None and "rest_length" in stated_by.properties:
        return float(stated_by.property_si("rest_length", "m"))
    stated = getattr(unit.law, "rest_length", None)
    return float(unit.law.length_range()[1] if stated is None else stated)


@dataclass(frozen=True)
class Mechanism(abc.ABC):
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
                made += of_unit(name, units[name], usual_tendon=tendon is not None and not isinstance(tendon, Tendon))
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
    def drives(self) -> tuple[CommandInput, ...]:
        """The commands that act on the mechanism itself, such as a force from outside."""

    def start_commands(self, units: Mapping[str, MuscleUnit]) -> dict[str, float]:
        """Commands of the mechanism at the start [SI]; zero where it says nothing."""
        return {}

    def start_pressures(self, units: Mapping[str, MuscleUnit]) -> dict[str, float]:
        """Gauge pressures at the start [Pa]; zero where it says nothing."""
        return {}

    def fields(self) -> dict[str, str]:
        """Fields of an observation beside those of the muscles, with the outputs that they show."""
        return {}


@dataclass(frozen=True)
class Weight(Mechanism):
    """A mass that hangs from a muscle.

        mk.Weight("nylon", mass="5 kg")

    The command ``force`` [N] pulls it down further. At the start it hangs at rest, by the pressure that carries it there.

    Args:
        muscle: that carries it.
        mass: [kg].
        start: span of the muscle at the start [m]; nine tenths of its rest length by default.
        damping: viscous loss [N s/m].
        gravity: [m/s^2].
        tendon: between muscle and weight: a `Tendon` or its stiffness [N/m]; none by default.

    Examples:
        >>> import mckibben as mk
        >>> [drive.command for drive in mk.Weight("nylon", mass="5 kg").drives()]
        ['force']
    """

    muscle: AnyMuscle = "nylon"
    mass: Amount = 5.0
    start: Amount | None = None
    damping: Amount = 0.0
    gravity: Amount = GRAVITY
    tendon: TendonOption = None

    @property
    def muscles(self) -> dict[str, AnyMuscle]:
        """Names of the muscles: ``muscle`` alone."""
        return {"muscle": self.muscle}

    def _start(self, units: Mapping[str, MuscleUnit]) -> float:
        return _span(self.start, "start", self.muscle, units["muscle"])

    def usual_spans(self, units: Mapping[str, MuscleUnit]) -> dict[str, tuple[float, str]]:
        """The start, where it was left out."""
        return {} if self.start is not None else {"start": (self._start(units), USUAL_SPAN)}

    def load(self, units: Mapping[str, MuscleUnit]) -> Load:
        """A body in line with the muscle."""
        mass = in_si(self.mass, "kg", "mass")
        return Body(
            held=("muscle",),
            start=self._start(units),
            mass=mass,
            weight=mass * in_si(self.gravity, "m/s^2", "gravity"),
            damping=in_si(self.damping, "N*s/m", "damping"),
            signal="force",
        )

    def drives(self) -> tuple[CommandInput, ...]:
        """A force from outside."""
        return (CommandInput("force", "force", unit="N", meaning="force from outside, positive lengthening"),)

    def start_pressures(self, units: Mapping[str, MuscleUnit]) -> dict[str, float]:
        """The pressure that carries the weight."""
        weight = in_si(self.mass, "kg", "mass") * in_si(self.gravity, "m/s^2", "gravity")
        return {"muscle": units["muscle"].law.pressure_for(weight, self._start(units))}

    def fields(self) -> dict[str, str]:
        """Position, which is the span [m], and velocity [m/s]."""
        return {"position": "load.position", "velocity": "load.velocity"}


@dataclass(frozen=True)
class Spring(Mechanism):
    """A spring that a muscle pulls, with a mass between the two.

        mk.Spring("nylon", stiffness="2 N/mm")

    The command ``force`` [N] acts on the mass, positive away from the muscle. The spring is relaxed at the start.

    Args:
        muscle: that pulls.
        stiffness: stiffness of the spring [N/m].
        mass: between muscle and spring [kg].
        start: span of the muscle at the start [m]; its rest length by default.
        damping: viscous loss [N s/m].
        tendon: between muscle and mass: a `Tendon` or its stiffness [N/m]; none by default.

    Examples:
        >>> import mckibben as mk
        >>> [drive.command for drive in mk.Spring("nylon", stiffness="2 N/mm").drives()]
        ['force']
    """

    muscle: AnyMuscle = "nylon"
    stiffness: Amount = 2000.0
    mass: Amount = 0.1
    start: Amount | None = None
    damping: Amount = 1.0
    tendon: TendonOption = None

    @property
    def muscles(self) -> dict[str, AnyMuscle]:
        """Names of the muscles: ``muscle`` alone."""
        return {"muscle": self.muscle}

    def _start(self, units: Mapping[str, MuscleUnit]) -> float:
        return _span(self.start, "start", self.muscle, units["muscle"], share=1.0)

    def usual_spans(self, units: Mapping[str, MuscleUnit]) -> dict[str, tuple[float, str]]:
        """The start, where it was left out."""
        return {} if self.start is not None else {"start": (self._start(units), "the rest length")}

    def load(self, units: Mapping[str, MuscleUnit]) -> Load:
        """A body on a spring in line with the muscle."""
        start = self._start(units)
        return Body(
            held=("muscle",),
            start=start,
            mass=in_si(self.mass, "kg", "mass"),
            spring_rest=start,
            stiffness=in_si(self.stiffness, "N/m", "stiffness"),
            damping=in_si(self.damping, "N*s/m", "damping"),
            signal="force",
        )

    def drives(self) -> tuple[CommandInput, ...]:
        """A force from outside."""
        return (CommandInput("force", "force", unit="N", meaning="force from outside, positive lengthening"),)

    def fields(self) -> dict[str, str]:
        """Position, which is the span [m], and velocity [m/s]."""
        return {"position": "load.position", "velocity": "load.velocity"}


@dataclass(frozen=True)
class Plate(Mechanism):
    """A plate that holds a muscle at a span, which the command ``span`` [m] moves.

        mk.Plate("nylon", span="13 cm")

    The plate goes straight to a commanded span, and is there at the end of the step.

    Args:
        muscle: between its anchor and the plate.
        span: at the start [m]; nine tenths of the rest length by default.
        tendon: between muscle and plate: a `Tendon` or its stiffness [N/m]; none by default.

    Examples:
        >>> import mckibben as mk
        >>> [drive.command for drive in mk.Plate("nylon", span="13 cm").drives()]
        ['span']
    """

    muscle: AnyMuscle = "nylon"
    span: Amount | None = None
    tendon: TendonOption = None

    @property
    def muscles(self) -> dict[str, AnyMuscle]:
        """Names of the muscles: ``muscle`` alone."""
        return {"muscle": self.muscle}

    def load(self, units: Mapping[str, MuscleUnit]) -> Load:
        """A plate whose position is a signal."""
        return PlateLoad(held=("muscle",), signal="span")

    def drives(self) -> tuple[CommandInput, ...]:
        """The span."""
        return (
            CommandInput("span", "span", straight=True, unit="m", meaning="span at which the plate holds the muscle"),
        )

    def start_commands(self, units: Mapping[str, MuscleUnit]) -> dict[str, float]:
        """The span at the start [m]."""
        return {"span": self._start(units)}

    def _start(self, units: Mapping[str, MuscleUnit]) -> float:
        return _span(self.span, "span", self.muscle, units["muscle"])

    def usual_spans(self, units: Mapping[str, MuscleUnit]) -> dict[str, tuple[float, str]]:
        """The span, where it was left out."""
        return {} if self.span is not None else {"span": (self._start(units), USUAL_SPAN)}

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
        span: span of both muscles at angle zero [m]; nine tenths of the rest length of each by default.
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
    arm: Any = 0.02
    inertia: Amount = 2e-3
    damping: Amount = 0.01
    stiffness: Amount = 0.0
    gravity_moment: Amount = 0.0
    span: Amount | None = None
    start: Amount = 0.0
    stops: tuple[Amount, Amount] = (-2.0, 2.0)
    stop_stiffness: Amount = STOP_STIFFNESS
    tendon: TendonOption = None

    @property
    def muscles(self) -> dict[str, AnyMuscle]:
        """Flexor and extensor."""
        return {"flexor": self.flexor, "extensor": self.flexor if self.extensor is None else self.extensor}

    def load(self, units: Mapping[str, MuscleUnit]) -> Load:
        """A hinge with two moment arms."""
        arms = _pair_of_arms(self.arm, self.span, self.muscles, units)
        low, high = self.stops
        return JointLoad(
            arms=arms,
            inertia=in_si(self.inertia, "kg*m^2", "inertia"),
            damping=in_si(self.damping, "N*m*s", "damping"),
            stiffness=in_si(self.stiffness, "N*m", "stiffness"),
            start=in_si(self.start, "rad", "start"),
            gravity_moment=in_si(self.gravity_moment, "N*m", "gravity_moment"),
            lower_stop=in_si(low, "rad", "stops"),
            upper_stop=in_si(high, "rad", "stops"),
            stop_stiffness=in_si(self.stop_stiffness, "N*m", "stop_stiffness"),
            signal="moment",
        )

    def usual_spans(self, units: Mapping[str, MuscleUnit]) -> dict[str, tuple[float, str]]:
        """The spans at angle zero, where they were left out."""
        return _usual_spans(self.arm, self.span, self.muscles, units)

    def drives(self) -> tuple[CommandInput, ...]:
        """A moment from outside."""
        return (
            CommandInput(
                "moment", "moment", unit="N*m", meaning="moment from outside, positive towards positive angles"
            ),
        )

    def fields(self) -> dict[str, str]:
        """Angle [rad] and angular velocity [rad/s]."""
        return {"angle": "load.angle", "velocity": "load.angular_velocity"}


@dataclass(frozen=True)
class Link:
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
        span: span of both muscles at angle zero [m]; nine tenths of the rest length of each by default.
        start: angle of the joint at the start [rad].
        stops: smallest and largest angle of the joint [rad].
        stop_stiffness: stiffness of a stop [N m/rad]; it gives back all that it takes.
        tendon: between each muscle and the link: a `Tendon` or its stiffness [N/m]; none by default.

    Examples:
        >>> import mckibben as mk
        >>> mk.Link("30 cm", "0.6 kg", flexor="nylon", extensor=None, arm="2 cm").length
        '30 cm'
    """

    length: Amount
    mass: Amount
    flexor: AnyMuscle = "nylon"
    extensor: AnyMuscle = "nylon"
    arm: Any = 0.02
    centre: Amount | None = None
    inertia: Amount | None = None
    damping: Amount = 0.01
    stiffness: Amount = 0.0
    span: Amount | None = None
    start: Amount = 0.0
    stops: tuple[Amount, Amount] = (-2.0, 2.0)
    stop_stiffness: Amount = STOP_STIFFNESS
    tendon: TendonOption = None

    def chain_link(self, number: int) -> ChainLink:
        """The link as a part of the load; its outside moment is the signal ``moment_<number>``."""
        length, mass = (
            in_si(self.length, "m", f"length of link {number}"),
            in_si(self.mass, "kg", f"mass of link {number}"),
        )
        low, high = self.stops
        return ChainLink(
            length=length,
            mass=mass,
            centre=0.5 * length if self.centre is None else in_si(self.centre, "m", f"centre of link {number}"),
            inertia=mass * length**2 / 12.0 if self.inertia is None else in_si(self.inertia, "kg*m^2", "inertia"),
            damping=in_si(self.damping, "N*m*s", "damping"),
            stiffness=in_si(self.stiffness, "N*m", "stiffness"),
            start=in_si(self.start, "rad", "start"),
            lower_stop=in_si(low, "rad", "stops"),
            upper_stop=in_si(high, "rad", "stops"),
            stop_stiffness=in_si(self.stop_stiffness, "N*m", "stop_stiffness"),
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
    gravity: Amount = GRAVITY

    def __init__(self, *links: Link, gravity: Amount = GRAVITY) -> None:
        if not links or not all(isinstance(link, Link) for link in links):
            raise InputError("links", f"{len(links)} links", "must be one Link or more")
        object.__setattr__(self, "links", links)
        object.__setattr__(self, "gravity", gravity)

    @property
    def muscles(self) -> dict[str, AnyMuscle]:
        """Those of all joints."""
        sides = ("flexor", "extensor")
        every = {f"{side}_{k}": getattr(link, side) for k, link in enumerate(self.links, 1) for side in sides}
        return {name: muscle for name, muscle in every.items() if muscle is not None}

    def tendons(self) -> dict[str, TendonOption]:
        """Those of the links."""
        return {name: self.links[int(name.rpartition("_")[2]) - 1].tendon for name in self.muscles}

    def usual_spans(self, units: Mapping[str, MuscleUnit]) -> dict[str, tuple[float, str]]:
        """The spans at angle zero, where they were left out."""
        spans: dict[str, tuple[float, str]] = {}
        for k, link in enumerate(self.links, 1):
            pair = {f"{side}_{k}": getattr(link, side) for side in ("flexor", "extensor") if f"{side}_{k}" in units}
            spans |= _usual_spans(link.arm, link.span, pair, units)
        return spans

    def load(self, units: Mapping[str, MuscleUnit]) -> Load:
        """Coupled links with the moment arms of their muscles."""
        links: dict[str, ChainLink] = {}
        arms: dict[str, dict[str, MomentArm]] = {}
        for k, link in enumerate(self.links, 1):
            links[str(k)] = link.chain_link(k)
            pair = {side: f"{side}_{k}" for side in ("flexor", "extensor") if f"{side}_{k}" in units}
            own = {side: units[name] for side, name in pair.items()}
            made = _pair_of_arms(link.arm, link.span, {side: getattr(link, side) for side in pair}, own)
            arms |= {pair[side]: {str(k): arm} for side, arm in made.items()}
        return LinkChain(links, arms, order=tuple(links), gravity=in_si(self.gravity, "m/s^2", "gravity"))

    def drives(self) -> tuple[CommandInput, ...]:
        """A moment from outside about each joint."""
        return tuple(
            CommandInput(f"moment_{k}", f"moment_{k}", unit="N*m", meaning=f"moment from outside about joint {k}")
            for k in range(1, len(self.links) + 1)
        )

    def fields(self) -> dict[str, str]:
        """Angle [rad] and angular velocity [rad/s] of each joint; tip from the first joint, across and up [m]."""
        numbers = range(1, len(self.links) + 1)
        angles = {f"angle_{k}": f"load.angle_{k}" for k in numbers}
        tip = {name: f"load.{name}" for name in ("tip_across", "tip_height")}
        return angles | {f"velocity_{k}": f"load.angular_velocity_{k}" for k in numbers} | tip


def _span(
    stated: Amount | None, field: str, muscle: AnyMuscle, unit: MuscleUnit, share: float = WORKING_SHARE
) -> float:
    return share * rest_length(muscle, unit) if stated is None else in_si(stated, "m", field)


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
