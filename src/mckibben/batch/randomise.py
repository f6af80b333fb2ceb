"""Plants that differ from lane to lane, for those who train or judge a controller on many of them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .. import quantities
from ..components import paths
from ..errors import InputError
from ..identification.fit import Fit
from ..identification.posterior import Posterior
from ..quantities import Quantity, named_values, random_generator, whole_number, with_unit
from ..simulation.fit import find_parameters
from ..simulation.kernel import SteppedSimulation
from ..simulation.mechanisms import in_si
from .posterior import of_fit

_TOLERANCE = re.compile(r"\s*(?:\+-|\+/-|±)?\s*([0-9.eE+-]+)\s*%\s*")
_ABOUT = re.compile(r"\s*(?:\+-|\+/-|±)\s*(.+)")


def randomise(
    simulation: SteppedSimulation,
    count: int,
    vary: Mapping[str, Any] | None = None,
    *,
    muscles: Posterior | Fit | Mapping[str, np.ndarray] | None = None,
    seed: int = 0,
) -> dict[str, np.ndarray]:
    """Draw the numbers of many plants of one structure.

    Args:
        simulation: a `Simulation`; its own numbers are the middle of tolerances.
        count: of the plants.
        vary: what differs, by dotted path in ``simulation.machine`` or the end of one, where ``*`` stands for anything: each
            path that it fits is drawn by itself. A value is a tolerance (``"5 %"`` of the number, ``"+-2 mm"``), a range of
            two ends, within which each number is as likely, or an array (count,) [SI]. What holds several numbers, as a
            friction of several elements does, is scaled by a share.
        muscles: law of each muscle, drawn anew for each of them: a posterior or a fit of its law, or draws by name of the
            law's parameters (n,) [SI], whose rows belong together.
        seed: same seed, same plants.

    Returns:
        Values (count,) by path [SI], which `Simulation.batch` takes as ``changes``.

    Raises:
        InputError: names a path that fits nothing, a value that is no spread, a number out of its bounds, or draws that are
            not those of the muscles' law.

    Examples:
        >>> import mckibben as mk
        >>> from mckibben.batch.randomise import randomise
        >>> sim = mk.Simulation(mk.Weight("nylon", mass="2 kg"), mk.Air(valve="regulator"), period="5 ms")
        >>> plants = randomise(sim, 3, {"load.mass": ("1 kg", "3 kg"), "units.*.law.rest_length": "1 %"})
        >>> sorted(plants)
        ['load.mass', 'units.muscle.law.rest_length']
        >>> len(sim.batch(3, plants))
        3
    """
    count = whole_number(count, "count", least=1)
    chance = random_generator(seed)
    declared = {path: (stated, value) for path, stated, value in paths.declared_values(simulation.machine)}
    drawn = {} if muscles is None else _of_muscles(simulation, declared, count, muscles, chance)
    for pattern, spread in named_values(vary or {}, "vary").items():
        for path in find_parameters(simulation.machine, pattern, "vary"):
            stated, value = declared[path]
            drawn[path] = _drawn(path, spread, stated, value, count, chance)
    for path, values in drawn.items():
        declared[path][0].check(path, values)
    return drawn


def _drawn(path: str, spread: Any, stated: Quantity, value: Any, count: int, chance: np.random.Generator) -> np.ndarray:
    whole = np.asarray(value, float)
    if isinstance(spread, np.ndarray):
        if spread.shape != (*whole.shape, count):
            raise InputError(path, None, f"must have a value for each of {count} plants, got shape {spread.shape}")
        return np.asarray(spread, float)
    if whole.ndim > 0:
        if not (isinstance(spread, str) and _TOLERANCE.fullmatch(spread)):
            raise InputError(
                path, str(spread), f"holds {whole.size} numbers, which a share such as '5 %' scales together"
            )
        return whole[..., None] * chance.uniform(*ends_of(path, spread, "1", 1.0), count)
    low, high = ends_of(path, spread, stated.unit, float(np.asarray(value)))
    return chance.uniform(low, high, count)


def ends_of(name: str, spread: Any, unit: str, middle: float) -> tuple[float, float]:
    """Ends of a tolerance around a number, or of a range [unit].

    Raises:
        InputError: it is neither, falls, or is a share of nothing.
    """
    if isinstance(spread, str) and (share := _TOLERANCE.fullmatch(spread)):
        half = abs(middle * in_si(share[1], "1", name)) / 100.0
        if half == 0.0:
            raise InputError(
                name, spread, f"is nothing of {with_unit(middle, unit)}; state it with a unit, or two ends"
            )
        return middle - half, middle + half
    if isinstance(spread, str) and (about := _ABOUT.fullmatch(spread)):
        half = in_si(about[1], unit, name)
        low, high = middle - half, middle + half
    elif isinstance(spread, Sequence) and not isinstance(spread, str) and len(spread) == 2:
        low, high = (in_si(end, unit, name) for end in spread)
    else:
        said = (
            "must be a tolerance such as '5 %' or '+-2 mm', a range of two ends, or an array with one number per plant"
        )
        raise InputError(name, str(spread), said)
    if not low <= high:
        raise InputError(name, str(spread), "must be a spread that rises")
    return low, high


def _of_muscles(
    simulation: SteppedSimulation,
    declared: Mapping[str, Any],
    count: int,
    muscles: Posterior | Fit | Mapping[str, np.ndarray],
    chance: np.random.Generator,
) -> dict[str, np.ndarray]:
    drawn: dict[str, np.ndarray] = {}
    for name, unit in simulation.units.items():
        if isinstance(muscles, Posterior):
            muscles.check_muscle(unit.law, name)
        if isinstance(muscles, Fit):
            rows = of_fit(muscles, count, seed=int(chance.integers(2**32)), prefix="").columns
            order = np.arange(count)
        else:
            rows = muscles.samples if isinstance(muscles, Posterior) else named_values(muscles, "muscles")
            shapes = {np.shape(column) for column in rows.values()}
            if len(shapes) != 1 or len(shape := shapes.pop()) != 1 or not shape[0]:
                counts = ", ".join(f"{name}: {np.shape(column)}" for name, column in rows.items()) or "none"
                raise InputError(
                    "muscles", None, f"must be draws of each parameter (n,), as many of each, got {counts}"
                )
            order = chance.integers(shape[0], size=count)
        for parameter, column in rows.items():
            path = f"units.{name}.law.{parameter}"
            if path not in declared:
                paths.declaration(simulation.machine, path)
            stated = declared[path][0]
            every = np.asarray(quantities.in_si(column, stated.unit, field=path), float)
            stated.check(path, every)
            drawn[path] = every[order]
    return drawn
