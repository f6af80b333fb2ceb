"""What stands behind the numbers of a specimen: how far its law was from measurements, and where that was found.

A file states the errors of its laws and the rest lengths of the muscles that were measured. Whatever answers for such a
muscle says so: the error always, and a caution where it is large or where a rest length is beyond the measured ones. There
it grows: what the ends of a muscle take goes as their length over its own, see `growth_at`. All of it is of the file's own
numbers. Of a muscle of which one that enters its tension is another, nothing was found: it has no interval, and says so.

How far a tension may be off because of numbers that nobody measured, the ranges of a file say: each number is moved to both
of its ends while the others stay; the changes to either side add as squares, for the numbers are independent. The
parameters of a braid all follow from its dimensions, so that there the dimensions are moved instead. Ranges of a fitted law
belong to parameters that only hold together; there the law's error says more.
"""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from .._jax import is_traced
from ..accessors import implementation
from ..answers import Caution, collect
from ..documents import JsonValue
from ..errors import InputError, NoVolumeError
from ..quantities import declared, values, with_unit
from ..specimens import Specimen
from ..specimens.model import BETWEEN_COMPONENTS, BETWEEN_SHARES, KNOWN_ERRORS, MUSCLES
from .braid import SHORTEST_SHARE, braid_of
from .build import SAME_REST_LENGTH, at_rest_length, default_parameters, law_from_specimen, measured_rest_lengths
from .law import TensionLaw, law_name
from .laws import LAWS
from .plausible import HIGHEST_PRESSURE, usual_pressure
from .sleeve import differing_caution, is_braid, other_laws, varied_law

NOTABLE = 0.10  # largest error over the largest tension from which an answer carries a caution [1]
PRESSURE_OF_LARGEST = "highest_measured_pressure"
SAME_NUMBER = 1e-5  # share by which two numbers differ of which one was written to a file, in six digits
SAME_LENGTH = 0.02  # share by which a rest length or a bore may leave the measured ones without a word


class LawError(NamedTuple):
    """Error of a law over the largest measured tension [1], None where it is not known, and what it was found on.

    Attributes:
        rms: root mean square.
        largest: largest one.
        other_muscle: largest one on another muscle of the make.
        other_length: largest one at a rest length to which the law was not fitted.
        source: what `rms` and `largest` were found on.
        other_source: what `other_muscle` was found on.
        length_source: what `other_length` was found on.
        other_length_at: rest length at which `other_length` was found [m].
        at_rest_length: largest one at the rest length of the muscle that was asked for, see `growth_at`.
        make: whose numbers the law had.
        own: parameters of the muscle that are not those numbers, see `own_numbers`.
    """

    rms: float | None
    largest: float | None
    other_muscle: float | None
    other_length: float | None
    source: str
    other_source: str = ""
    length_source: str = ""
    other_length_at: float | None = None
    at_rest_length: float | None = None
    make: str = ""
    own: tuple[str, ...] = ()

    def __str__(self) -> str:
        known = [f"{_percent(share)} {word}" for share, word in ((self.rms, "rms"), (self.largest, "at most")) if share]
        said = f"{' and '.join(known)} of the largest tension ({self.source})"
        more = f", {_percent(self.other_muscle)} on another muscle ({self.other_source})" if self.other_muscle else ""
        return (
            said + more + (f", with the numbers of {self.make} and not with {_own_words(self.own)}" if self.own else "")
        )

    @property
    def at_other_length(self) -> str:
        """How far it was off at a rest length to which it was not fitted, where, and what that was found on."""
        where = "" if self.other_length_at is None else f" at {with_unit(self.other_length_at, 'm', 3)}"
        return f"{_percent(self.other_length or 0.0)}{where} ({self.length_source})"

    @property
    def worst(self) -> float:
        """The largest share by which the tension of a muscle of this rest length may be off [1]."""
        return max(self.largest or 0.0, self.other_muscle or 0.0)

    def to_dict(self) -> dict[str, JsonValue]:
        """The shares and their source as plain values, for JSON."""
        return {**self._asdict(), "own": list(self.own), "sentence": str(self)}


