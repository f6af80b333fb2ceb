"""Threads that hold a braid at the ends of its law's range of lengths: pulled straight, or packed side by side.

Beyond the range [Lmin, Lmax] of a law, with x = L - Lmax above it, x = L - Lmin below it, 0 within, and y = x/S, the
potential goes on as that of the law at an effective length Le, with the energy of the threads:

    F = w Fl(Le, P') + T(x)              V = Vl(Le, P')
    Le = L - x + S t (1 - 2/3 t^2 + t^4/5)          w = dLe/dL = (1 - t^2)^2
    T = k S [t |t| (1 - |t|/3) + y - t]             dT/dx = k (1 - (1 - |t|)^2)       t = y, held within -1 and 1

Value, slope and curvature of Le are continuous, T begins with zero slope and reaches the stiffness k of the threads over the
travel S. The law is asked up to 8/15 S beyond its range and no further, so that no gas is squeezed out from there on. With
k = F10/(e Lmax), F10 the law's tension at the longest length and 10 bar and e the strain of the threads under it, and
S = 3 e Lmax, F rises with the length wherever the law's tension at Lmax is below 1.4 F10: the threads take the tension over
faster than the gas leaves it, k (1 - (1 - t)^2) > -F dw/dx for k S > 2.15 F.
Source: virtual work of C.-P. Chou and B. Hannaford, 1996, doi:10.1109/70.481753; the transition is this project's.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from .._jax import custom_jvp, jax, jit, jnp
from ..components import Scalar

TRAVEL = 3.0  # over the stretch of the threads at 10 bar
FURTHEST = 8.0 / 15.0  # how far beyond its range a law is asked, over that travel
# In travels beyond the range: there the threads bear five times the tension at 10 bar, so that every braid is slack before.
REACH = 2.0


class HeldLength(NamedTuple):
    """A length as threads hold it: that at which the law is asked [m], its slope w [1], stretch of the threads T/k [m]."""

    length: Scalar
    share: Scalar
    stretch: Scalar


def travel(strain: Scalar, longest: Scalar) -> Scalar:
    """Travel S over which the threads take over [m], from their strain at 10 bar [1] and the longest length [m]."""
    return TRAVEL * strain * longest


def furthest(strain: Scalar) -> Scalar:
    """How far beyond the longest length a law is asked, over that length [1], from the strain of its threads [1]."""
    return FURTHEST * TRAVEL * strain


def hold(length: Scalar, shortest: Scalar, longest: Scalar, travel: Scalar) -> HeldLength:
    """A length of the braid as its threads hold it; all [m]."""
    length = jnp.asarray(length, float)
    # Within the range the length moves with y, which is zero there: so its slope is the share everywhere.
    below = jnp.where(length < shortest, shortest, jax.lax.stop_gradient(length))
    held = jnp.where(length > longest, longest, below)
    y = (length - held) * (1.0 / travel)
    return HeldLength(held + travel * _further(y), _share(y), travel * _pull(y))


# Slopes are written out: derived, each would tell the pieces apart anew, and all are smooth where they meet.


def _between(y: Scalar) -> Scalar:
    return jnp.minimum(jnp.maximum(y, -1.0), 1.0)


@custom_jvp
def _further(y: Scalar) -> Scalar:
    t = _between(y)
    t2 = t * t
    return t * (1.0 - t2 * (2.0 / 3.0 - 0.2 * t2))


@custom_jvp
def _share(y: Scalar) -> Scalar:
    t = _between(y)
    q = 1.0 - t * t
    return q * q


@custom_jvp
def _pull(y: Scalar) -> Scalar:
    t = _between(y)
    a = jnp.abs(t)
    return (y - t) + t * a * (1.0 - a / 3.0)


@_further.defjvp
def _(primals: Any, tangents: Any) -> tuple[Scalar, Scalar]:
    return _further(*primals), _share(*primals) * tangents[0]


@_share.defjvp
def _(primals: Any, tangents: Any) -> tuple[Scalar, Scalar]:
    value, t = _share(*primals), _between(*primals)
    return value, -4.0 * t * (1.0 - t * t) * tangents[0]


@_pull.defjvp
def _(primals: Any, tangents: Any) -> tuple[Scalar, Scalar]:
    value, a = _pull(*primals), jnp.minimum(jnp.abs(*primals), 1.0)
    return value, a * (2.0 - a) * tangents[0]


# traced once, however often a step calls them
_further, _share, _pull = jit(_further), jit(_share), jit(_pull)
