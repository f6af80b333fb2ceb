"""Base of all types with declared parameters: immutable values that are JAX pytrees.

    class Spring(Module):
        stiffness: Scalar = quantity("N/m", (0.0, 1e6), "slope", symbol="k")
        name: str = field(static=True, kw_only=True, default="")

Fields are those of a dataclass. What is `static` belongs to the structure of the tree and is compared by value; all else is
a branch of it. It does what `equinox.Module` does for such values; but a process that only runs kernels is spared the
loading of Equinox, and a class is made in a fifth of the time.
"""

from __future__ import annotations

import abc
import dataclasses
import functools
import types
import weakref
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar, dataclass_transform

import numpy as np

from .._jax import Scalar as Scalar
from .._jax import Tree, is_jax_array, is_loaded, is_traced, jax, jit, jnp, when_loaded
from ..errors import refuse_unknown
from ..quantities import check_fields

Result = TypeVar("Result")

if TYPE_CHECKING:
    from typing import Annotated

    _T = TypeVar("_T")
    AbstractVar = Annotated[_T, "a field that a kind of this type must have"]
else:

    class AbstractVar:
        """Declares a field that concrete types must have."""

        def __class_getitem__(cls, _: Any) -> Any:
            return cls


def field(*, static: bool = False, converter: Callable[[Any], Any] | None = None, **options: Any) -> Any:
    """A field as `dataclasses.field` makes it.

    Args:
        static: whether it is part of the structure.
        converter: makes its value of the one that is given.
        **options: of `dataclasses.field`.
    """
    more = {} if converter is None else {"converter": converter}
    return dataclasses.field(metadata={"static": static, **more}, **options)


_fields: dict[type, tuple[tuple[str, ...], tuple[str, ...]]] = {}  # of every kind: static fields and branches


@dataclass_transform(field_specifiers=(dataclasses.field, field))
class Module(metaclass=abc.ABCMeta):  # noqa: B024 - its kinds may have abstract methods
    """An immutable value whose declared parameters are checked when they are concrete."""

    if TYPE_CHECKING:
        __dataclass_fields__: ClassVar[dict[str, dataclasses.Field[Any]]]

    def __init_subclass__(cls, **options: Any) -> None:
        """Make it a dataclass and a kind of tree."""
        super().__init_subclass__(**options)
        annotations = dict(cls.__dict__.get("__annotations__", {}))
        # A declared parameter needs no annotation: `gain = quantity(..)` is a field too.
        own = (name for name, value in vars(cls).items() if isinstance(value, dataclasses.Field))
        annotations |= {name: Scalar for name in own if name not in annotations}
        cls.__annotations__ = annotations
        for name in [n for n, kind in annotations.items() if "AbstractVar" in str(kind)]:
            del annotations[name]
        dataclasses.dataclass(eq=False, repr=False)(cls)
        static = tuple(f.name for f in dataclasses.fields(cls) if f.metadata.get("static", False))
        _fields[cls] = static, tuple(f.name for f in dataclasses.fields(cls) if f.name not in static)
        when_loaded(functools.partial(_register, cls))

    def __post_init__(self) -> None:
        known = self.__dict__
        for f in dataclasses.fields(self):
            value = known[f.name]
            if "converter" in f.metadata:
                known[f.name] = f.metadata["converter"](value)
            elif isinstance(value, types.MethodType) and isinstance(value.__self__, Module):
                known[f.name] = BoundMethod(value.__func__, value.__self__)
        for kind in type(self).__mro__:
            if "__check_init__" in kind.__dict__:
                kind.__dict__["__check_init__"](self)
        if not is_loaded():
            _older[id(self)] = self

    def __check_init__(self) -> None:
        """Refuse parameters out of their declared bounds."""
        check_fields(self, where=type(self).__name__)

    def __setattr__(self, name: str, value: Any) -> None:
        if name in self.__dict__ or name not in type(self).__dataclass_fields__:
            raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")
        self.__dict__[name] = value  # by its constructor

    def __delattr__(self, name: str) -> None:
        raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")

    def __eq__(self, other: object) -> bool:
        if self is other:
            return True
        mine, theirs = flatten(self), flatten(other)
        return bool(mine[1] == theirs[1]) and all(map(_same, mine[0], theirs[0]))

    # Parameters are arrays, which have no hash; by identity, `jax.jit(law.tension)` works as a newcomer writes it.
    __hash__ = object.__hash__

    def __repr__(self) -> str:
        shown = ", ".join(f"{f.name}={_shown(getattr(self, f.name))}" for f in dataclasses.fields(self))
        return f"{type(self).__name__}({shown})"

    def replace(self, **changes: object) -> Self:
        """Return a copy with some fields changed, checked like a new one."""
        refuse_unknown(changes, type(self).__dataclass_fields__, where=type(self).__name__)
        return dataclasses.replace(self, **changes)

    def with_fields(self, **values: object) -> Self:
        """Return a copy with fields that hold these values, which are neither converted nor checked.

        It is for taking a value apart: all its numbers stay the same objects.
        """
        made: Self = object.__new__(type(self))
        made.__dict__.update(self.__dict__)
        made.__dict__.update(values)
        return made