class MakeSpread(NamedTuple):
    """Half widths of the 95 % interval of one muscle around its law, over its largest tension [1]; means over the map.

    Attributes:
        same_rig: of a muscle on the rig on which the law was measured.
        elsewhere: of one in another laboratory.
        calibrated: of this muscle, by the readings that its specimen states.
    """

    same_rig: float | None = None
    elsewhere: float | None = None
    calibrated: float | None = None

    def __str__(self) -> str:
        if self.calibrated is not None:
            return f"this muscle, as calibrated, lies within {_percent(self.calibrated)} of its largest tension (95 %)"
        said = f"another muscle of the make lies within {_percent(self.elsewhere or 0.0)} of its largest tension (95 %)"
        return said if self.same_rig is None else f"{said}, on the rig of the measured ones {_percent(self.same_rig)}"

    def to_dict(self) -> dict[str, JsonValue]:
        """The shares as plain values, for JSON."""
        known: dict[str, JsonValue] = {n: share for n, share in self._asdict().items() if share is not None}
        return known | {"sentence": str(self)}


def make_spread(spec: Specimen | None, law: TensionLaw) -> MakeSpread | None:
    """How far one muscle of a specimen's make, of a law that is cut to it, is off; None where the specimen says nothing."""
    if own_numbers(spec, law):
        return None
    new = _one_of_make(spec, law)
    if new is not None and new.readings:
        return MakeSpread(calibrated=new.share())
    if new is not None:
        return MakeSpread(_one_of_make(spec, law, same_rig=True).share(), new.share())
    shares = {} if spec is None else _shares(spec, law)
    return MakeSpread(**shares) if shares.get("elsewhere") or shares.get("calibrated") else None


def tension_interval(
    spec: Specimen | None, law: TensionLaw, length: Any, pressure: Any, *, same_rig: bool = False
) -> np.ndarray | None:
    """Ends of the 95 % interval of the tension of one muscle [N], (2, ..), around its law; None where nothing says it.

    The home of every interval of a specimen: by readings of this muscle, by how far muscles of its make differ or by a
    share of the largest tension that the specimen states, and else as this muscle was characterised.

    Args:
        spec: the specimen.
        law: of the muscle, with the rest length to which it was cut; of the bore of the specimen.
        length: between the anchors [m].
        pressure: gauge [Pa].
        same_rig: the muscle is on the rig on which its make was measured.

    Examples:
        >>> import mckibben as mk
        >>> muscle = mk.muscle("festo-10mm", rest_length="132 mm")
        >>> [round(float(end)) for end in tension_interval(muscle.specimen, muscle.law, 0.128, 5e5)]
        [72, 282]
    """
    if own_numbers(spec, law):
        return None
    new, own = _one_of_make(spec, law, same_rig=same_rig), np.asarray(law.tension(length, pressure))
    if new is not None:
        told = new.predicted(length, pressure, own)
        return np.stack([told.low, told.high])
    half = None if spec is None else _stated_half_width(spec, law, same_rig=same_rig)
    return None if half is None else np.stack([np.maximum(own - half, 0.0), own + half])


def _one_of_make(spec: Specimen | None, law: TensionLaw, *, same_rig: bool = False) -> Any:
    """Gaussian of one muscle, see `identification.between`; None where the specimen does not state what it is made of."""
    if spec is None or _of_other_bore(spec, law) or not all(name in spec.between for name in BETWEEN_COMPONENTS):
        return None
    # what a muscle has learned stands beside the law that all of its make share
    return implementation("new_muscle")(spec, getattr(law, "of", law), same_rig=same_rig)


def _stated_half_width(spec: Specimen, law: TensionLaw, *, same_rig: bool = False) -> float | None:
    """Half width that a specimen states [N]; a share needs the rest length and highest pressure of the largest tension."""
    shares = _shares(spec, law)
    if not shares["elsewhere"] and not shares["calibrated"]:
        known = "tension_uncertainty" in spec.properties and not _beyond_measured(spec, _rest_length(spec, law))
        return spec.property_si("tension_uncertainty", "N") if known else None
    share = shares["calibrated"] or shares["same_rig" if same_rig else "elsewhere"]
    at = _rest_length(spec, law)
    if share is None or at is None or _of_other_bore(spec, law) or PRESSURE_OF_LARGEST not in spec.properties:
        return None
    return share * float(law.tension(at, spec.property_si(PRESSURE_OF_LARGEST, "Pa")))


