"""Smallest braid for given requirements: angle, thread length, turns, diameter and rest length.

For a braid angle and a contraction the stroke fixes the thread length, and since every force of a braid's law goes with the
square of its diameter, the wished force fixes the diameter:

    b = stroke/(eps cos theta),   D0^2 = F/(f(short) - (error + friction) f(long)),   f the law's force over D0^2

What is left is a search over two numbers, on a grid that is refined around its best point. More force, or less space, only
takes points away or makes them larger, so that it never gives a smaller muscle.
"""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..._jax import jit, jnp
from ...components.gas import AIR
from ...errors import InputError
from ...muscles import braid
from .braid_law import BRAID_LAWS, INFERRED, INFERRED_IN, LawError, braid_law, error_of_braid, usual
from .candidate import Candidate
from .requirements import ALLOWED, Requirements, Shortfall
from .spread import ends_of_braid

# At the long end: below 19.5 degrees the law with wall loses its stiffness, and the nylon muscle works from 20.3 on.
ANGLES = (np.deg2rad(20.5), np.deg2rad(45.0))
CONTRACTIONS = (0.01, 0.42)
STEEPEST = float(np.arccos(3.0**-0.5))  # at the short end, where the ideal braid pulls no more
LEAST_ZERO = 0.25  # extrapolated length of no force over the thread length [1]
GRID, ZOOMS = 64, 4
STEPS = 12  # in which a part of a wish is taken to where it is easiest
UNIT = 0.1  # diameter at which a law is asked [m]; what it says is scaled
OBJECTIVES = {"mass": "lightest", "air": "least air", "overall": "shortest"}


class Shapes(NamedTuple):
    """Braids of unit thread length, any shape: angle [rad], contraction [1], and forces over D0^2 [N/m^2].

    The forces are the tension at the long end, and what the gas adds at the short one.
    """

    angle: np.ndarray
    contraction: np.ndarray
    long_force: np.ndarray
    short_force: np.ndarray
    volume: np.ndarray  # at the short end over b D0^2 [1]
    sound: np.ndarray  # bool: taut, stiff and within the law's range


class Sizes(NamedTuple):
    """Sizes of braids: diameter at 90 degrees, thread, contracted diameter, overall length [m], mass and air [kg]."""

    diameter: np.ndarray
    thread: np.ndarray
    contracted: np.ndarray
    overall: np.ndarray
    mass: np.ndarray
    air: np.ndarray
    possible: np.ndarray  # bool: slender enough, and strong at all


def design(
    wish: Requirements, *, law: str = BRAID_LAWS[0], objective: str = "mass", fitting: bool = True
) -> tuple[Candidate | None, tuple[Shortfall, ...]]:
    """Find the smallest braid, or the shortfalls.

    Args:
        wish: the requirements.
        law: law of `BRAID_LAWS`.
        objective: objective of `OBJECTIVES`, what is to be least.
        fitting: look for what stands in the way where nothing does it.

    Returns:
        The braid and nothing, or None and the parts of the wish that stand in the way, the nearest first.

    Raises:
        InputError: the law or the objective is unknown.
    """
    if law not in BRAID_LAWS:
        raise InputError("law", law, known=BRAID_LAWS)
    if objective not in OBJECTIVES:
        raise InputError("objective", objective, known=OBJECTIVES)
    angles, contractions = np.linspace(*ANGLES, GRID), np.linspace(*CONTRACTIONS, GRID)
    best: tuple[float, float] | None = None
    error = error_of_braid(law, wish.pressure)
    for _ in range(ZOOMS + 1):
        shapes = shapes_of(law, wish.pressure, angles, contractions)
        sizes = sizes_of(shapes, wish, error)
        cost = np.where(_fits(sizes, wish), getattr(sizes, objective), np.inf)
        if not np.isfinite(cost).any():
            return None, _misses(wish, law, error) if fitting else ()
        i, j = np.unravel_index(int(np.argmin(cost)), cost.shape)
        best = float(angles[i]), float(contractions[j])
        angles, contractions = (_around(a, k) for a, k in ((angles, i), (contractions, j)))
    assert best is not None
    shapes = shapes_of(law, wish.pressure, np.full(GRID, best[0]), np.full(GRID, best[1]))
    return _built(wish, law, error, shapes, sizes_of(shapes, wish, error), objective), ()


def _around(grid: np.ndarray, at: Any) -> np.ndarray:
    """Finer grid around a point of a grid, including the point itself."""
    low, high = grid[max(at - 1, 0)], grid[min(at + 1, len(grid) - 1)]
    fine = np.linspace(low, high, GRID - 1)
    return np.sort(np.append(fine, grid[at]))


