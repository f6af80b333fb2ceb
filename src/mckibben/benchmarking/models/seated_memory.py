"""Seated braid with friction and creep in its braid, as a model of the benchmark for records in time.

A muscle between fixed anchors still moves inside: as the tension rises its ends settle, by u, and its braid shortens. Bouc
and Wen's friction and Maxwell elements resist that motion,

    F = F_law(L, P') + f(z) + sum k_i e_i,      both driven by -du

The law is fitted first, to all samples; then friction, with or without the elements, to what it leaves, as the muscle that
is held back among those to train on says. What friction does to the settling itself is of second order and left out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ..._jax import jax, jnp
from ...errors import InputError
from ...muscles.creep import MaxwellChain
from ...muscles.hysteresis import BoucWen, FrictionLimit
from ...muscles.laws.seated_braid import SeatedBraid
from ..records import BenchmarkRecord
from .columns import held_back
from .law import LawModel

MOST = 750  # samples of a record that friction is fitted to
ELEMENTS, SHORTEST, LONGEST = 3, 0.1, 10.0  # [s]
# Friction without pressure [N], per pressure [m^2], stiffness of the contact and of all elements [N/m].
START = np.array([1.0, 1e-5, 1e4, 1e3])
LOW, HIGH = np.array([1e-3, 1e-9, 1e2, 1e-2]), np.array([50.0, 2e-4, 1e7, 1e6])


class SeatedBraidMemory:
    """Law, friction with memory and creep, with the settling of the ends as the motion that both resist."""

    def __init__(self) -> None:
        self.static = LawModel("seated_braid")

    def fit(self, train: Sequence[BenchmarkRecord]) -> None:
        """Fit the law, then friction and creep.

        Raises:
            InputError: the records are not of tension in time.
            ConvergenceError: the law could not be fitted.
        """
        if any(record.is_static for record in train):
            raise InputError("task", None, "must be of records in time: without time this is the law alone")
        self.static.fit(train)
        step = -(-max(len(record) for record in train) // MOST)
        thin = [record.every(step) for record in train]
        held = [h[::step] for h in held_back(train)]
        paths = [self.path_of(record) for record in thin]
        left = [record.outputs["tension"] - path[0] for record, path in zip(thin, paths, strict=True)]
        taut = [record.outputs["tension"] > 0.0 for record in thin]
        errors, used = [], [t & ~h for t, h in zip(taut, held, strict=True)]
        for creeps in (False, True):
            values = fit_memory(paths, left, used, creeps)
            rest = np.concatenate(
                [(resistance(values, *p) - r)[t & h] for p, r, t, h in zip(paths, left, taut, held, strict=True)]
            )
            errors.append(float(np.mean(rest**2)))
        self.creeps = errors[1] < errors[0]
        self.values = fit_memory(paths, left, taut, self.creeps)

    def predict(self, record: BenchmarkRecord) -> Mapping[str, np.ndarray]:
        """Tension over time from length and pressure, never a push."""
        tension, *path = self.path_of(record)
        return {"tension": np.maximum(tension + resistance(self.values, tension, *path), 0.0)}

    def path_of(self, record: BenchmarkRecord) -> tuple[np.ndarray, ...]:
        """Tension of the law [N], motion of the braid since the sample before [m], pressure [Pa] and time step [s]."""
        law = self.static.law_for(record)
        length, pressure = record.inputs["length"], record.inputs["pressure"]
        if record.time is None or not isinstance(law, SeatedBraid):
            raise InputError("task", None, "must be of records in time")
        settled = np.asarray(law.take_up(jnp.asarray(length), jnp.asarray(pressure)))
        moved = np.diff(
            np.asarray(length) - settled, prepend=length[0]
        )  # it begins unloaded, with ends that have not settled
        return np.asarray(law.tension(length, pressure)), moved, pressure, np.diff(record.time, prepend=record.time[0])


def resistance(values: Any, tension: Any, moved: Any, pressure: Any, duration: Any) -> Any:
    """Force of friction and creep along a path of `SeatedBraidMemory.path_of` (n,) [N].

    Args:
        values: friction without pressure [N] and per pressure [m^2], stiffness of the contact and of all elements [N/m].
        tension: of the law, which changes nothing.
        moved: motion of the braid since the sample before (n,) [m].
        pressure: gauge pressure (n,) [Pa].
        duration: since the sample before (n,) [s].
    """
    return np.asarray(_run(jnp.asarray(values), moved, pressure, np.maximum(duration, 0.0)))


def _force(values: Any, moved: Any, pressure: Any, duration: Any) -> Any:
    """Force of friction and elements along a path (n,) [N]."""
    constant, per_pressure, stiffness, creep = values
    friction = BoucWen(limit=FrictionLimit(constant=constant, per_pressure=per_pressure), stiffness=stiffness)
    chain = MaxwellChain.geometric(stiffness=creep, shortest=SHORTEST, longest=LONGEST, elements=ELEMENTS)

    def step(carry: Any, now: Any) -> Any:
        contact, springs, before = carry
        dx, at, dt = now
        contact = friction.advance(contact, dx, start_pressure=before, end_pressure=at, duration=dt).state
        springs = chain.advance(springs, dx, duration=dt).state
        return (contact, springs, at), friction.force(contact, pressure=at) + chain.force(springs)

    start = friction.initial() + 0.0 * constant, chain.initial() + 0.0 * creep, pressure[0]
    return jax.lax.scan(step, start, (moved, pressure, duration))[1]


_run: Callable[..., Any] = jax.jit(_force)


def fit_memory(
    paths: Sequence[tuple[np.ndarray, ...]], left: Sequence[np.ndarray], used: Sequence[np.ndarray], creeps: bool
) -> np.ndarray:
    """Parameters by least squares of what the law leaves, in their logarithms; the elements have none without creep."""
    from scipy import optimize

    whole = [np.stack([np.asarray(path[i]) for path in paths]) for i in (1, 2, 3)]
    whole[2] = np.maximum(whole[2], 0.0)
    wanted, weight = np.stack(left), np.stack(used)
    free = 4 if creeps else 3
    fixed = np.log(START if creeps else np.r_[START[:3], LOW[3]])

    def values(x: Any) -> Any:
        return jnp.exp(jnp.concatenate([x, jnp.asarray(fixed[free:])]))

    force = jax.jit(lambda x: jax.vmap(_force, in_axes=(None, 0, 0, 0))(values(x), *whole))
    slopes = jax.jit(jax.jacfwd(lambda x: jax.vmap(_force, in_axes=(None, 0, 0, 0))(values(x), *whole)))
    solution = optimize.least_squares(
        lambda x: (np.asarray(force(x)) - wanted)[weight],
        fixed[:free],
        jac=lambda x: np.asarray(slopes(x))[weight],
        bounds=(np.log(LOW)[:free], np.log(HIGH)[:free]),
        x_scale="jac",
        max_nfev=60,
    )
    return np.asarray(values(solution.x))