def _shares(spec: Specimen, law: TensionLaw) -> dict[str, float | None]:
    """Shares that a specimen states, wider by what its law may be off at rest lengths to which it was not fitted."""
    off = growth_at(spec, error_of(spec, law_name(law)), _rest_length(spec, law))
    shares: dict[str, float | None] = dict.fromkeys(BETWEEN_SHARES)
    for name in spec.between.keys() & shares.keys():
        share = float(str(spec.between[name].si("1", field=f"between.{name}")))
        # readings are of this very muscle
        shares[name] = share if name == "calibrated" else None if off is None else float(np.hypot(share, off))
    return shares


def growth_at(spec: Specimen, error: LawError | None, rest: float | None) -> float | None:
    """By how much more than at measured rest lengths a law may be off at another [1]; None where nobody looked.

    A law takes the ends of the muscles that were measured, whose share in a muscle goes as 1/L. So its error grows with the
    distance |1/L - 1/L0| from the nearest measured L0: by nothing there, and at the length at which `other_length` was
    found by what that is more than `largest`. Where a file does not say that length, all of it holds beyond those.

    Args:
        spec: states the measured rest lengths.
        error: of its law.
        rest: length at rest [m].
    """
    measured, beyond = measured_rest_lengths(spec), _beyond_measured(spec, rest)
    if not measured or rest is None:
        return 0.0
    if error is None or error.other_length is None:
        return None if beyond else 0.0
    more, at = max(error.other_length - (error.largest or 0.0), 0.0), error.other_length_at
    # one that was left out in turn is a measured one of the law of all
    others = [] if at is None else [one for one in measured if abs(at / one - 1.0) > SAME_REST_LENGTH]
    if at is None or not others:
        return more if beyond else 0.0
    away, found = (min(abs(1.0 / to - 1.0 / one) for one in of) for to, of in ((rest, measured), (at, others)))
    return more * away / found


def _rest_length(spec: Specimen, law: TensionLaw) -> float | None:
    """Rest length of a muscle that was cut, of which the law knows, and else of the one in the file [m]."""
    rest = getattr(law, "rest_length", None)
    if rest is not None:
        return float(rest)
    return spec.property_si("rest_length", "m") if "rest_length" in spec.properties else None


def _beyond_measured(spec: Specimen, rest: float | None) -> bool:
    measured = measured_rest_lengths(spec)
    if not measured or rest is None:
        return False
    return not (1.0 - SAME_LENGTH) * measured[0] <= rest <= (1.0 + SAME_LENGTH) * measured[-1]


def _of_other_bore(spec: Specimen, law: TensionLaw) -> bool:
    """Whether a law is of another bore than the muscles of the make, of which nothing was measured."""
    bore, stated = getattr(law, "rest_diameter", None), spec.laws.get(law_name(law), {}).get("rest_diameter")
    # what a fit of a table wrote has the bore with its law only
    stated = spec.properties.get("rest_inner_diameter", stated)
    if bore is None or stated is None:
        return False
    return is_other_bore(float(bore), float(str(stated.si("m", field="rest_diameter"))))


def is_other_bore(bore: float, of_make: float) -> bool:
    """Whether a bore is none of those that were measured [m]."""
    return abs(bore / of_make - 1.0) > SAME_LENGTH


def interval_words(spec: Specimen, law: TensionLaw) -> str:
    """How far the tension of one muscle may be off, as a 95 % interval that the specimen states; or that it states none."""
    spread, error = make_spread(spec, law), error_of(spec, law)
    if spread is not None:
        return f"{spread}"
    if own := own_numbers(spec, law):
        return f"no interval: nothing says how far a muscle with {_own_words(own)} in place of that of {spec.id} is off"
    half = _stated_half_width(spec, law)
    if half is not None:
        return f"this muscle, as characterised, lies within {with_unit(half, 'N', 2)} (95 %)"
    said = "" if error is None else f"; {law_name(law)} was off by {error}"
    return f"no interval: nothing says how far another muscle of the make is from the law of {spec.id}{said}"


