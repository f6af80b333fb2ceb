"""Bouc-Wen hysteresis: one contact whose slope depends on its force and on whether it loads or unloads.

    dz = dx - |z/d|^n (s |dx| sign(z) + (1 - s) dx),   F = k z,   d(P') = Fc(P')/k,   n = 1 or 2

In Wen's letters dz = A dx - beta |dx| |z|^(n-1) z - gamma dx |z|^n with A = 1, d^n = 1/(beta + gamma) and the share s
= beta/(beta + gamma). Passive if and only if s >= 1/2, which is -beta <= gamma <= beta with beta + gamma > 0. With s
= 1/2 it unloads with the full stiffness k, with n = 1 and s = 1 it is Dahl's friction. The update is the implicit
mean over the piece of path, solved in closed form, with the mean yield travel of both ends, then limited once with
that of the end. Range: as Dahl's; it too forgets where it was after a small reversal and closes no minor loop.
Sources: R. Bouc, Forced vibration of mechanical systems with hysteresis, Proc. 4th Conf. on Nonlinear Oscillation,
Prague, 1967; Y.-K. Wen, J. Engineering Mechanics Division ASCE 102(2), 1976, doi:10.1061/JMCEA3.0002106; bounds of
the parameters: F. Ikhouane, V. Manosa and J. Rodellar, Systems & Control Letters 56, 2007,
doi:10.1016/j.sysconle.2006.09.001.
"""

from __future__ import annotations

from ..._jax import jnp
from ...components import Scalar, field
from ...errors import InputError
from ...quantities import quantity
from .slip import FrictionLimit, RelaxingContacts


class BoucWen(RelaxingContacts):
    """Bouc-Wen friction; the state is the deflection of its one contact [m]."""

    limit: FrictionLimit
    stiffness: Scalar = quantity(
        "N/m", (1e-3, 1e9), "stiffness of the contact at zero force", symbol="k", typical=(1e2, 1e5)
    )
    share: Scalar = quantity(
        "1", (0.5, 100.0), "beta/(beta + gamma), the shape of unloading", symbol="s", typical=(0.5, 2.0), default=0.5
    )
    exponent: int = field(static=True, kw_only=True, default=1)

    title = "Bouc-Wen"
    cites = ("bouc1967", "wen1976")

    def __check_init__(self) -> None:
        """Only the exponents with a closed form."""
        if self.exponent not in (1, 2):
            raise InputError("exponent", self.exponent, "must be 1 or 2", where=type(self).__name__)

    @classmethod
    def from_coefficients(cls, *, stiffness: float, beta: float, gamma: float, exponent: int = 1) -> BoucWen:
        """The friction of Wen's coefficients, with A = 1 and no growth with pressure.

        Args:
            stiffness: at zero force [N/m].
            beta: as Wen writes it [m^-n].
            gamma: as Wen writes it, between -beta and beta, since the hysteresis makes energy beyond [m^-n].
            exponent: n.
        """
        if not (beta + gamma > 0.0 and -beta <= gamma <= beta):
            said = f"must be between {-beta:g} and {beta:g}, with beta + gamma > 0"
            raise InputError("gamma", float(gamma), said, where=cls.__name__)
        travel = (1.0 / (beta + gamma)) ** (1.0 / exponent)
        limit, share = FrictionLimit(constant=stiffness * travel), jnp.asarray(beta / (beta + gamma))
        return cls(limit=limit, stiffness=jnp.asarray(stiffness), share=share, exponent=exponent)

    def relaxed(self, deflection: Scalar, displacement: Scalar, travel: Scalar) -> Scalar:
        """Relax the deflection, by the implicit mean [m]."""
        # Twice the mean, z + z': u + c q u |u|^(n-1) = r for u = (z + z')/2 in the direction of motion.
        dx = displacement
        ahead = jnp.where(dx < 0.0, -1.0, 1.0)
        right = ahead * deflection + 0.5 * jnp.abs(dx)
        # Loading takes 1 off the slope at the limit, unloading adds 2 s - 1; neither is ever negative.
        c = jnp.where(right < 0.0, 2.0 * self.share - 1.0, 1.0)
        relative = 0.5 * c * jnp.abs(dx) / travel
        if self.exponent == 1:
            return 2.0 * ahead * right / (1.0 + relative) - deflection
        both = 4.0 * ahead * right / (1.0 + jnp.sqrt(1.0 + 4.0 * relative * jnp.abs(right) / travel))
        return both - deflection
