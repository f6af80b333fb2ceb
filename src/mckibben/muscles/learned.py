"""A learned residual beside a law: what records of a muscle say that its law does not, as a potential of its own.

    G(L, P') = G0(L, P') + w(x) w(y) sum_ij c_ij T_i(x) T_j(y),   w(x) = (1 - x^2)^3 within -1 to 1, else 0

G0 is the gas energy of the law, x is the length in the range of the records, y the pressure in theirs, from a line over the
length around which a loaded muscle moves; T_i are Chebyshev polynomials.
Tension and volume follow from G as from every law, F = Fe - dG/dL and V = dG/dP', so that what was learned yields no work in
any closed cycle, and enters the gas with the volume that belongs to its tension. Beyond the records it fades to nothing,
twice continuously differentiable: there the law alone answers. It is linear in its weights, so that their fit has one end.
What takes energy away, with memory, is no part of a potential: that is the friction of the muscle, whose elements are
learned beside it and can only take (`simulation.fit`).
Range: that of the records. Source: virtual work of C.-P. Chou and B. Hannaford, 1996, doi:10.1109/70.481753; the window and
the basis are this project's.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, Self

import numpy as np

from .._jax import Scalar, jnp
from ..components import derivative, field
from ..errors import InputError
from ..quantities import declared, quantity
from ..specimens import SpecimenNumber
from .law import TensionLaw

ROWS = "rows"  # of the table of weights, which a file states row after row
ORDER = (4, 4)  # of the polynomials, lengths by pressures, unless stated otherwise
MARGIN = 1.25  # half width of the window over that of the data: at their ends it is 0.05, at nine tenths of them 0.11


class LearnedResidual(TensionLaw):
    """A law with a learned potential beside it; with weights of zero it is the law itself.

    Examples:
        >>> import mckibben as mk
        >>> from mckibben.muscles import LearnedResidual
        >>> law = mk.muscle("nylon").law
        >>> beside = LearnedResidual.beside(law, lengths=(0.11, 0.14), pressures=(1e5, 5e5))
        >>> bool(beside.tension(0.12, 3e5) == law.tension(0.12, 3e5))
        True
    """

    of: TensionLaw = field(kw_only=True)
    weights: Scalar = quantity(
        "J", (-1e4, 1e4), "weights of the potential, (lengths, pressures)", symbol="c", typical=(-0.02, 0.02)
    )
    middle_length: Scalar = quantity("m", (1e-3, 100.0), "middle of the lengths", symbol="Lm", along=1)
    length_reach: Scalar = quantity("m", (1e-4, 100.0), "half width of the window of lengths", symbol="a", along=1)
    middle_pressure: Scalar = quantity("Pa", (-1e5, 1e8), "gauge pressure of the line at that length", symbol="Pm")
    pressure_slope: Scalar = quantity("Pa/m", (-1e12, 1e12), "slope of the line", symbol="s", default=0.0, along=-1)
    pressure_reach: Scalar = quantity("Pa", (1e2, 1e8), "half width of the window of pressures", symbol="b")

    title = "Learned residual"
    cites = ("chou1996",)
    fitted = ("weights",)

    @classmethod
    def beside(
        cls,
        law: TensionLaw,
        *,
        lengths: np.ndarray | tuple[float, float],
        pressures: np.ndarray | tuple[float, float],
        order: tuple[int, int] = ORDER,
    ) -> LearnedResidual:
        """A law with a potential that is nothing yet.

        Args:
            law: that is kept.
            lengths: of the muscle in the records (n,), or their ends [m].
            pressures: gauge, at the same samples (n,), or their ends [Pa].
            order: how many polynomials of the length, and of the pressure.

        Raises:
            InputError: a range is none, or there are no polynomials.
        """
        length, pressure = np.asarray(lengths, float), np.asarray(pressures, float)
        for name, values in (("lengths", length), ("pressures", pressure)):
            if values.ndim != 1 or values.size < 2 or not np.ptp(values) > 0.0 or not np.isfinite(values).all():
                raise InputError(name, None, "must be two or more finite numbers that differ")
        if min(order) < 1:
            raise InputError("order", str(order), "must be 1 or more of each")
        middle, slope = 0.5 * (length.min() + length.max()), 0.0
        if length.size == pressure.size > 2:
            slope = float(np.polyfit(length - middle, pressure, 1)[0])
            pressure = pressure - slope * (length - middle)
        return cls(
            of=law,
            thread_strain=law.thread_strain,
            weights=np.zeros(order),
            middle_length=middle,
            length_reach=0.5 * MARGIN * np.ptp(length),
            middle_pressure=0.5 * (pressure.min() + pressure.max()),
            pressure_slope=slope,
            pressure_reach=0.5 * MARGIN * np.ptp(pressure),
        )

    @classmethod
    def stated(cls, law: TensionLaw, group: Mapping[str, SpecimenNumber], *, where: str) -> TensionLaw:
        """A law with the residual that a specimen's file states; the law itself where it states none.

        Raises:
            InputError: a number is missing, unknown, or the weights are no table.
        """
        if not group:
            return law
        known = {name: one.unit for name, one in declared(cls).items() if name != "thread_strain"} | {ROWS: "1"}
        for name in known:
            if name not in group:
                raise InputError(f"residual.{name}", None, "is missing", where=where)
        for name in group:
            if name not in known:
                raise InputError(f"residual.{name}", None, "a residual has", known=known, where=where)
        si: dict[str, Any] = {n: group[n].si(unit, field=f"residual.{n}", where=where) for n, unit in known.items()}
        rows, weights = int(si.pop(ROWS)), np.atleast_1d(si.pop("weights"))
        if rows < 1 or weights.size % rows:
            raise InputError(f"residual.{ROWS}", rows, f"must divide the {weights.size} weights", where=where)
        return cls(of=law, thread_strain=law.thread_strain, weights=weights.reshape(rows, -1), **si)

    def group(self, note: str = "") -> dict[str, SpecimenNumber]:
        """The residual as the group of a specimen's file."""
        units = {name: one.unit for name, one in declared(type(self)).items() if name != "thread_strain"}
        values = {name: np.ravel(getattr(self, name)).tolist() for name in units}
        numbers = {n: SpecimenNumber(value=v if n == "weights" else v[0], unit=units[n]) for n, v in values.items()}
        return numbers | {ROWS: SpecimenNumber(value=float(np.shape(self.weights)[0]), unit="1", note=note)}

    def learned_energy(self, length: Scalar, pressure: Scalar) -> Scalar:
        """The learned part of the gas energy [J]."""
        beyond = length - self.middle_length
        x = beyond / self.length_reach
        y = (pressure - self.middle_pressure - self.pressure_slope * beyond) / self.pressure_reach
        rows, columns = self.weights.shape[:2]  # type: ignore[union-attr]
        of_length, of_pressure = _basis(x, rows), _basis(y, columns)
        energy = 0.0 * (x + y)
        for i in range(rows):
            share = 0.0 * y
            for j in range(columns):
                share = share + self.weights[i, j] * of_pressure[j]  # type: ignore[index]
            energy = energy + share * of_length[i]
        return energy

    def formula_tension(self, length: Scalar, pressure: Scalar) -> Scalar:
        """That of the law, and what was learned [N]."""
        learned = derivative(lambda x: self.learned_energy(x, pressure), length)
        return self.of.formula_tension(length, pressure) - learned

    def elastic_tension(self, length: Scalar) -> Scalar:
        """That of the law [N]."""
        return self.of.elastic_tension(length)

    def gas_energy(self, length: Scalar, pressure: Scalar) -> Scalar:
        """That of the law, and what was learned [J]."""
        return self.of.gas_energy(length, pressure) + self.learned_energy(length, pressure)

    def length_range(self) -> tuple[Scalar, Scalar]:
        """Range of the law [m]."""
        return self.of.length_range()

    def has_volume(self) -> bool:
        """Whether the law knows its volume."""
        return self.of.has_volume()

    def __getattr__(self, name: str) -> Any:
        """What else the law says of itself, such as its rest length, bore and threshold."""
        if name.startswith("_") or "of" not in vars(self):  # of an object that is still made, or copied
            raise AttributeError(name)
        return getattr(self.of, name)

    def replace(self, **changes: Any) -> Self:
        """A copy with other numbers, those of the law among them."""
        of_law = {name: changes.pop(name) for name in changes.keys() - {one.name for one in dataclasses.fields(self)}}
        return super().replace(**changes, **({"of": self.of.replace(**of_law)} if of_law else {}))


def _basis(x: Scalar, count: int) -> list[Scalar]:
    """Chebyshev polynomials under the window; clipped before they are multiplied, so that nothing beyond it overflows."""
    at = jnp.clip(x, -1.0, 1.0)
    window = (1.0 - at * at) ** 3
    values = [0.0 * at + 1.0, at]
    while len(values) < count:
        values.append(2.0 * at * values[-1] - values[-2])
    return [window * value for value in values[:count]]