def error_of(spec: Specimen | None, law: TensionLaw | str) -> LawError | None:
    """The error that a specimen states of one of its laws; None where it states none.

    Args:
        spec: the specimen.
        law: its name; or the law of a muscle, whose rest length and own numbers the error then tells.
    """
    name = law if isinstance(law, str) else law_name(law)
    group = {} if spec is None else spec.errors.get(name, {})
    if spec is None or not group:
        return None
    numbers = {
        n: float(str(p.si(KNOWN_ERRORS[n], field=f"errors.{name}.{n}", where=spec.where))) for n, p in group.items()
    }
    notes = {key: number.note or "as its file states" for key, number in group.items()}
    source = notes.get("largest") or notes.get("rms", "")
    known: dict[str, Any] = {n: numbers.get(n) for n in KNOWN_ERRORS}
    known |= {"other_source": notes.get("other_muscle", ""), "length_source": notes.get("other_length", "")}
    error = LawError(**known, source=source, make=spec.id)
    if isinstance(law, str):
        return error
    more = growth_at(spec, error, _rest_length(spec, law))
    here = None if more is None or error.largest is None else error.largest + more
    return error._replace(at_rest_length=here, own=own_numbers(spec, law))


def own_numbers(spec: Specimen | None, law: TensionLaw) -> tuple[str, ...]:
    """Parameters of a muscle's law that are not its specimen's and change its tension; none of one that was only cut.

    Args:
        spec: of which the muscle was made.
        law: of the muscle, whoever replaced its numbers, with whatever it has learned.
    """
    law = getattr(law, "of", law)
    if spec is None or spec.kind != "mckibben" or any(is_traced(getattr(law, key)) for key in declared(law)):
        return ()
    name, known, usual = LAWS.stated_as(type(law), spec.laws), declared(law), default_parameters(type(law))
    rest = getattr(law, "rest_length", None)
    if rest is not None:
        with contextlib.suppress(InputError):  # of one length, so that another one is a number like the others
            spec, _ = at_rest_length(spec, name, {"rest_length": float(rest)})
    group, own = spec.laws.get(name, {}), []
    for key, value in values(law).items():
        stated = group[key].si(known[key].unit, field=key) if key in group else usual.get(key)
        same = stated is not None and np.allclose(value, stated, rtol=SAME_NUMBER, atol=0.0)
        if not same and (stated is None or _pulls_otherwise(law, {key: stated})):
            own.append(key)
    return tuple(own)


def _pulls_otherwise(law: TensionLaw, changes: Mapping[str, Any]) -> bool:
    """Whether the tension within the range of a law is another with some parameters changed."""
    try:
        other = law.replace(**changes)
    except InputError:
        return True
    low, high = np.array([law.length_range(), other.length_range()], float).T
    lengths = np.linspace(low.max(), high.min(), 9)[1:-1]  # at the ends the threads begin to hold
    at = [axis.ravel() for axis in np.meshgrid(lengths, np.linspace(0.0, HIGHEST_PRESSURE, 5))]
    one, two = (np.asarray(each.tension(*at)) for each in (law, other))
    return not bool(np.abs(one - two).max() <= SAME_NUMBER * np.abs(one).max())


def _own_words(names: tuple[str, ...]) -> str:
    return f"its own {', '.join(names)}"


def law_error(spec: Specimen | None, law: TensionLaw | None) -> dict[str, JsonValue] | None:
    """The error that a specimen states of one of its laws and the interval of a tension, for metadata and JSON.

    Where it states neither, ``interval`` says so; None without a muscle's specimen.
    """
    if spec is None or law is None or spec.kind not in MUSCLES:
        return None
    error, spread = error_of(spec, law), make_spread(spec, law)
    said = {} if spread is None else {"between_muscles": spread.to_dict()}
    words = interval_words(spec, law) if spread is None else f"{spread}"
    return ({} if error is None else error.to_dict()) | said | {"interval": words}


def about_laws(muscles: Mapping[str, tuple[Specimen | None, TensionLaw]]) -> dict[str, JsonValue]:
    """Errors and, where there are any, cautions of several muscles for the metadata of a recording.

    Args:
        muscles: specimen and law, by the name of the muscle.
    """
    said = dict.fromkeys(str(one) for spec, law in muscles.values() for one in law_cautions(spec, law))
    errors = {name: law_error(spec, law) for name, (spec, law) in muscles.items()}
    return {"law_error": errors} | ({"warnings": list(said)} if said else {})