def shapes_of(law: str, pressure: float, angles: np.ndarray, contractions: np.ndarray) -> Shapes:
    """Evaluate a law at all angles and contractions, (angles, contractions)."""
    angle, contraction = np.meshgrid(angles, contractions, indexing="ij")
    long_, short = np.cos(angle), np.cos(angle) * (1.0 - contraction)
    asked = (np.asarray(x) for x in _asked(law, long_, short, pressure))
    pull, middle, end, long_added, added, volume, stiff = asked
    sound = (added > 0.0) & (stiff > 0.0) & (pull > middle) & (middle > end) & (short > np.cos(STEEPEST))
    # Where the line through what the gas adds would pass zero: a braid is slack at 0.58 of its threads, a flat one never.
    falls = long_added - added
    sound &= (falls > 0.0) & (short - added * (long_ - short) / np.where(falls > 0.0, falls, np.inf) > LEAST_ZERO)
    over = UNIT**2
    return Shapes(angle, contraction, pull / over, added / over, volume / over, sound)


def _ask(law: str, longest: Any, shortest: Any, pressure: Any) -> tuple[Any, ...]:
    made = braid_law(law, thread_length=1.0, diameter=UNIT, longest=longest, shortest=shortest)
    middle = 0.5 * (longest + shortest)
    pull, half, end = (made.braid_tension(x, pressure) for x in (longest, middle, shortest))
    # What the gas adds, as a candidate is judged.
    added = [f - jnp.maximum(made.braid_tension(x, 0.0), 0.0) for f, x in ((pull, longest), (end, shortest))]
    return (
        pull,
        half,
        end,
        *added,
        made.braid_volume(shortest, pressure),
        made.braid_stiffness(0.999 * longest, pressure),
    )


_asked = jit(_ask, static_argnums=0)


def sizes_of(shapes: Shapes, wish: Requirements, error: LawError) -> Sizes:
    """Sizes of the braids for force and stroke, regardless of the space."""
    strength = _strength(shapes, error)
    possible = shapes.sound & (strength > 0.0)
    diameter = np.sqrt(np.where(possible, wish.force / np.where(possible, strength, 1.0), np.nan))
    return _sized(shapes, wish, diameter, possible)


def _strength(shapes: Shapes, error: LawError) -> np.ndarray:
    """Guaranteed force at the end of the stroke over D0^2 [N/m^2]."""
    return shapes.short_force - (error.share + usual("friction_share")) * shapes.long_force


def _sized(shapes: Shapes, wish: Requirements, diameter: np.ndarray, possible: np.ndarray) -> Sizes:
    thread = wish.stroke / (shapes.contraction * np.cos(shapes.angle))
    longest = thread * np.cos(shapes.angle)
    shortest = longest - wish.stroke
    contracted = diameter * np.sqrt(1.0 - (shortest / thread) ** 2)
    fitting = usual("fitting_share") * contracted
    wall = usual("wall_share") * diameter
    sheet = np.pi * (diameter * np.sin(shapes.angle) - wall) * wall * longest * usual("wall_density")
    ends = 2.0 * 0.25 * np.pi * contracted**2 * fitting * usual("fitting_density")
    volume = shapes.volume * thread * diameter**2
    room, warm = float(wish.environment.pressure_abs), float(wish.environment.temperature)
    air = np.asarray(AIR.mass(wish.pressure + room, volume, warm))
    possible = possible & (shortest >= usual("slenderness") * contracted)
    return Sizes(diameter, thread, contracted, longest + 2.0 * fitting, sheet + ends, air, possible)


def _fits(sizes: Sizes, wish: Requirements, *, but: str = "") -> np.ndarray:
    fits = sizes.possible
    if wish.length is not None and but != "length":
        fits = fits & (sizes.overall <= wish.length)
    if wish.diameter is not None and but != "diameter":
        fits = fits & (sizes.contracted <= wish.diameter)
    return fits


