"""JAX functions compiled once and run on one lane or on many, by native kernels or by XLA; and kernels as JAX functions.

    run = compile(function, *examples)              # engine="auto": native where it can be, else XLA
    results = run(*trees)                           # like function(*trees)
    results = run(*trees, lanes=1024)               # a leaf with one axis more than its example, the last, is given per lane

Lanes are the last axis of arguments and results, with both engines. With `_trace` and the rules this is the only part that
needs JAX.

    run = differentiable(function, *examples)       # of trees, like `compile`
    jax.grad(lambda mass: loss(run(system.replace(mass=mass), state)))(0.2)

Derivatives are those of the lowered function itself, `tangents` and `adjoint`; each is made when it is first asked for.
What `vmap` maps over goes to the lanes; directions of `jacfwd` go there too, or, where the lanes are taken, several to one
kernel. Derivatives of derivatives have no kernel.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol

import jax
import jax.numpy as jnp
import numpy as np
from jax.interpreters import ad, batching, mlir

from . import _rules_arrays, _rules_control, _rules_elementwise  # noqa: F401 - they register what becomes of operations
from ._adjoint import adjoint, replaces_arrays
from ._analysis import rewrite
from ._derivatives import tangents
from ._gpu import to_gpu
from ._graph import Buffer, Graph, gc_paused
from ._in_xla import foreign_call
from ._kernel import llvm
from ._program import Leaf, Program
from ._trace import BufferArray, Primitive, Tracer, checked_kind
from .errors import ArgumentError, LoweringError, UnavailableError

Tree = Any  # numbers and arrays in tuples, lists, tables and classes that JAX knows as trees


class TracedFunction(NamedTuple):
    """A function as a graph; a leaf without a buffer carries nothing (the tangent of a whole number).

    Attributes:
        graph: exact, with dead nodes.
        arguments: buffers of the leaves of the arguments.
        results: the same for the results.
        tree: structure of the results, for JAX.
        shapes: shapes of the results' leaves.
    """

    graph: Graph
    arguments: list[Buffer]
    results: list[Buffer | None]
    tree: jax.tree_util.PyTreeDef
    shapes: list[tuple[int, ...]]


def trace(function: Callable[..., Tree], *examples: Tree) -> TracedFunction:
    """Trace a function of trees to a graph.

    Args:
        function: a JAX function; what it closes over is part of it.
        *examples: trees like its arguments; only shapes and types of their leaves matter.

    Raises:
        LoweringError: an operation that no kernel can do; names it and where it is written.
    """
    shapes = jax.tree.map(lambda x: jax.ShapeDtypeStruct(jnp.shape(x), jnp.result_type(x)), examples)
    closed, out = jax.make_jaxpr(function, return_shape=True)(*shapes)
    tracer = Tracer(Graph())
    arguments, values = [], []
    for (path, leaf), var in zip(jax.tree.leaves_with_path(shapes), closed.jaxpr.invars, strict=True):
        name = _path_name(path)
        kind = checked_kind(var.aval.dtype, f"argument {name}")
        buffer = tracer.graph.buffer("argument", kind or "real", leaf.shape, name)
        arguments.append(buffer)
        rows: Any = BufferArray(tracer.graph, buffer, leaf.shape)
        values.append(rows if leaf.shape else rows.at(()))
    outputs = tracer.closed(closed, values)
    leaves = jax.tree.leaves_with_path(out)
    results = [
        tracer.result(v, leaf, _path_name(path, "result")) for v, (path, leaf) in zip(outputs, leaves, strict=True)
    ]
    return TracedFunction(tracer.graph, arguments, results, jax.tree.structure(out), [leaf.shape for _, leaf in leaves])


def _path_name(path: Any, whole: str = "argument") -> str:
    text: str = jax.tree_util.keystr(path)
    return text or whole


@gc_paused()
def lower(function: Callable[..., Tree], *examples: Tree, title: str = "") -> tuple[Program, jax.tree_util.PyTreeDef]:
    """Lower a JAX function to a program; return it with the tree structure of the results.

    Args:
        function: function of trees of numbers and arrays, made of arithmetic, choices, calls and counted loops, such as
            a fixed-step integration with its number of steps fixed, or a derivative of it.
        *examples: trees like its arguments; shapes and types count, values do not.
        title: its name in error messages.

    Raises:
        LoweringError: an operation that no kernel can do; names it and where it is written.
    """
    traced = trace(function, *examples)
    graph = rewrite(traced.graph, lambda g, node, args: None, exact=True)
    arguments = [Leaf(b.name, b.kind, b.shape) for b in traced.arguments]
    results = [
        Leaf("" if b is None else b.name, None if b is None else b.kind, shape)
        for b, shape in zip(traced.results, traced.shapes, strict=True)
    ]
    return Program(graph, arguments, results, title), traced.tree


ENGINES = ("auto", "native", "gpu", "xla")


class Lowering(Protocol):
    """A function that lowers, such as `lower` or one that keeps its programs on disk."""

    def __call__(
        self, function: Callable[..., Tree], *examples: Tree, title: str
    ) -> tuple[Program, jax.tree_util.PyTreeDef]:
        """Return a program and the tree structure of its results."""
        ...


class CompiledFunction:
    """A function of trees, ready to be run.

    Attributes:
        engine: ``native``, ``gpu`` or ``xla``.
        reason: why it is not native although ``auto`` was requested; empty otherwise.
    """

    def __init__(
        self, function: Callable[..., Tree], examples: Sequence[Tree], engine: str, title: str, lower: Lowering
    ) -> None:
        self.function, self.engine, self.reason = function, "xla", ""
        self._shapes = [np.shape(leaf) for leaf in jax.tree.leaves(tuple(examples))]
        self._structure: Any = jax.tree.structure(tuple(examples))
        self._mapped: dict[Any, Callable[..., Any]] = {}
        if engine == "xla":
            return
        try:
            llvm()
            self._program, self._tree = lower(function, *examples, title=title)
            self.engine = "native"
            if engine == "gpu":
                self._program, self.engine = to_gpu(self._program), "gpu"
        except (LoweringError, UnavailableError) as error:
            if engine != "auto":
                raise
            self.reason = str(error)

    @property
    def program(self) -> Program:
        """Program of the function, which can be saved, and run without JAX.

        Raises:
            LoweringError: if the function runs by XLA.
        """
        if self.engine == "xla":
            raise LoweringError("the function", self.reason or "it was compiled for XLA")
        return self._program

    @property
    def tree(self) -> jax.tree_util.PyTreeDef:
        """Structure of the results of the program, for JAX."""
        return self._tree

    def __call__(
        self,
        *trees: Tree,
        lanes: int | None = None,
        mode: str = "default",
        real: str = "float64",
        threads: int | None = None,
    ) -> Any:
        """Run the function.

        Args:
            *trees: like the examples; leaves per lane have one axis more, the last.
            lanes: how many; None for one run.
            mode: mode of the native engine, see `Program`.
            real: type of the native engine's numbers, ``float64`` or ``float32``.
            threads: threads of the native engine, at most; all cores by default.

        Raises:
            ArgumentError: the trees are not like the examples.
        """
        if jax.tree.structure(trees) != self._structure:
            raise ArgumentError("arguments", "arguments must be trees like the examples")
        leaves = jax.tree.leaves(trees)
        if self.engine != "xla":
            results = self._program.call(leaves, lanes=lanes, mode=mode, real=real, threads=threads)
            return jax.tree.unflatten(
                self._tree, [self._empty_result(k) if v is None else v for k, v in enumerate(results)]
            )
        axes = tuple(self._axis(shape, leaf, lanes) for shape, leaf in zip(self._shapes, leaves, strict=True))
        return jax.tree.map(np.asarray, self._by_xla(axes, lanes is not None)(leaves))

    def _empty_result(self, place: int) -> np.ndarray:
        return np.zeros(self._program.results[place].shape, jax.dtypes.float0)

    def _axis(self, shape: tuple[int, ...], leaf: Any, lanes: int | None) -> int | None:
        leaf_shape = np.shape(leaf)
        if leaf_shape == shape:
            return None
        if lanes is None or leaf_shape != (*shape, lanes):
            raise ArgumentError(
                "argument",
                f"an argument must have the shape {shape}, with the lanes behind where it differs, got {leaf_shape}",
            )
        return len(shape)

    def _by_xla(self, axes: tuple[int | None, ...], lanes: bool) -> Callable[[Any], Any]:
        if (axes, lanes) not in self._mapped:

            def flat(*leaves: Any) -> Any:
                return self.function(*jax.tree.unflatten(self._structure, leaves))

            if lanes and any(a is not None for a in axes):
                flat = jax.vmap(flat, in_axes=axes, out_axes=-1)
            elif lanes:
                raise ArgumentError("lanes", "at least one argument must have a value per lane")
            jitted = jax.jit(flat)
            self._mapped[axes, lanes] = lambda leaves: jitted(*map(jnp.asarray, leaves))
        return self._mapped[axes, lanes]


LOWER: Lowering = lower  # whose name the parameter of `compile` hides


@gc_paused()
def compile(
    function: Callable[..., Tree], *examples: Tree, engine: str = "auto", title: str = "", lower: Lowering | None = None
) -> CompiledFunction:
    """Compile a JAX function for one lane or many.

    Args:
        function: function of trees; whole numbers that fix its structure are closed over, all else are arguments.
        *examples: trees like its arguments, for one lane.
        engine: ``native``, ``gpu`` (lanes on one of NVIDIA's, a single run on the processor), ``xla``, or ``auto``: native
            where the function can be lowered, else XLA.
        title: name of the function in error messages.
        lower: what lowers it, in place of `lanewise.lower`; it may find a program that was lowered before.

    Raises:
        ArgumentError: an unknown engine.
        LoweringError: with ``native`` or ``gpu``, an operation that no kernel can do.
        UnavailableError: with these, if LLVM cannot be loaded; with ``gpu``, no driver or no GPU.
    """
    if engine not in ENGINES:
        raise ArgumentError("engine", f"Unknown engine {engine!r}. Known are {', '.join(ENGINES)}")
    return CompiledFunction(function, examples, engine, title, lower or LOWER)


DIRECTIONS = 4  # that one kernel takes along, where lanes are taken otherwise
DTYPES = {"real": np.float64, "int": np.int64, "bool": np.bool_}


def differentiable(
    function: Callable[..., Tree],
    *examples: Tree,
    engine: str = "auto",
    title: str = "",
    mode: str = "default",
    threads: int | None = None,
    lower: Lowering | None = None,
) -> Callable[..., Tree]:
    """A JAX function that is computed, and differentiated, by native kernels.

    Args:
        function: function of trees, as for `compile`.
        *examples: trees like its arguments.
        engine: ``native``, ``xla``, or ``auto``: native where function and derivatives can be lowered, else the function
            itself.
        title: its name in error messages.
        mode: mode of the kernels, see `Program`.
        threads: threads of the kernels, at most; all cores by default.
        lower: as for `compile`.

    Returns:
        A function of trees like the examples, for JAX.

    Raises:
        ArgumentError: an unknown engine; when called, trees that are not like the examples.
        LoweringError: with ``native``, an operation that no kernel can do; when differentiated, a derivative of a
            derivative, or backwards through a loop whose trips are counted only when it runs, or that replaces a
            long array.
        UnavailableError: with ``native``, if LLVM cannot be loaded.
    """
    compiled = compile(function, *examples, engine=engine, title=title, lower=lower)
    if compiled.engine == "xla" or (engine == "auto" and replaces_arrays(compiled.program.graph)):
        return jax.jit(function)
    structure: Any = jax.tree.structure(tuple(examples))
    kernels = Derivatives(compiled.program, mode, threads)

    def run(*trees: Any) -> Any:
        if jax.tree.structure(trees) != structure:
            raise ArgumentError("arguments", "arguments must be trees like the examples")
        leaves = [
            _checked_leaf(x, leaf) for x, leaf in zip(jax.tree.leaves(trees), kernels.program.arguments, strict=True)
        ]
        results = iter(_RUN.bind(*leaves, kernels=kernels, depth=0))
        every = [
            np.zeros(leaf.shape, jax.dtypes.float0) if leaf.kind is None else next(results)
            for leaf in kernels.program.results
        ]
        return jax.tree.unflatten(compiled.tree, every)

    return run


def _checked_leaf(value: Any, leaf: Leaf) -> Any:
    if jnp.shape(value) != leaf.shape:
        raise ArgumentError(leaf.name, f"{leaf.name} must have the shape {leaf.shape}, got {jnp.shape(value)}")
    return jnp.asarray(value, DTYPES[leaf.kind or "real"])


class Derivatives:
    """A program and its derivatives, called with arrays whose leading axes are batches, of one element or of all."""

    def __init__(self, program: Program, mode: str, threads: int | None) -> None:
        self.program, self.options = program, {"mode": mode, "threads": threads}
        self.results = [leaf for leaf in program.results if leaf.kind is not None]
        self.differentiable_results = [leaf for leaf in self.results if leaf.kind == "real"]
        self.tangents = functools.cache(lambda places, count: tangents(program, places, count))
        self.adjoint = functools.cache(lambda places: adjoint(program, places))

    def run(self, arrays: Sequence[np.ndarray], depth: int) -> list[np.ndarray]:
        """Results, with the axes of all batches in front."""
        batch = _batch(arrays, depth)
        return _call_program(self.program, arrays, batch, self.options, self.results)

    def jvp(self, arrays: Sequence[np.ndarray], depth: int, places: tuple[int, ...]) -> list[np.ndarray]:
        """Tangents of the results, from arguments and their tangents at some places."""
        known, batch = len(self.program.arguments), _batch(arrays, depth)
        own = _batch(arrays[:known], depth)
        if _is_one(own):  # one run: its directions are the lanes
            return [
                x.squeeze(depth)
                for x in self._jvp_of_lanes(arrays, [np.expand_dims(x, depth) for x in arrays[known:]], batch, places)
            ]
        fixed = [k for k in range(depth) if own[k] == 1]
        sizes = [batch[k] for k in fixed]
        many, lanes = math.prod(sizes), tuple(n for k, n in enumerate(own) if k not in fixed)
        last = range(depth - len(fixed), depth)
        changes = []
        for x in arrays[known:]:
            whole = np.broadcast_to(x, [batch[k] if k in fixed else n for k, n in enumerate(x.shape)])
            moved = np.moveaxis(whole, fixed, last)
            changes.append(moved.reshape((*moved.shape[: len(lanes)], many, *x.shape[depth:])))
        primals = [x.squeeze(tuple(fixed)) for x in arrays[:known]]
        tangents = self._jvp_of_lanes(primals, changes, lanes, places)
        return [np.moveaxis(x.reshape((*lanes, *sizes, *x.shape[len(lanes) + 1 :])), last, fixed) for x in tangents]

    def _jvp_of_lanes(
        self, arrays: Any, changes: Any, batch: tuple[int, ...], places: tuple[int, ...]
    ) -> list[np.ndarray]:
        """Call the tangents with an axis of directions behind those of the batches."""
        depth, begin = len(batch), len(self.program.results)
        many = changes[0].shape[depth]
        count = min(many, DIRECTIONS)
        program = self.tangents(places, count)
        leaves, parts = program.results[begin:], []
        for k in range(0, many, count):
            few = [x[(slice(None),) * depth + (slice(k, k + count),)] for x in changes]
            rest = [(0, 0)] * depth + [(0, count - few[0].shape[depth])]
            some = [np.pad(x, rest + [(0, 0)] * (x.ndim - depth - 1)) for x in few]
            primals = [*arrays[: len(self.program.arguments)], *some]
            results = iter(
                _call_program(program, primals, batch, self.options, [x for x in leaves if x.kind is not None], begin)
            )
            parts.append(
                [
                    np.zeros((*batch, *leaf.shape)) if leaf.kind is None else next(results)
                    for leaf, own in zip(leaves, self.program.results, strict=True)
                    if own.kind == "real"
                ]
            )
        return [np.take(np.concatenate(p, depth), range(many), depth) for p in zip(*parts, strict=True)]

    def vjp(self, arrays: Sequence[np.ndarray], depth: int, places: tuple[int, ...]) -> list[np.ndarray]:
        """The derivatives by some places of a weighted sum of the results, from arguments and weights."""
        program, batch = self.adjoint(places), _batch(arrays, depth)
        begin = len(self.program.results)
        return _call_program(program, arrays, batch, self.options, program.results[begin:], begin)


def _batch(arrays: Sequence[Any], depth: int) -> tuple[int, ...]:
    """Sizes of the axes in front."""
    return tuple(np.broadcast_shapes(*(x.shape[:depth] for x in arrays))) if depth else ()


def _is_one(batch: tuple[int, ...]) -> bool:
    return all(n == 1 for n in batch)


def _call_program(
    program: Program,
    arrays: Sequence[np.ndarray],
    batch: tuple[int, ...],
    options: Any,
    leaves: Sequence[Leaf],
    begin: int = 0,
) -> list[np.ndarray]:
    """Results of a program from `begin` on, for arrays with the axes of batches in front."""
    depth, lanes = len(batch), int(np.prod(batch))
    if lanes == 0:
        return [np.zeros((*batch, *leaf.shape), DTYPES[leaf.kind or "real"]) for leaf in leaves]
    inputs = []
    for x, leaf in zip(arrays, program.arguments, strict=True):
        x = np.asarray(x)
        if _is_one(x.shape[:depth]):
            inputs.append(x.reshape(leaf.shape))
        else:
            whole = np.broadcast_to(x, (*batch, *leaf.shape)).reshape((lanes, *leaf.shape))
            inputs.append(np.moveaxis(whole, 0, -1))
    every = program.call(inputs, lanes=None if lanes == 1 else lanes, **options)[begin:]
    results = [x for x in every if x is not None]
    if lanes > 1:
        results = [np.moveaxis(x, -1, 0) for x in results]
    return [
        np.ascontiguousarray(x).reshape((*batch, *leaf.shape)).astype(DTYPES[leaf.kind or "real"], copy=False)
        for x, leaf in zip(results, leaves, strict=True)
    ]


def _primitive(
    name: str,
    host: Callable[..., Any],
    leaves: Callable[..., Sequence[Leaf]],
    direct: Callable[..., tuple[Program, int]] | None = None,
) -> Primitive:
    """A primitive of JAX that calls kernels, mapped by axes in front of all its arguments.

    Args:
        name: its name.
        host: what is called with the arrays.
        leaves: the leaves of its results.
        direct: program and first wanted result of a run, which XLA on a processor calls itself.
    """
    made = Primitive(name)
    made.multiple_results = True

    def shapes(*arrays: Any, kernels: Derivatives, depth: int, **more: Any) -> list[Any]:
        batch = _batch(arrays, depth)
        return [jax.ShapeDtypeStruct((*batch, *x.shape), DTYPES[x.kind or "real"]) for x in leaves(kernels, **more)]

    def call(*arrays: Any, kernels: Derivatives, depth: int, **more: Any) -> Any:
        def on_host(*arguments: Any) -> Any:
            return host(kernels, [np.asarray(x) for x in arguments], depth, **more)

        return jax.pure_callback(on_host, shapes(*arrays, kernels=kernels, depth=depth, **more), *arrays)

    def in_xla(*arrays: Any, kernels: Derivatives, depth: int, **more: Any) -> Any:
        found, wanted = None, shapes(*arrays, kernels=kernels, depth=depth, **more)
        if direct is not None and _is_one(_batch(arrays, depth)):
            program, begin = direct(kernels, **more)
            flat = [jax.ShapeDtypeStruct(s.shape[depth:], s.dtype) for s in wanted]
            found = foreign_call(program, str(kernels.options["mode"]), begin, flat, arrays)
        if found is None:
            return call(*arrays, kernels=kernels, depth=depth, **more)
        return [x.reshape(s.shape) for x, s in zip(found, wanted, strict=True)]

    def mapped(arrays: Any, axes: Any, *, depth: int, **more: Any) -> Any:
        moved = [
            jnp.expand_dims(x, 0) if axis is None else jnp.moveaxis(x, axis, 0)
            for x, axis in zip(arrays, axes, strict=True)
        ]
        results = made.bind(*moved, depth=depth + 1, **more)
        return results, [0] * len(results)

    def abstract(*arrays: Any, **more: Any) -> list[Any]:
        return [jax.core.ShapedArray(s.shape, s.dtype) for s in shapes(*arrays, **more)]

    made.def_impl(jax.jit(call, static_argnames=("kernels", "depth", "places")))
    made.def_abstract_eval(abstract)
    batching.primitive_batchers[made] = mapped
    mlir.register_lowering(made, mlir.lower_fun(call, multiple_results=True))
    mlir.register_lowering(made, mlir.lower_fun(in_xla, multiple_results=True), platform="cpu")
    return made


_RUN = _primitive(
    "native_run",
    lambda kernels, given, depth: kernels.run(given, depth),
    lambda kernels: kernels.results,
    lambda kernels: (kernels.program, 0),
)
_PUSH = _primitive(
    "native_tangents",
    lambda kernels, given, depth, places: kernels.jvp(given, depth, places),
    lambda kernels, places: kernels.differentiable_results,
)
_PULL = _primitive(
    "native_adjoint",
    lambda kernels, given, depth, places: kernels.vjp(given, depth, places),
    lambda kernels, places: [kernels.program.arguments[p] for p in places],
    lambda kernels, places: (kernels.adjoint(places), len(kernels.program.results)),
)


def _jvp_of_run(primals: Any, changes: Any, *, kernels: Derivatives, depth: int) -> tuple[Any, Any]:
    results = _RUN.bind(*primals, kernels=kernels, depth=depth)
    places = tuple(
        k
        for k, (x, leaf) in enumerate(zip(changes, kernels.program.arguments, strict=True))
        if leaf.kind == "real" and type(x) is not ad.Zero
    )
    moved = iter(())
    if places:
        moved = iter(_PUSH.bind(*primals, *(changes[p] for p in places), kernels=kernels, depth=depth, places=places))
    return results, [
        next(moved) if leaf.kind == "real" and places else ad.Zero(jax.typeof(x).to_tangent_aval())
        for x, leaf in zip(results, kernels.results, strict=True)
    ]


def _transpose_jvp(weights: Any, *arrays: Any, kernels: Derivatives, depth: int, places: tuple[int, ...]) -> list[Any]:
    known = len(kernels.program.arguments)
    if any(ad.is_undefined_primal(x) for x in arrays[:known]):
        raise LoweringError("a derivative of a derivative", "no kernel can do that")
    cotangents_in = [ad.instantiate_zeros(w) for w in weights]
    cotangents = _PULL.bind(*arrays[:known], *cotangents_in, kernels=kernels, depth=depth, places=places)
    out: list[Any] = [None] * known
    for x, slope in zip(arrays[known:], cotangents, strict=True):
        # what was one for all of a batch has the sum of their derivatives
        shape = x.aval.shape
        axes = tuple(k for k in range(depth) if shape[k] == 1 and slope.shape[k] != 1)
        out.append(jnp.sum(slope, axes, keepdims=True) if axes else slope)
    return out


def _refuse_second(*_: Any, **__: Any) -> Any:
    raise LoweringError("a derivative of a derivative", "no kernel can do that; use engine='xla'")


ad.primitive_jvps[_RUN] = _jvp_of_run
ad.primitive_transposes[_PUSH] = _transpose_jvp


def _jvp_of_jvp(
    primals: Any, changes: Any, *, kernels: Derivatives, depth: int, places: tuple[int, ...]
) -> tuple[Any, Any]:
    """Derivative by the tangents, in which a jvp is linear; by the arguments it would be a second derivative."""
    known = len(kernels.program.arguments)
    if any(type(x) is not ad.Zero for x in changes[:known]):
        _refuse_second()
    own = [ad.instantiate_zeros(x) for x in changes[known:]]
    more = {"kernels": kernels, "depth": depth, "places": places}
    return _PUSH.bind(*primals, **more), _PUSH.bind(*primals[:known], *own, **more)


ad.primitive_jvps[_PUSH] = _jvp_of_jvp
ad.primitive_jvps[_PULL] = _refuse_second