def interval_remarks(errors: Mapping[str, Any]) -> list[str]:
    """A sentence for each muscle about the interval of its tension, of errors by name such as those of `about_laws`."""
    return [f"{name}: {error['interval']}." for name, error in errors.items() if error]


def law_cautions(spec: Specimen | None, law: TensionLaw | None, *, at_rest: bool = True) -> tuple[Caution, ...]:
    """Cautions about a specimen's law, whatever the length and pressure: a large error, an unmeasured rest length or braid.

    Args:
        spec: the specimen.
        law: of the muscle.
        at_rest: whether to say by how much the laws of a braid differ at its rest length; not where each point says it.
    """
    if spec is None or law is None:
        return ()
    name = law_name(law)
    error, spread = error_of(spec, law), make_spread(spec, law)
    large = error is not None and error.worst > NOTABLE
    of_make = spread is not None and max(spread.elsewhere or 0.0, spread.calibrated or 0.0) > NOTABLE
    words = [f"the tension of {spec.id} by {name} may be off by {error}"] * large + [f"{spread}"] * of_make
    if own := own_numbers(spec, law):
        stated = "" if error is None else f"; {name} was off by {error._replace(own=())} with the numbers of {spec.id}"
        words = [f"nothing says how far a muscle with {_own_words(own)} in place of that of {spec.id} is off{stated}"]
    said = Caution("; ".join(words), "law") if words else None
    braid = braid_caution(spec, name) if at_rest and not own else None
    return collect(said, _rest_length_caution(spec, law, error), braid)


def _rest_length_caution(spec: Specimen, law: TensionLaw, error: LawError | None) -> Caution | None:
    measured, rest = measured_rest_lengths(spec), _rest_length(spec, law)
    if rest is None or not _beyond_measured(spec, rest):
        return None
    ends = " to ".join(with_unit(end, "m", 3) for end in dict.fromkeys((measured[0], measured[-1])))
    said = f"a rest length of {with_unit(rest, 'm', 4)} is beyond the measured ones of {spec.id}, {ends}"
    if error is None or error.other_length is None:
        why = "the tension there is that of a like muscle, and nothing says how far it is off"
    else:
        more = _percent(growth_at(spec, error, rest) or 0.0)
        most = f"there {law_name(law)} may be off by {more} of the largest tension more than at these"
        why = f"{most}, as it was off by {error.at_other_length}"
    return Caution(f"{said}: {why}", "rest_length")


def beyond_braid_caution(law: object, length: np.ndarray, tension: np.ndarray) -> Caution | None:
    """Caution about a pull [N] at a length [m] to which no gas shortens the law's braid; None where there is none."""
    shape = braid_of(law)
    if shape is None:
        return None
    beyond = (length < (1.0 - SAME_LENGTH) * SHORTEST_SHARE * shape.thread_length) & (tension > 0.0)
    if not beyond.any():
        return None
    at = float(length[beyond].max())
    said = f"at {with_unit(at, 'm', 4)} the threads stand at {shape.degrees(at):.1f} deg"
    most = "gas shortens a braid to 54.7 deg at most"
    return Caution(f"{said}, and {most}: the law pulls where the braid cannot", "length")


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %"