def flatten(tree: Tree) -> tuple[list[Tree], Tree]:
    """The leaves of a tree in the order of `jax.tree.leaves`, and its structure, which has a hash if all static fields have.

    It does what `jax.tree.flatten` does for modules, tables, lists, tuples and None, and needs no JAX.
    """
    leaves: list[Any] = []
    return leaves, _take_apart(tree, leaves)


def _take_apart(tree: Any, leaves: list[Any]) -> Any:
    kind = type(tree)
    if kind is np.ndarray or kind is float:
        leaves.append(tree)
        return "leaf"
    if kind in _fields:
        known, (static, branches) = tree.__dict__, _fields[kind]
        head: Any = (kind, tuple([known[name] for name in static]))
        return head, tuple([_take_apart(known[name], leaves) for name in branches])
    if isinstance(tree, dict):
        names = sorted(tree)
        return (dict, tuple(names)), tuple([_take_apart(tree[name], leaves) for name in names])
    if kind is list or kind is tuple or (isinstance(tree, tuple) and hasattr(tree, "_fields")):
        return kind, tuple([_take_apart(part, leaves) for part in tree])
    if tree is None:
        return None
    leaves.append(tree)
    return "leaf"


def unflatten(structure: Tree, leaves: Sequence[Tree]) -> Tree:
    """The tree of a structure of `flatten` with other leaves; what is put together is not checked again."""
    rest = iter(leaves)
    made = _put_together(structure, rest)
    if more := sum(1 for _ in rest):
        raise ValueError(f"{more} leaves more than the structure has")
    return made


def _put_together(structure: Any, leaves: Iterator[Any]) -> Any:
    if structure is None:
        return None
    if structure == "leaf":
        return next(leaves)
    head, inner = structure
    parts = [_put_together(one, leaves) for one in inner]
    if isinstance(head, type):
        return head(parts) if head in (list, tuple) else tuple.__new__(head, parts)
    kind, static = head
    if kind is dict:
        return dict(zip(static, parts, strict=True))
    made: Any = object.__new__(kind)
    of_structure, branches = _fields[kind]
    values = dict(zip((*of_structure, *branches), (*static, *parts), strict=True))
    made.__dict__.update((f.name, values[f.name]) for f in dataclasses.fields(kind))
    return made


def map_leaves(function: Callable[..., Tree], *trees: Tree) -> Tree:
    """Apply a function to the leaves of trees of one structure, as `jax.tree.map` does; it needs no JAX."""
    (first, structure), *others = map(flatten, trees)
    for _, other in others:
        if other != structure:
            raise ValueError("the trees differ in structure")
    return unflatten(structure, [function(*leaves) for leaves in zip(first, *(o for o, _ in others), strict=True)])


