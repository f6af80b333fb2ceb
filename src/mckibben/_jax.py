"""JAX, loaded when it is first used, and set to float64 as soon as it is loaded.

Loading JAX takes half a second. A process that only reads specimens, or evaluates a law by a kernel that was compiled
before, never needs it; so modules take `jax` and `jnp` from here, and decorate functions with the `jit` and `custom_jvp` of
this module. Whether this package loads JAX or a user's own ``import jax``: float64 is switched on at once, for an energy
balance to 1e-10 has no meaning in float32, and what waits for JAX (`when_loaded`) is done then.

Tables and states are also put together with `jnp`. As long as JAX is not loaded, its functions that round nothing, or
whose rounding IEEE 754 fixes (`EXACT`), are NumPy's: the same bits from either. All others load JAX, since an exponential of
NumPy may differ from one of XLA in its last digit, and no result may depend on what was loaded before.
"""

from __future__ import annotations

import contextlib
import functools
import importlib
import sys
import types
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from ._lazy import LazyModule

__all__ = [
    "Array",
    "Scalar",
    "Tree",
    "custom_jvp",
    "flatten_util",
    "is_jax_array",
    "is_loaded",
    "is_traced",
    "jax",
    "jit",
    "jnp",
    "load",
    "when_loaded",
]

Array: TypeAlias = "np.ndarray | jax.Array"
Scalar: TypeAlias = "float | np.ndarray | jax.Array"  # a number or an array: formulas are elementwise and broadcast
Tree: TypeAlias = (
    Any  # arrays in any structure, as JAX takes them: modules, tables, tuples; only their owner knows which
)

_waiting: list[Callable[[], None]] | None = []  # what is to be done when JAX is loaded; None as soon as it is


def is_loaded() -> bool:
    """Whether JAX is loaded."""
    return _waiting is None


def load() -> None:
    """Load JAX now, for values that must be its arrays."""
    importlib.import_module("jax")


def when_loaded(action: Callable[[], None]) -> None:
    """Do something as soon as JAX is loaded: now if it is, else when it is first used.

    Args:
        action: a function without arguments.
    """
    if _waiting is None:
        action()
    else:
        _waiting.append(action)


def is_traced(value: object) -> bool:
    """Whether a value is one of JAX's tracers, which stand for numbers while a function is traced."""
    return _waiting is None and isinstance(value, jax.core.Tracer)


def is_jax_array(value: object) -> bool:
    """Whether a value is an array of JAX, a tracer included."""
    return _waiting is None and isinstance(value, jax.Array)


# Functions and names of `jax.numpy` that NumPy has with the same bits, for arrays of at least 64 bits.
EXACT = frozenset(
    "abs all any append arange argmax argmin array asarray atleast_1d bool_ broadcast_arrays broadcast_shapes broadcast_to"
    " ceil clip concatenate e expand_dims finfo flip float64 floor full full_like inf int64 isfinite isinf isnan logical_and"
    " logical_not logical_or logical_xor max maximum min minimum moveaxis nan ndim newaxis ones ones_like pi ravel repeat"
    " reshape roll shape sign size sqrt squeeze stack take transpose where zeros zeros_like".split()
)


class _LazyArrays(LazyModule):
    """`jax.numpy`, in place of whose exact functions NumPy's are used while JAX is not loaded."""

    def __getattr__(self, name: str) -> Any:
        if _waiting is not None and name in EXACT:
            return getattr(importlib.import_module("numpy"), name)
        return super().__getattr__(name)


class _LazyFunction:
    """A function that JAX transforms when it is first called.

    Args:
        function: what is transformed.
        transform: the name of JAX's transformation.
        options: options of the transformation.
    """

    def __init__(self, function: Callable[..., Any], transform: str, options: dict[str, Any]) -> None:
        functools.update_wrapper(self, function)
        self._transform, self._options = transform, options
        self._rule: Callable[..., Any] | None = None

    def defjvp(self, rule: Callable[..., Any]) -> Callable[..., Any]:
        """State the derivative of a function of `custom_jvp`."""
        self._rule = rule
        return rule

    @functools.cached_property
    def _transformed(self) -> Any:
        made = getattr(jax, self._transform)(self.__wrapped__, **self._options)
        if self._rule is not None:
            made.defjvp(self._rule)
        return made

    def __call__(self, *arguments: Any, **options: object) -> Any:
        return self._transformed(*arguments, **options)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):  # as `copy` and `inspect` ask; JAX need not be loaded to say no
            raise AttributeError(name)
        return getattr(self._transformed, name)


def jit(function: Callable[..., Any], **options: object) -> Any:
    """Compile a function as `jax.jit` does, when it is first called."""
    return _LazyFunction(function, "jit", options)


def custom_jvp(function: Callable[..., Any]) -> Any:
    """Give a function a derivative of its own as `jax.custom_jvp` does, when it is first called."""
    return _LazyFunction(function, "custom_jvp", {})


class _Watcher:
    """A finder of modules that finds none but sees when JAX is about to be loaded."""

    def find_spec(self, name: str, path: Sequence[str] | None = None, target: Any = None) -> Any:
        """Let the others find JAX, and be called when it is loaded."""
        if name != "jax":
            return None
        specs = (finder.find_spec(name, path, target) for finder in sys.meta_path if finder is not self)
        spec = next((spec for spec in specs if spec is not None), None)
        if spec is not None and spec.loader is not None:
            loader: Any = spec.loader
            execute = loader.exec_module

            def exec_module(module: types.ModuleType) -> None:
                with _no_search_for_rocm():
                    execute(module)
                del loader.exec_module
                sys.meta_path.remove(self)
                _configure()

            loader.exec_module = exec_module
        return spec


@contextlib.contextmanager
def _no_search_for_rocm() -> Iterator[None]:
    """Spare JAX a fifth of its loading: without a plugin of ROCm it reads the metadata of all packages for nothing."""
    if any(next(Path(folder or ".").glob("jax_rocm*"), None) for folder in sys.path):
        yield
        return
    from importlib import metadata

    real = metadata.distributions
    metadata.distributions = lambda **_: iter(())
    try:
        yield
    finally:
        metadata.distributions = real


def _configure() -> None:
    global _waiting
    sys.modules["jax"].config.update("jax_enable_x64", True)
    actions, _waiting = _waiting or [], None
    for action in actions:
        action()


if TYPE_CHECKING:
    import jax as jax
    import jax.numpy as jnp
    import numpy as np
    from jax import flatten_util as flatten_util
else:
    jax, flatten_util = map(LazyModule, ("jax", "jax.flatten_util"))
    jnp = _LazyArrays("jax.numpy")

if "jax" in sys.modules:
    _configure()
else:
    sys.meta_path.insert(0, _Watcher())
