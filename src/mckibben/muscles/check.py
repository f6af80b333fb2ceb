"""Checks that every law and every friction must pass, whether of this package or of a user.

A law has one potential, does not push, has finite and right derivatives, and makes no work in closed cycles; friction makes
no work on any path. `law_findings` and `friction_findings` return what is wrong, each in a sentence with a number and the
place where it happens. The tests of the laws of this package use the same functions.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from .._jax import Tree, is_traced, jax, jit, jnp
from ..components import Hysteresis, Scalar
from ..components.programs import evaluated
from ..errors import InputError
from ..quantities import declared, is_unit, with_unit
from .hysteresis import FrictionLimit
from .law import TensionLaw, law_name

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

T = TypeVar("T", bound="DataclassInstance")

POINTS = 4096  # evaluations by XLA are padded to this many points, so that each law is compiled for one shape
AMBIENT = 101325.0  # [Pa]
# Both sides are the same mixed derivative in float64: 3e-14 for a law whose inner minimum is iterated, 1e-15 for others.
POTENTIAL = 1e-10
CLOSURE = 1e-8  # of the work exchanged in a closed cycle; the quadrature itself closes to 1e-11
BESIDE = 1.0  # gauge pressure beside a place where a muscle is just about to pull [Pa]
SLOPE = 1e-3  # of the largest slope, by which a derivative may differ from a converged difference
CYCLES = 4
USUAL_LENGTH = 0.2  # of a law whose parameters nobody stated [m]


class LawFinding(NamedTuple):
    """Something that is wrong: its kind, the sentence, its size, and where it happens."""

    kind: str
    sentence: str
    value: float = math.nan
    length: float | None = None  # [m]
    pressure: float | None = None  # gauge [Pa]


# ---- a law at points


def thread_length(law: TensionLaw) -> float:
    """Length that others are relative to: of the thread, else at rest, else the longest that the law is made for [m]."""
    for name in ("thread_length", "rest_length"):
        if hasattr(law, name):
            return float(getattr(law, name))
    return float(law.length_range()[1])


def face(law: TensionLaw, span: Scalar, pressure: Scalar) -> tuple[Scalar, Scalar]:
    """Tension [N] and gas volume [m^3] of the unilateral muscle; the volume up to a constant where a law has none."""
    if law.has_volume():
        return law.tension(span, pressure), law.volume(span, pressure)
    tension = law.tension(span, pressure)
    return tension, law.braid_volume(jnp.where(tension > 0.0, span, law.free_length(pressure)), pressure)


def pressures(law: TensionLaw, count: int = 64, *, lowest: float = -0.95e5, highest: float = 1e6) -> np.ndarray:
    """Gauge pressures from lowest to highest [Pa], with zero, the threshold, its two ends and some places in between."""
    middle, width = float(getattr(law, "threshold_pressure", 0.0)), float(getattr(law, "threshold_width", 1e4))
    special = np.concatenate([[0.0], middle + width * np.array([-0.5, -0.35, -0.2, 0.0, 0.2, 0.35, 0.5])])
    return np.sort(np.concatenate([special, np.linspace(lowest, highest, count - special.size)]))


def _with_slopes(law: TensionLaw, span: Scalar, pressure: Scalar) -> tuple[Scalar, ...]:
    at, ones, zeros = (span, pressure), jnp.ones_like(span), jnp.zeros_like(span)
    values, by_span = jax.jvp(lambda x, p: face(law, x, p), at, (ones, zeros))
    _, by_pressure = jax.jvp(lambda x, p: face(law, x, p), at, (zeros, ones))
    return *values, *by_span, *by_pressure


_COMPILED = jit(_with_slopes)


@evaluated
def _at_points(law: TensionLaw, span: Scalar, pressure: Scalar) -> tuple[Scalar, ...]:
    """The same by a kernel; of a law of which there is none by XLA, for (n,) points."""
    if is_traced(span):
        return _with_slopes(law, span, pressure)
    return _by_xla(law, np.asarray(span), np.asarray(pressure))


def _by_xla(law: TensionLaw, span: np.ndarray, pressure: np.ndarray) -> tuple[np.ndarray, ...]:
    parts = []
    for start in range(0, span.size, POINTS):
        x, p = span[start : start + POINTS], pressure[start : start + POINTS]
        room = POINTS - x.size
        values = _COMPILED(law, np.pad(x, (0, room), mode="edge"), np.pad(p, (0, room), mode="edge"))
        parts.append(np.stack(values)[:, : x.size])
    return tuple(np.concatenate(parts, axis=1))


def evaluate(law: TensionLaw, span: Scalar, pressure: Scalar) -> dict[str, np.ndarray]:
    """F [N], V [m^3] and their derivatives to span (F_L, V_L) and pressure (F_P, V_P), at points of any number."""
    span, pressure = np.broadcast_arrays(np.asarray(span, float), np.asarray(pressure, float))
    points = span.ravel(), pressure.ravel()
    try:
        values = _at_points(law, *points)
    except jax.errors.ConcretizationTypeError:  # a branch on a value, which arrays name more clearly than a kernel can
        values = _by_xla(law, *points)
    rows = (np.asarray(row).reshape(span.shape) for row in values)
    return dict(zip(("F", "V", "F_L", "V_L", "F_P", "V_P"), rows, strict=True))


# ---- closed cycles

Face = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


def lobatto(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes in [0, 1] and weights of a Gauss-Lobatto rule, which has a node at both ends of a piece."""
    top = np.polynomial.legendre.Legendre.basis(count - 1)
    nodes = np.concatenate([[-1.0], np.sort(top.deriv().roots().real), [1.0]])
    return 0.5 + 0.5 * nodes, 1.0 / (count * (count - 1) * top(nodes) ** 2)