def _built(wish: Requirements, law: str, error: LawError, shapes: Shapes, sizes: Sizes, objective: str) -> Candidate:
    one: dict[str, float] = {n: float(v[0, 0]) for n, v in {**shapes._asdict(), **sizes._asdict()}.items()}
    b, d0, angle = one["thread"], one["diameter"], one["angle"]
    longest = b * np.cos(angle)
    built = functools.partial(
        braid_law, law, thread_length=b, diameter=d0, longest=longest, shortest=longest - wish.stroke
    )
    made = built()
    pull = float(made.tension(longest, wish.pressure))
    ranges = {name: INFERRED[name].range for name in INFERRED_IN[law]}
    low, high = INFERRED["friction_share"].range
    turns = b / (np.pi * d0)
    rest = usual("rest_share") * longest
    return Candidate(
        id=f"braid-{objective}",
        title=f"{OBJECTIVES[objective]} braid",
        kind="braid",
        law=made,
        law_name=law,
        error=error,
        longest=longest,
        friction=usual("friction_share") * pull,
        overall_length=one["overall"],
        diameter=one["contracted"],
        mass=one["mass"],
        dimensions={
            "braid_angle": angle,
            "end_angle": float(np.arccos((longest - wish.stroke) / b)),
            "thread_length": b,
            "turns": turns,
            "diameter_90": d0,
            "rest_length": float(rest),
            "rest_diameter": float(braid.diameter(rest, thread_length=b, turns=turns)),
            "longest_length": longest,
            "wall_thickness": usual("wall_share") * d0,
            "contraction": one["contraction"],
        },
        inferred=("wall_share", "threshold_pressure", "passive_pressure", "friction_share", "fitting_share", "mass"),
        sources=("chou1996",),
        law_ends=functools.partial(ends_of_braid, built, ranges),
        friction_range=(low * pull, high * pull),
    )


# ---- what stands in the way


def _misses(wish: Requirements, law: str, error: LawError) -> tuple[Shortfall, ...]:
    """For each requirement, the part that could be met with all others as required; the nearest first."""
    angles, contractions = np.linspace(*ANGLES, GRID), np.linspace(*CONTRACTIONS, GRID)
    shapes = shapes_of(law, wish.pressure, angles, contractions)
    shortfalls = [
        Shortfall("force", wish.force, _most_force(shapes, wish, error)),
        Shortfall("stroke", wish.stroke, _edge(wish, law, "stroke", 1e-2)),
        Shortfall("pressure", wish.pressure, _edge(wish, law, "pressure", ALLOWED["pressure"][2] / wish.pressure)),
    ]
    sizes = sizes_of(shapes, wish, error)
    for part, has in (("length", sizes.overall), ("diameter", sizes.contracted)):
        if getattr(wish, part) is not None:
            free = has[_fits(sizes, wish, but=part)]
            shortfalls.append(Shortfall(part, getattr(wish, part), float(free.min()) if free.size else None))
    return tuple(sorted(shortfalls, key=lambda m: m.change))


def _most_force(shapes: Shapes, wish: Requirements, error: LawError) -> float | None:
    """Largest force within the space, at the required stroke and pressure [N]."""
    unit = _sized(shapes, wish, np.ones_like(shapes.angle), shapes.sound)
    longest = unit.thread * np.cos(shapes.angle)
    widest = (longest - wish.stroke) / usual("slenderness")  # contracted diameter [m]
    if wish.diameter is not None:
        widest = np.minimum(widest, wish.diameter)
    if wish.length is not None:
        widest = np.minimum(widest, (wish.length - longest) / (2.0 * usual("fitting_share")))
    strength = _strength(shapes, error)
    able = shapes.sound & (strength > 0.0) & (widest > 0.0)
    force = np.where(able, (widest / unit.contracted) ** 2 * strength, 0.0)
    return float(force.max()) if able.any() else None


def frontier(wish: Requirements, strokes: np.ndarray, *, law: str = BRAID_LAWS[0]) -> np.ndarray:
    """Largest guaranteed force of a braid within the space, over strokes (n,) [m] [N]; zero if there is none."""
    angles, contractions = np.linspace(*ANGLES, GRID), np.linspace(*CONTRACTIONS, GRID)
    shapes, error = shapes_of(law, wish.pressure, angles, contractions), error_of_braid(law, wish.pressure)
    return np.array([_most_force(shapes, replace(wish, stroke=float(s)), error) or 0.0 for s in strokes])


def _edge(wish: Requirements, law: str, part: str, far: float) -> float | None:
    """Nearest value of a requirement that a braid meets, up to `far` times that; or None."""

    def does(value: float) -> bool:
        parts: dict[str, Any] = {part: value}
        return design(replace(wish, **parts), law=law, fitting=False)[0] is not None

    tried = getattr(wish, part) * np.geomspace(1.0, far, STEPS + 1)
    for bad, good in zip(tried[:-1], tried[1:], strict=True):
        if does(float(good)):
            for _ in range(8):
                middle = float(np.sqrt(bad * good))
                bad, good = (bad, middle) if does(middle) else (middle, good)
            return float(good)
    return None
