"""Maxwell-slip friction: elements in parallel, each a spring that slips at its own force.

    z_i' = clip(z_i + dx, -d_i(P'), d_i(P')),   F = sum k_i z_i,   d_i(P') = Fc_i(P')/k_i

Any number of elements, one is an ideal elastic-plastic contact. Range: rate-independent friction, any piece of path. It
remembers every turning point that a larger one has not wiped out and closes minor loops, so with its lower end held a
halved range narrows the loop and, once the whole loop has been driven, keeps the rising path exactly, as Chou and
Hannaford's Fig. 3b shows.
Sources: F. Al-Bender, V. Lampaert and J. Swevers, IEEE Trans. Automatic Control 50(11), 2005,
doi:10.1109/TAC.2005.858676 (here without its velocity dependence); used for a pneumatic muscle by T. Vo-Minh, T.
Tjahjowidodo, H. Ramon and H. Van Brussel, IEEE/ASME Trans. Mechatronics 16(1), 2011.
"""

from __future__ import annotations

import copy
from typing import Any

import numpy as np

from ..._jax import is_traced, jnp
from ...components import Scalar
from ...components.element import Advanced
from ...errors import InputError
from ...quantities import quantity
from .slip import Contacts, FrictionLimit, advanced, per_contact, slip


class MaxwellSlip(Contacts):
    """Elements in parallel; the state is the deflection of each [m], shape (..., elements).

    Limit and stiffness are those of each element, arrays (elements,): the friction of all together is their sum. One limit
    beside several stiffnesses is refused; ``limit.scaled(shares)`` shares it, and `geometric` does so evenly.
    """

    limit: FrictionLimit
    stiffness: Scalar = quantity(
        "N/m", (1e-3, 1e9), "stiffness of each element, shape (elements,)", symbol="k_i", typical=(1e1, 1e5)
    )

    title = "Maxwell-slip"
    cites = ("albender2005", "vominh2011")

    @classmethod
    def geometric(
        cls,
        limit: FrictionLimit,
        *,
        elements: int = 8,
        shortest: Scalar = 0.2e-3,
        longest: Scalar = 8e-3,
        at_pressure: Scalar = 5e5,
    ) -> MaxwellSlip:
        """Elements of equal force whose yield travels are spread geometrically.

        Args:
            limit: friction of all elements together.
            elements: how many; a single one yields at the geometric mean.
            shortest: smallest yield travel [m].
            longest: largest yield travel [m].
            at_pressure: gauge pressure at which the travels are meant [Pa].
        """
        if elements < 1:
            raise InputError("elements", elements, "must be 1 or more", where=cls.__name__)
        traced = any(map(is_traced, (*vars(limit).values(), shortest, longest, at_pressure)))
        xp: Any = jnp if traced else np  # plain numbers stay with NumPy, for which nothing is compiled
        whole = limit
        if not traced:
            whole = copy.copy(limit)
            vars(whole).update({name: np.asarray(value) for name, value in vars(limit).items()})
        place = np.linspace(0.0, 1.0, elements) if elements > 1 else np.array([0.5])
        travel = xp.asarray(shortest, float) * xp.exp(place * xp.log(xp.asarray(longest, float) / shortest))
        stiffness = whole.force(at_pressure, xp) / elements / travel
        return cls(limit=whole.scaled(np.full(elements, 1.0 / elements)), stiffness=stiffness)

    def advance(
        self,
        state: Scalar,
        displacement: Scalar,
        *,
        start_pressure: Scalar,
        end_pressure: Scalar,
        duration: Scalar = 0.0,
    ) -> Advanced:
        """Move along a straight piece of path, then limit once with the yield at its end."""
        dx = per_contact(displacement)
        return advanced(self.stiffness, state, dx, slip(state, dx, self.travel(end_pressure)))