NODES, WEIGHTS = lobatto(9)


def unilateral(law: TensionLaw) -> Face:
    """Tension [N] and volume [m^3] of a law as a function of span [m] and pressure [Pa]."""

    def values(span: np.ndarray, pressure: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        at = evaluate(law, span, pressure)
        return at["F"], at["V"]

    return values


def works(face: Face, corners: np.ndarray, levels: np.ndarray) -> tuple[float, float, float, float]:
    """Integrals around a polygon: of F dL, V dP', |F dL| and |V - mean V| |dP'| [J].

    They are taken by Gauss-Lobatto on pieces of each edge, which are halved wherever two halves disagree with the whole;
    that closes in on every kink by itself.

    Args:
        face: tension and volume.
        corners: length [m] and gauge pressure [Pa], (n, 2).
        levels: pressures at which the edges are cut from the start [Pa].
    """
    panels = np.concatenate([_cut(a, b, levels) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)])
    middle = None

    def integrate(panels: np.ndarray) -> np.ndarray:
        nonlocal middle
        start, step = panels[:, 0], panels[:, 1] - panels[:, 0]
        at = start[:, None] + step[:, None] * NODES[None, :, None]
        F, V = face(at[..., 0], at[..., 1])
        # A constant volume does no work around a cycle; without it the rounding errors are those of what changes.
        middle = float(np.mean(V)) if middle is None else middle
        return np.stack([F @ WEIGHTS * step[:, 0], (V - middle) @ WEIGHTS * step[:, 1]], axis=1)

    whole = integrate(panels)
    size = np.abs(whole).sum()
    net, exchanged = np.zeros(2), np.zeros(2)
    for halving in range(50):
        centre = panels.mean(axis=1)
        halves = np.stack([panels[:, 0], centre], axis=1), np.stack([centre, panels[:, 1]], axis=1)
        left, right = np.split(integrate(np.concatenate(halves)), 2)
        # Some hundred pieces at 1e-13 of the work are 1e-11 of it; 50 halvings of an edge leave nothing of a piece.
        done = (np.abs(left + right - whole) <= 1e-13 * size).all(axis=1) | (halving == 49)
        net += (left + right)[done].sum(axis=0)
        exchanged += np.abs((left + right)[done]).sum(axis=0)
        panels = np.concatenate([half[~done] for half in halves])
        whole = np.concatenate([left[~done], right[~done]])
        if done.all():
            break
    return float(net[0]), float(net[1]), float(exchanged[0]), float(exchanged[1])


def _cut(a: np.ndarray, b: np.ndarray, levels: np.ndarray) -> np.ndarray:
    crossing = (levels - a[1]) / (b[1] - a[1]) if a[1] != b[1] else levels[:0]
    t = np.unique(np.concatenate([np.linspace(0.0, 1.0, 9), crossing[(crossing > 0.0) & (crossing < 1.0)]]))
    at = a + (b - a) * t[:, None]
    return np.stack([at[:-1], at[1:]], axis=1)


