"""Soundness of a sample: one code beside its numbers, and the balances that are watched while stepping.

A step that is too long for a mode of the system may stay finite: a kink, such as a cord that slackens, keeps it in bounds.
Its balances show it. For each store of energy E (`System.stored_energies`), with the net power into it and what it
exchanges in both directions (`System.balances`), integrated over the sample by the stages of its own steps,

    error = |E(end) - E(start) - integral of the net power| / (exchange + |E(end) - E(start)| + QUIET E period)

which is zero up to the error of the method. Beyond `OPEN` the sample is not sound, and is done again with shorter steps.

Where a muscle gets slack or taut within a sample, its balances close although the moment is known to a step only: the
sample is done again with steps that place it better, once.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .._jax import Scalar, Tree, jax, jnp
from ..components.system import Exchange, System

OPEN = 1e-3  # error of a balance over a sample from which on it does not close
# Share of the stored energy per second of which an exchange is nothing yet [1/s]. Against it counts rounding at rest, and a
# muscle that gets taut just before a sample ends: the less time is left, the less is exchanged, and no step is short enough
# for a thousandth of that. A run may so be off by 1e-5 of what it stores in each second.
QUIET = 1e-2
PLACING = 16  # parts of a step with which a sample is repeated in which a muscle gets slack or taut
LEAST = 1e-6  # [J]; of less exchange than this, rounding of what is stored is all that a balance shows


class Soundness(enum.IntEnum):
    """Code of a sample. All but `SOUND` end a run, those of a balance once shorter steps do not help.

    `SWITCHED` ends none: it asks for one repetition, and no host sees it.
    """

    IMPOSSIBLE = 0
    SOUND = 1
    GAS = 2
    MECHANICS = 3
    BROKEN = 4
    SWITCHED = 5


SOUND, SWITCHED = float(Soundness.SOUND), float(Soundness.SWITCHED)  # plain numbers: they are compared in every sample
MEANINGS = {
    Soundness.IMPOSSIBLE: "a state is not finite or not possible, such as a pressure below vacuum",
    Soundness.SOUND: "finite, possible, and every balance closes",
    Soundness.GAS: "the energy balance of the gas does not close",
    Soundness.MECHANICS: "the energy balance of the mechanics does not close",
    Soundness.BROKEN: "a muscle is longer than its threads bear",
    Soundness.SWITCHED: "a muscle got slack or taut, with steps that do not place it well",
}
SENTENCE = (
    "After a step of {} s, {}. A shorter step may help."  # of a host that cannot repeat a step: its length, the meaning
)
OF_STORES = {"gas": Soundness.GAS, "mechanics": Soundness.MECHANICS}


def overloaded_parts(system: System, outputs: Mapping[str, Any]) -> tuple[str, ...]:
    """Names of the parts that outputs show to be loaded beyond what they bear, at any time."""
    return tuple(name for name, over in system.overloaded(outputs).items() if np.any(over))


def meaning_of(code: float, parts: Sequence[str] = ()) -> str:
    """What the code of a sample means, with the names of the `overloaded_parts` where it is those."""
    meaning, named = MEANINGS[Soundness(int(code))], " and ".join(parts)
    one = "the muscle" if named == "muscle" else f"the muscle {named}"  # one that is alone is called so
    return meaning.replace("a muscle", one) if code == Soundness.BROKEN and named else meaning


def unsound_sentence(code: float, imbalance: float, step: float, parts: Sequence[str] = ()) -> str:
    """Why a sample is not sound although its steps [s] were shortened, and what would do; see `meaning_of`."""
    meaning = meaning_of(code, parts)
    said = f"{meaning[0].upper()}{meaning[1:]}"
    if code == Soundness.IMPOSSIBLE:
        return f"{said}, with steps of {step:.3g} s: a command, a parameter or the start is far out of range."
    if code == Soundness.BROKEN:
        return f"{said}: load it less, shorten its span, or state what its threads bear."
    return (
        f"{said}: it is off by {100.0 * imbalance:.2g} % of what was exchanged, where {100.0 * OPEN:g} % are allowed, with "
        f"steps of {step:.3g} s. Give a shorter step, or soften what changes within one, such as a stiff stop, a light load "
        "or a small volume at a large valve."
    )


def possible(system: System, state: Tree, memory: Tree) -> Any:
    """Whether a state is finite and can be at all (bool)."""
    # What is not finite makes the sum so: one addition for each number, where asking each takes three operations.
    total = sum(jnp.sum(leaf) for leaf in jax.tree.leaves((state, memory)))
    return system.admissible(state) & jnp.isfinite(total)


def balance_errors(
    before: Mapping[str, Scalar], after: Mapping[str, Scalar], exchanges: Mapping[str, Exchange], duration: Scalar
) -> dict[str, Scalar]:
    """Relative errors of the balances of a sample, by store.

    Args:
        before: stored energies at its start [J].
        after: stored energies at its end [J].
        exchanges: what each store exchanged in it, integrated [J].
        duration: of the sample [s].
    """
    quiet: Any = LEAST + QUIET * duration * sum(jnp.abs(energy) for energy in after.values())
    errors = {}
    for name, exchange in exchanges.items():
        gain = after[name] - before[name]
        errors[name] = jnp.abs(gain - exchange.net) / (exchange.turnover + jnp.abs(gain) + quiet)
    return errors


def switched(slack: Sequence[Scalar], duration: Scalar) -> Scalar:
    """Whether a muscle was slack for a part of the time only (bool).

    Args:
        slack: time that each muscle was slack, as `System.slackness` returns it of integrals [s].
        duration: of the sample [s].
    """
    found: Scalar = jnp.zeros((), bool)
    for time in slack:
        for_a_part = (time > 1e-6 * duration) & (time < (1.0 - 1e-6) * duration)  # all of it up to rounding of a sum
        found = jnp.logical_or(found, for_a_part)
    return found


def soundness(
    system: System,
    state: Tree,
    memory: Tree,
    outputs: Mapping[str, Scalar],
    errors: Mapping[str, Scalar] | None = None,
    changed: Scalar = False,
    *,
    limit: float = OPEN,
) -> tuple[Scalar, Scalar]:
    """Largest error of a balance, and the code of a sample as a number.

    Args:
        system: whose sample it is.
        state: continuous state at its end.
        memory: memory at its end.
        outputs: of the system at its end.
        errors: of its balances, as `balance_errors` returns them.
        changed: whether a muscle got slack or taut, with steps that do not place it well (bool).
        limit: from which on a balance does not close.
    """
    code: Any = jnp.where(changed, float(Soundness.SWITCHED), float(Soundness.SOUND))
    worst: Any = jnp.zeros(())
    for name, error in (errors or {}).items():
        code = jnp.where((error > worst) & (error > limit), float(OF_STORES[name]), code)
        worst = jnp.maximum(worst, error)
    code = jnp.where(system.broken(outputs), float(Soundness.BROKEN), code)
    return worst, jnp.where(possible(system, state, memory), code, float(Soundness.IMPOSSIBLE))