def jit_arrays(function: Callable[..., Result]) -> Callable[..., Result]:
    """Compile a function for the arrays among the leaves of its arguments; every other leaf is a constant of the program.

    Numbers of Python count as constants: another one compiles another program.
    """

    @functools.partial(jit, static_argnums=0)
    def compiled(constants: tuple[Any, tuple[tuple[type, Any], ...]], arrays: list[Any]) -> Result:
        structure, others = constants
        leaves = [other if array is None else array for array, (_, other) in zip(arrays, others, strict=True)]
        return function(*jax.tree.unflatten(structure, leaves))

    @functools.wraps(function)
    def call(*arguments: Any) -> Result:
        leaves, structure = jax.tree.flatten(arguments)
        traced = [isinstance(leaf, jax.Array | np.ndarray | np.generic) for leaf in leaves]
        arrays = [leaf if own else None for leaf, own in zip(leaves, traced, strict=True)]
        others = tuple(
            (type(None), None) if own else (type(leaf), leaf) for leaf, own in zip(leaves, traced, strict=True)
        )
        outputs: Result = compiled((structure, others), arrays)
        return outputs

    return call


_older: weakref.WeakValueDictionary[int, Module] = weakref.WeakValueDictionary()  # values made before JAX was loaded


@when_loaded
def _convert_older() -> None:
    # Numbers of values that are older than the loading of JAX become its arrays, as those of all later ones are; arrays of
    # NumPy among their branches too: traced functions take elements of them at places that are traced.
    for value in list(_older.values()):
        known = value.__dict__
        for f in dataclasses.fields(value):
            if "converter" in f.metadata:
                known[f.name] = f.metadata["converter"](known[f.name])
            elif not f.metadata.get("static", False):
                known[f.name] = _converted(known[f.name])
    _older.clear()


def _converted(branch: Any) -> Any:
    if isinstance(branch, np.ndarray | np.generic):
        return jax.device_put(branch)
    if type(branch) is dict:
        return {name: _converted(part) for name, part in branch.items()}
    if type(branch) in (list, tuple):
        return type(branch)(map(_converted, branch))
    if isinstance(branch, tuple) and hasattr(branch, "_fields"):
        return tuple.__new__(type(branch), map(_converted, branch))
    return branch


def _register(cls: type[Module]) -> None:
    """Tell JAX how such a value is taken apart and put together; what is put together is not checked again."""
    static, branches = _fields[cls]
    keys = tuple(jax.tree_util.GetAttrKey(name) for name in branches)

    def flat(value: Any) -> Any:
        known = value.__dict__
        return [known[n] for n in branches], tuple([known[n] for n in static])

    def with_keys(value: Any) -> Any:
        children, structure = flat(value)
        return list(zip(keys, children, strict=True)), structure

    def whole(structure: Any, children: Any) -> Any:
        made: Any = object.__new__(cls)
        known = made.__dict__
        known.update(zip(branches, children, strict=True))
        known.update(zip(static, structure, strict=True))
        return made

    jax.tree_util.register_pytree_with_keys(cls, with_keys, whole, flat)


class BoundMethod(Module):
    """A method of a module as a tree: its owner is a branch."""

    __func__: Callable[..., Any] = field(static=True)
    __self__: Module

    def __call__(self, *args: Any, **options: Any) -> Any:
        """Call the method."""
        return self.__func__(self.__self__, *args, **options)


def _same(mine: Any, theirs: Any) -> bool:
    if mine is theirs or is_traced(mine) or is_traced(theirs):
        return mine is theirs
    return bool(np.array_equal(mine, theirs)) and np.asarray(mine).dtype == np.asarray(theirs).dtype


def _shown(value: Any) -> str:
    if (isinstance(value, np.ndarray) or is_jax_array(value)) and not is_traced(value):
        return repr(np.asarray(value).tolist()) if value.size <= 8 else f"{value.dtype}{list(value.shape)}"
    return repr(value)


def derivative(function: Callable[[Scalar], Scalar], at: Scalar) -> Scalar:
    """df/dx of an elementwise function, of the shape of ``x`` (no loop and no vmap: one forward tangent)."""
    x = jnp.asarray(at, float)
    slope: Scalar = jax.jvp(function, (x,), (jnp.ones_like(x),))[1]
    return slope