def threshold_levels(law: TensionLaw) -> np.ndarray:
    """Pressures at which the rounding of a threshold begins, ends and bends [Pa]."""
    middle, width = float(getattr(law, "threshold_pressure", 0.0)), float(getattr(law, "threshold_width", 1e4))
    return np.concatenate([[0.0], middle + width * np.array([-0.5, -0.25, 0.0, 0.25, 0.5])])


def polygon(law: TensionLaw, seed: int, longest: float = 0.99, *, vacuum: float = -0.9e5) -> np.ndarray:
    """3 to 6 corners (L, P') between 0.6 and `longest` of the upper working length; the first is short and hardly filled.

    Args:
        law: any.
        seed: of the corners.
        longest: largest length over the upper working length.
        vacuum: lowest gauge pressure [Pa].
    """
    rng = np.random.default_rng(seed)
    count, upper = int(rng.integers(3, 7)), float(law.length_range()[1])
    corners = np.stack([rng.uniform(0.6, longest, count) * upper, rng.uniform(vacuum, 8e5, count)], axis=1)
    corners[0] = 0.6 * upper, rng.uniform(0.5 * vacuum, 1e5)
    corners[1] = longest * upper, rng.uniform(4e5, 8e5)
    return corners


def snaps(law: TensionLaw, *, lowest: float = -0.9e5) -> tuple[float, float] | None:
    """Length [m] and pressure [Pa] where the tension falls to zero while the muscle is lengthened; None where nowhere.

    There an unloaded braid has two places to be, and would snap from one to the other.
    """
    upper = float(law.length_range()[1])
    length, pressure = np.linspace(0.6, 0.99, 64) * upper, pressures(law, lowest=lowest, highest=8e5)
    taut = evaluate(law, length[:, None], pressure)["F"] > 0.0
    falls = np.argwhere(taut[:-1] & ~taut[1:])
    return None if not falls.size else (float(length[falls[0][0] + 1]), float(pressure[falls[0][1]]))


# ---- findings of a law


def law_findings(law: TensionLaw, *, lowest: float = 0.0) -> list[LawFinding]:
    """What is wrong with a law of given parameters; empty where nothing is.

    Args:
        law: any, with its parameters.
        lowest: lowest gauge pressure at which cycles and volume are judged [Pa]; laws of a fit mean nothing under vacuum.
    """
    findings = declaration_findings(type(law))
    try:
        low, high = (float(np.asarray(end)) for end in law.length_range())
        if not 0.0 < low < high < math.inf:
            said = "length_range must be two lengths, the shorter first and above zero"
            return [*findings, LawFinding("range", _of(law, f"{said}: it is {low:.4g} m to {high:.4g} m"), low)]
        length = np.concatenate([np.linspace(0.2, 1.5, 56) * thread_length(law), np.linspace(low, high, 8)])
        pressure = pressures(law)
        at = evaluate(law, length[:, None], pressure[None, :])
    except Exception as error:  # whatever the code of a user raises
        return [*findings, LawFinding("error", _of(law, f"cannot be evaluated on arrays: {_first_line(error)}"))]
    wrong = list(_not_finite(law, at, length, pressure))
    if wrong:
        return [*findings, *wrong]
    inside = (length >= low) & (length <= high)
    i, j = np.unravel_index(int(np.argmin(at["F"])), at["F"].shape)
    least, where = float(at["F"][i, j]), (float(length[i]), float(pressure[j]))
    if least < 0.0:
        findings.append(LawFinding("push", _of(law, f"pushes with {-least:.4g} N, {_place(*where)}"), least, *where))
    findings += _two_potentials(law, at, length, pressure)
    findings += _wrong_slopes(law, length[inside], pressure)
    findings += _volumes(law, at, length, pressure, lowest)
    snap = snaps(law, lowest=lowest)
    if snap is not None:
        said = "falls slack while it is lengthened, so that an unloaded braid would snap to another length"
        return [*findings, LawFinding("snap", _of(law, f"{said}, {_place(*snap)}"), math.nan, *snap)]
    return findings + _cycles(law, lowest)


