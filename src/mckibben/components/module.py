"""The type that everything with declared parameters derives from."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import equinox as eqx
from jaxtyping import Array, Float

from ..quantities import check_fields

# A number or an array of them: all formulas are elementwise and broadcast.
if TYPE_CHECKING:
    Scalar = Any  # fields take plain floats and hold arrays, for which type checkers have no word
else:
    Scalar = Float[Array, "..."]


class Module(eqx.Module):
    """An immutable value whose declared parameters are checked when they are concrete."""

    def __check_init__(self) -> None:
        """Refuse parameters out of their declared bounds."""
        check_fields(self, where=type(self).__name__)

    # Parameters are arrays, which have no hash; by identity, `jax.jit(law.tension)` works as a newcomer writes it.
    __hash__ = object.__hash__

    def replace(self, **changes: Any) -> Any:
        """A copy with some fields changed, checked like a new one."""
        import dataclasses

        return dataclasses.replace(self, **changes)
