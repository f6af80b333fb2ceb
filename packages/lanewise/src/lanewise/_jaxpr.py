"""The classes of JAX's intermediate form, without the whole of `jax.extend`.

`jax.extend.core` is their public place, but importing it imports Pallas besides, some 7 % of the time that a fresh
process takes to lower and run its first program. They are therefore taken from where `jax.extend.core` takes them, and from
the public place where JAX has moved them.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jax.extend.core import ClosedJaxpr, Literal, Primitive, jaxpr_as_fun
else:
    try:
        from jax._src.core import ClosedJaxpr, Literal, Primitive, jaxpr_as_fun
    except ImportError:
        from jax.extend.core import ClosedJaxpr, Literal, Primitive, jaxpr_as_fun

__all__ = ["ClosedJaxpr", "Literal", "Primitive", "jaxpr_as_fun"]