def _not_finite(
    law: TensionLaw, at: Mapping[str, np.ndarray], length: np.ndarray, pressure: np.ndarray
) -> Iterator[LawFinding]:
    names = {"F": "tension", "V": "volume", "F_L": "dF/dL", "V_L": "dV/dL", "F_P": "dF/dP'", "V_P": "dV/dP'"}
    for key, words in names.items():
        bad = np.argwhere(~np.isfinite(at[key]))
        if bad.size:
            where = float(length[bad[0][0]]), float(pressure[bad[0][1]])
            said = f"{words} is {at[key][tuple(bad[0])]}, {_place(*where)}"
            said += f", and at {len(bad) - 1} more of {at[key].size} places" if len(bad) > 1 else ""
            yield LawFinding("finite", _of(law, said), float(len(bad)), *where)
            return


def _mixed_difference(at: Mapping[str, np.ndarray]) -> np.ndarray:
    """Difference of the two mixed derivatives of the potential, relative to the largest at the same length.

    It is relative to that length, since dF/dP' of an exponential law grows by nine orders.
    """
    largest = np.maximum(np.abs(at["F_P"]), np.abs(at["V_L"])).max(axis=1, keepdims=True)
    difference: np.ndarray = np.abs(at["F_P"] + at["V_L"]) / np.maximum(largest, 1e-300)
    return difference


def _two_potentials(
    law: TensionLaw, at: Mapping[str, np.ndarray], length: np.ndarray, pressure: np.ndarray
) -> list[LawFinding]:
    wrong = _mixed_difference(at)
    if wrong[at["F"] <= 0.0].max(initial=0.0) > POTENTIAL:
        # Where the muscle is just about to pull, as at 0 bar without walls, each derivative may be that of another side.
        beside = _mixed_difference(evaluate(law, length[:, None], pressure[None, :] + BESIDE))
        wrong = np.where(at["F"] <= 0.0, np.minimum(wrong, beside), wrong)
    i, j = np.unravel_index(int(np.argmax(wrong)), wrong.shape)
    if wrong[i, j] <= POTENTIAL:
        return []
    where = float(length[i]), float(pressure[j])
    by_force, by_volume = at["F_P"][i, j], -at["V_L"][i, j]
    said = "its tension is not the derivative of its potential"
    said += f": dF/dP' is {by_force:.4g} m^2 and -dV/dL is {by_volume:.4g} m^2"
    return [LawFinding("potential", _of(law, f"{said}, {_place(*where)}"), float(wrong[i, j]), *where)]