def tension_range(
    spec: Specimen | None, name: str, law: TensionLaw, length: np.ndarray, pressure: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """Lowest and highest tension [N], shaped as length and pressure together; None where the file states no such ranges.

    Args:
        spec: states the ranges.
        name: of the law.
        law: as it is used.
        length: between the anchors [m].
        pressure: gauge [Pa].
    """
    if spec is None or name not in spec.laws or "rms" in spec.errors.get(name, {}):
        return None
    sure = own_numbers(spec, law)  # that a person has stated
    units = {key: q.unit for key, q in declared(law).items() if key not in sure}
    varied = varied_law(spec, name, law)
    pairs = [] if varied is None else [one for pair in varied.of_dimensions.values() for one in pair]
    ends = [{key: value for key, value in one.items() if key in units} for one in pairs]
    for key, number in spec.laws[name].items():
        if number.range is None or key not in units or (varied is not None and key not in varied.unseen):
            continue
        for end in number.range:
            value = dataclasses.replace(number, value=end).si(units[key], field=f"laws.{name}.{key}", where=spec.where)
            ends.append({key: value})
    laws = [law.replace(**changes) for changes in ends]
    if not laws:
        return None
    own = np.asarray(law.tension(length, pressure))
    changes = np.array([np.asarray(one.tension(length, pressure)) - own for one in laws])
    below, above = (np.sqrt(np.sum(np.square(np.clip(sign * changes, 0.0, None)), axis=0)) for sign in (-1.0, 1.0))
    return np.maximum(own - below, 0.0), own + above


def braid_caution(spec: Specimen, name: str) -> Caution | None:
    """What is not known of the tension of a braid at its rest length; None of a specimen that no dimensions made.

    An answer that has no length and pressure of its own, such as a run, says with it how far its tensions may be off.
    """
    if name not in spec.laws or not is_braid(spec, name):
        return None
    rest, pressure, law = spec.property_si("rest_length", "m"), usual_pressure(spec), law_from_specimen(spec, name)
    pull = float(law.tension(rest, pressure))
    ends = tension_range(spec, name, law, np.asarray(rest), np.asarray(pressure))
    assert ends is not None  # a braid has ranges
    low, high = (with_unit(float(end), "N", 3) for end in ends)
    at = f"at its rest length and {with_unit(pressure, 'Pa')} {spec.id} pulls {with_unit(pull, 'N', 3)} by {name}"
    differing = differing_caution(spec, name, pull, other_laws(spec, name, rest, pressure))
    said = "" if differing is None else f"; {differing.text}"
    return Caution(f"{at}, and {low} to {high} with what was not measured in its ranges{said}", "law")


FACTORS = [1.025**n for step in range(1, 66) for n in (step, -step)]  # of a value that are tried: from near 1 to 5


def check_geometry(law: TensionLaw, rest_length: float) -> None:
    """Refuse a muscle that cannot be: a wall that fills its braid at rest, or parameters that leave no gas in it.

    Raises:
        InputError: names the parameter, and values that would do.
    """
    shape, wall = braid_of(law), getattr(law, "wall_thickness", None)
    # where the law states a bore, the wall lies around it
    if shape is not None and wall is not None and not hasattr(law, "rest_diameter"):
        bore = shape.diameter(rest_length)
        if 2.0 * float(wall) >= bore:
            at = f"{with_unit(bore, 'm', 3)} wide at {with_unit(rest_length, 'm', 3)}"
            problem = f"must be less than {with_unit(0.5 * bore, 'm', 3)}, or it fills the braid, which is {at}"
            raise InputError(f"{law_name(law)}.wall_thickness", with_unit(float(wall), "m", 3), problem)
    error = volume_contradiction(law, rest_length)
    if error is not None:
        raise error


def volume_contradiction(law: TensionLaw, span: float) -> InputError | None:
    """Error about parameters that contradict each other, so that a law has no gas volume above zero; None where it has.

    The parameters that could be changed are named, each alone, that first which has to be changed least.

    Args:
        law: the law.
        span: at which the muscle is mounted [m].
    """
    try:
        volume = float(law.volume(span, 0.0))
    except NoVolumeError:
        return None
    if volume > 0.0:
        return None
    key, of = law_name(law), with_unit(volume, "m^3", 3)
    said = f"the muscle's volume of gas would be {of} at a span of {with_unit(span, 'm', 4)}"
    units = {n: q.unit for n, q in declared(type(law)).items()}
    values = {n: float(getattr(law, n)) for n in units}
    remedies: dict[str, str] = {}
    for factor in FACTORS:
        for name, value in values.items():
            if name not in remedies and _has_volume(law, name, factor * value, span):
                possible, stated = (with_unit(one, units[name], 3) for one in (factor * value, value))
                remedies[name] = f"{name} {possible} (not {stated})"
    field = f"{key}.{next(iter(remedies))}" if remedies else key
    what = f"{said}: the parameters of {key} contradict each other"
    sentence = f"{what}. What would do: {' or '.join(remedies.values())}" if remedies else what
    return InputError(field, None, f"contradicts the other parameters of {key}", sentence=sentence)


def _has_volume(law: TensionLaw, name: str, value: float, span: float) -> bool:
    with contextlib.suppress(InputError):
        return float(law.replace(**{name: value}).volume(span, 0.0)) > 0.0
    return False