def _wrong_slopes(law: TensionLaw, length: np.ndarray, pressure: np.ndarray) -> list[LawFinding]:
    """Derivatives that differ from differences which have converged; kinks, where they do not, are passed over."""
    length, pressure = length[:: max(len(length) // 12, 1)], pressure[::5]
    span, at = (a.ravel() for a in np.meshgrid(length, pressure, indexing="ij"))
    for key, words, unit, steps in (
        ("F_L", "dF/dL", "N/m", (1e-5 * span, 0.0 * at)),
        ("F_P", "dF/dP'", "m^2", (0.0 * span, 50.0 + 0.0 * at)),
    ):
        exact = evaluate(law, span, at)[key]
        apart = []
        for share in (1.0, 0.5):
            dl, dp = share * steps[0], share * steps[1]
            ends = evaluate(law, np.stack([span + dl, span - dl]), np.stack([at + dp, at - dp]))["F"]
            apart.append((ends[0] - ends[1]) / (2.0 * (dl + dp)))
        scale = np.abs(np.concatenate([exact, apart[0]])).max()
        wrong = np.where(np.abs(apart[0] - apart[1]) < 0.1 * SLOPE * scale, np.abs(exact - apart[1]), 0.0)
        k = int(np.argmax(wrong))
        if wrong[k] > SLOPE * scale:
            where = float(span[k]), float(at[k])
            said = f"{words} is {exact[k]:.5g} {unit} by its derivative and {apart[1][k]:.5g} {unit} by differences"
            return [LawFinding("derivative", _of(law, f"{said}, {_place(*where)}"), float(wrong[k] / scale), *where)]
    return []


def _volumes(
    law: TensionLaw, at: Mapping[str, np.ndarray], length: np.ndarray, pressure: np.ndarray, lowest: float
) -> list[LawFinding]:
    low, high = (float(end) for end in law.length_range())
    rows = (length >= max(0.75 * high, low)) & (length <= high)
    columns = pressure >= lowest
    volume = 1e6 * at["V"][rows][:, columns]
    capacitance = 1e6 * (at["V"][rows][:, columns] + (pressure[columns] + AMBIENT) * at["V_P"][rows][:, columns])
    findings = []
    for kind, words, value in (
        ("volume", "has a gas volume of {:.4g} cm^3", volume),
        ("capacitance", "loses gas while it is filled: d(P V)/dP is {:.4g} cm^3", capacitance),
    ):
        if law.has_volume() and value.size and value.min() <= 0.0:
            i, j = np.unravel_index(int(np.argmin(value)), value.shape)
            where = float(length[rows][i]), float(pressure[columns][j])
            said = f"{words.format(value[i, j])}, {_place(*where)}"
            findings.append(LawFinding(kind, _of(law, said), float(value[i, j]), *where))
    return findings


def _cycles(law: TensionLaw, lowest: float) -> list[LawFinding]:
    worst: LawFinding | None = None
    for seed in range(CYCLES):
        corners = polygon(law, seed, vacuum=min(lowest, 0.0))
        load, gas, exchanged, _ = works(unilateral(law), corners, threshold_levels(law))
        share = abs(load - gas) / max(exchanged, 1e-12)
        if share > CLOSURE and (worst is None or share > worst.value):
            # Round the polygon one way the law gives work, round it the other way it takes as much.
            said = f"makes {abs(load - gas):.3g} J in a closed cycle that exchanges {exchanged:.3g} J"
            where = float(corners[1][0]), float(corners[1][1])
            worst = LawFinding("energy", _of(law, f"{said}, {_place(*where, 'through')}"), share, *where)
    return [] if worst is None else [worst]


def declaration_findings(kind: type) -> list[LawFinding]:
    """What is wrong with how a law or a friction declares its parameters: units, bounds, what a fit varies."""
    name, findings = law_name(kind), []
    known = declared(kind)
    for f in dataclasses.fields(kind):
        if not f.metadata.get("static") and f.name not in known and "FrictionLimit" not in str(f.type):
            said = "has neither unit nor bounds; declare it as mckibben.quantity(unit, bounds, meaning)"
            findings.append(LawFinding("declaration", f"{name}: {f.name} {said}"))
    for key, q in known.items():
        low, high = q.bounds
        if not is_unit(q.unit):
            findings.append(LawFinding("declaration", f"{name}: {q.unit!r} of {key} is no unit"))
        if not low < high or math.isinf(low) or math.isinf(high):
            said = f"{name}: the bounds of {key} must be two numbers, the smaller first: they are {low:g} to {high:g}"
            findings.append(LawFinding("declaration", said, low))
        elif not low <= q.typical[0] <= q.typical[1] <= high:
            said = f"{name}: the usual range of {key}, {q.typical[0]:g} to {q.typical[1]:g}, is not within its bounds"
            findings.append(LawFinding("declaration", said, q.typical[0]))
        if not q.doc.strip():
            findings.append(LawFinding("declaration", f"{name}: {key} has no meaning stated"))
    for key in getattr(kind, "fitted", ()):
        if key not in known:
            findings.append(LawFinding("declaration", f"{name}: fitted names {key!r}, which is no parameter"))
    return findings


def sample(kind: type[T], parameters: Mapping[str, float] | None = None) -> T:
    """A law or friction with usual parameters where none are given: defaults, 20 cm for lengths, else a typical value.

    Args:
        kind: a class with declared parameters.
        parameters: parameters by name [SI].

    Raises:
        InputError: a parameter is unknown or out of its bounds.
    """
    known = declared(kind)
    values: dict[str, Any] = dict(parameters or {})
    for name in values:
        if name not in known:
            raise InputError(name, None, f"{law_name(kind)} has", known=known)
    for f in dataclasses.fields(kind):
        if f.name in values or f.default is not dataclasses.MISSING or f.default_factory is not dataclasses.MISSING:
            continue
        if f.name in known:
            low, high = known[f.name].bounds
            least, most = known[f.name].typical
            if known[f.name].unit == "m" and low <= USUAL_LENGTH <= high and "length" in f.name:
                values[f.name] = USUAL_LENGTH
            else:  # of a range of decades the geometric mean
                wide = least > 0.0 and most > 20.0 * least
                values[f.name] = math.sqrt(least * most) if wide else 0.5 * (least + most)
        elif "FrictionLimit" in str(f.type) or f.name == "limit":
            values[f.name] = FrictionLimit(constant=0.5, per_pressure=4e-6)
    return kind(**values)


# ---- friction


class FrictionPath(NamedTuple):
    """What happens along a path of n steps, each (n,): forces before and after [N], work, loss and stored energy [J]."""

    before: Any
    after: Any
    work: Any
    dissipated: Any
    stored: Any


@jit
def _follow(friction: Hysteresis, displacements: Any, pressures: Any, step: Any) -> Any:
    def one(state: Tree, piece: Any) -> Any:
        dx, p0, p1 = piece
        out = friction.advance(state, dx, start_pressure=p0, end_pressure=p1, duration=step)
        forces = friction.force(state, dx / step, p0), friction.force(out.state, dx / step, p1)
        return out.state, (*forces, out.work, out.dissipated, friction.stored_energy(out.state))

    return jax.lax.scan(one, friction.initial(), (displacements, pressures[:-1], pressures[1:]))[1]


def follow(
    friction: Hysteresis,
    displacements: Scalar | Sequence[float],
    pressures: Scalar | Sequence[float],
    step: float = 1e-3,
) -> FrictionPath:
    """Move a friction along a path.

    Args:
        friction: from its initial state.
        displacements: of each step (n,) [m].
        pressures: gauge, before each step and after the last (n + 1,) [Pa].
        step: duration of a step [s].
    """
    return FrictionPath(*_follow(friction, displacements, pressures, step))


def friction_findings(friction: Hysteresis) -> list[LawFinding]:
    """What is wrong with a friction: energy that it makes, a balance that does not close, a force beyond its limit."""
    findings = declaration_findings(type(friction))
    rng = np.random.default_rng(0)
    moves = np.repeat(rng.uniform(-1.0, 1.0, 12), 64) * 1e-4
    marks = np.interp(np.arange(moves.size + 1), np.arange(13) * 64, rng.uniform(0.0, 8e5, 13))
    try:
        path = FrictionPath(*map(np.asarray, follow(friction, moves, marks)))
        largest = np.asarray(friction.largest_force(marks[1:]))
    except Exception as error:  # whatever the code of a user raises
        return [*findings, LawFinding("error", _of(friction, f"cannot be advanced: {_first_line(error)}"))]
    if not all(np.isfinite(values).all() for values in path):
        return [*findings, LawFinding("finite", _of(friction, "its force or energy is not finite along a path"))]
    put_in = np.cumsum(0.5 * (path.before + path.after) * moves)
    span = np.cumsum(moves)
    exchanged = float(np.sum(np.abs(path.work))) + 1e-15
    unbalanced = np.abs(np.cumsum(path.work - path.dissipated) - path.stored)
    # The trapezoidal rule over steps of a hundredth of a travel leaves 1e-3 of a curved force; the rest is rounding.
    for kind, words, missing, allowed in (
        ("passivity", "gives back {:.3g} J more than was put in", path.stored - put_in, 1e-3 * exchanged),
        ("passivity", "takes {:.3g} J from heat in one step", -path.dissipated, 1e-12 * exchanged),
        ("balance", "loses {:.3g} J between work, heat and stored energy", unbalanced, 1e-10 * exchanged),
    ):
        k = int(np.argmax(missing))
        if missing[k] > allowed:
            where = float(span[k]), float(marks[k + 1])
            said = f"{words.format(missing[k])}, displaced by {1e3 * where[0]:.3g} mm at {with_unit(where[1], 'Pa')}"
            findings.append(LawFinding(kind, _of(friction, said), float(missing[k]), *where))
            break
    beyond = np.abs(path.after) - largest
    k = int(np.argmax(beyond))
    if beyond[k] > 1e-9 * max(float(largest.max()), 1e-12):
        where = float(span[k]), float(marks[k + 1])
        said = f"its force of {abs(path.after[k]):.4g} N is beyond its largest force of {largest[k]:.4g} N"
        said = _of(friction, f"{said}, at {with_unit(where[1], 'Pa')}")
        findings.append(LawFinding("limit", said, float(beyond[k]), *where))
    return findings


def _of(owner: Any, said: str) -> str:
    return f"{law_name(owner)}: {said}"


def _place(length: float, pressure: float, word: str = "at") -> str:
    return f"{word} {with_unit(length, 'm')} and {with_unit(pressure, 'Pa')}"


def _first_line(error: Exception) -> str:
    lines = str(error).strip().splitlines()
    return f"{type(error).__name__}: {lines[0][:150]}" if lines else type(error).__name__
