"""No law pushes, at no length and pressure and with no parameters, and all its derivatives are finite everywhere."""

import functools
import math
from operator import itemgetter
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from law_examples import SEATED, SHIPPED, example, examples
from mckibben.muscles.build import construct
from mckibben.muscles.check import POINTS, evaluate, pressures, thread_length
from mckibben.muscles.law import TensionLaw, law_name
from mckibben.muscles.laws import law_type
from mckibben.quantities import Quantity, declared

# Half a minute of compilation: it solves an equilibrium in its law. Its potential, pull and closed cycles stay in the suite.
SEATED_LATER = [pytest.param(law, marks=pytest.mark.slow) if law in SEATED else law for law in SHIPPED]
EXAMPLES = [pytest.param(name, marks=pytest.mark.slow) if "seated" in name else name for name in examples()]

FREE_LENGTH = jax.jit(lambda law, pressure: law.free_length(pressure))
STATE = jax.jit(lambda law, span, pressure: itemgetter(0, 1, 2, -2, -1)(law.state(span, pressure)))


def _sum(law: TensionLaw, span: jax.Array, pressure: jax.Array) -> tuple[jax.Array, jax.Array]:
    tension = law.tension(span, pressure)
    return jnp.sum(tension), tension


SLOPES = jax.jit(jax.grad(_sum, argnums=(0, 1, 2), has_aux=True))  # to parameters, span and pressure; and the tension
# Where a declaration has no usual range: lengths from 3 cm to 3 m.
ANY_LENGTH = (0.03, 3.0)


def any_value(declaration: Quantity, unit: float) -> float:
    """A value from the usual range of a parameter for a number in [0, 1], whatever the other parameters are."""
    low, high = declaration.typical
    if declaration.typical == declaration.bounds and declaration.unit == "m" and high == 100.0:
        low, high = ANY_LENGTH
    if low >= 0.0 and high > 20.0 * low:  # many decades, and perhaps zero, which is a limit of its own
        return low if unit == 0.0 else max(low, 1e-6 * high) * (high / max(low, 1e-6 * high)) ** unit
    return low + (high - low) * unit


def any_law(name: str, draw: list[float]) -> TensionLaw:
    kind = law_type(name)
    fields = declared(kind)
    return construct(kind, {field: any_value(q, u) for (field, q), u in zip(fields.items(), draw, strict=False)})


def everywhere(law: TensionLaw) -> tuple[np.ndarray, np.ndarray]:
    """`POINTS` states: 1 mm to ten thread lengths by -1 to 20 bar, and all places where something begins or ends."""
    pressure = pressures(law, 40, lowest=-1e5, highest=20e5)
    thread = [thread_length(law), float(law.length_range()[0]), float(law.length_range()[1])]
    ends = np.array([np.nextafter(x, way) for x in thread for way in (0.0, x, math.inf)])
    length = np.concatenate([np.geomspace(1e-3, 10.0 * thread[0], 80), ends])
    # The boundary of slack. Without load the seats take up nothing, so that of the bare braid serves, which compiles fast.
    free = np.asarray(FREE_LENGTH(law.braid() if law_name(law) in SEATED else law, pressure))
    near = np.concatenate([free, np.nextafter(free, 0.0), np.nextafter(free, math.inf)])
    span, at = np.meshgrid(length, pressure, indexing="ij")
    span, at = np.concatenate([span.ravel(), near]), np.concatenate([at.ravel(), np.tile(pressure, 3)])
    assert span.size <= POINTS
    return np.pad(span, (0, POINTS - span.size), mode="edge"), np.pad(at, (0, POINTS - at.size), mode="edge")


def assert_pulls_or_hangs(law: TensionLaw) -> None:
    span, pressure = everywhere(law)
    (by_parameter, by_span, by_pressure), tension = SLOPES(law, span, pressure)
    if law_name(law) in SEATED:  # the slopes of its volume are in test_one_potential; they take long to compile
        at = {"F": np.asarray(tension), "F_L": np.asarray(by_span), "F_P": np.asarray(by_pressure)}
    else:
        at = evaluate(law, span, pressure) | {
            "F_L by grad": np.asarray(by_span),
            "F_P by grad": np.asarray(by_pressure),
        }
    assert (at["F"] >= 0.0).all()
    for what, value in at.items():
        bad = ~np.isfinite(value)
        assert not bad.any(), (what, span[bad][0], pressure[bad][0])
    for what, value in vars(by_parameter).items():
        if isinstance(value, jax.Array):
            assert np.isfinite(value), what


@pytest.mark.parametrize("name", EXAMPLES)
def test_no_example_pushes_and_its_derivatives_are_finite(name: str) -> None:
    assert_pulls_or_hangs(examples()[name])


@pytest.mark.parametrize("law", SEATED_LATER)
def test_no_law_pushes_with_any_parameters_and_its_derivatives_are_finite(law: str) -> None:
    count = len(declared(law_type(law)))

    @settings(max_examples=5 if law in SEATED else 40, deadline=None, database=None, derandomize=True)
    @given(st.lists(st.floats(0.0, 1.0), min_size=count, max_size=count))
    def check(draw: list[float]) -> None:
        assert_pulls_or_hangs(any_law(law, draw))

    check()


@pytest.mark.parametrize("law", SEATED_LATER)
def test_slack_is_reported_where_the_tension_is_zero_and_nowhere_else(law: str) -> None:
    muscle = example(law)
    span, pressure = everywhere(muscle)
    tension, passive, active, slack, overstretched = (np.asarray(x) for x in STATE(muscle, span, pressure))
    # At the boundary itself the compiler may round the force once for the flag and once for the tension: some 1e-16 of
    # the two parts that cancel there.
    rounding = 1e-12 * (np.abs(passive) + np.abs(active))
    taut = passive + active > rounding
    hangs = (passive + active < -rounding) | (passive + active == 0.0) & (rounding == 0.0)
    # Beyond the working range the law says nothing, and calls it overstretched, not slack.
    within = ~overstretched
    assert (taut & within).any()
    assert (hangs & within).any()
    assert (tension[taut] > 0.0).all()
    assert (tension[hangs] == 0.0).all()
    assert not slack[taut].any()
    assert slack[hangs & within].all()
    assert not slack[overstretched].any()
    assert (overstretched == (span > float(muscle.length_range()[1]))).all()


@pytest.mark.parametrize("law", [law for law in SHIPPED if law not in SEATED])
def test_scalars_arrays_jit_and_vmap_agree(law: str) -> None:
    muscle = example(law)
    span = np.linspace(0.7, 1.1, 5) * thread_length(muscle)
    pressure = np.linspace(0.3e5, 6e5, 4)
    table = np.asarray(muscle.tension(span[:, None], pressure))
    assert table.shape == (5, 4)
    assert (table > 0.0).any()
    one = muscle.tension(float(span[4]), float(pressure[3]))
    assert one.shape == ()
    assert one.dtype == np.float64
    # The same formula compiled in another order: some rounding of the largest term.
    close = {"rtol": 1e-12, "atol": 1e-12 * table.max()}
    np.testing.assert_allclose(one, table[4, 3], **close)
    np.testing.assert_allclose(jax.jit(muscle.tension)(span[:, None], pressure), table, **close)
    # In one piece, for each operation of its own is compiled otherwise; the table and the scalar above went the long way.
    by_map = jax.jit(jax.vmap(jax.vmap(muscle.tension, (None, 0)), (0, None)))(span, pressure)
    np.testing.assert_allclose(by_map, table, **close)
    stiffness = jax.jit(jax.vmap(jax.grad(muscle.tension), (0, None)))(span, pressure[3])
    assert np.isfinite(stiffness).all()
    np.testing.assert_allclose(
        stiffness, jax.jit(muscle.stiffness)(span, pressure[3]), rtol=1e-10, atol=1e-10 * abs(stiffness).max()
    )


def primitives(jaxpr: Any) -> set[str]:
    """Names of all operations of a jaxpr and of those inside them."""
    found = set()
    for equation in jaxpr.eqns:
        found.add(equation.primitive.name)
        for value in jax.tree.leaves(equation.params, is_leaf=lambda x: hasattr(x, "eqns") or hasattr(x, "jaxpr")):
            inner = getattr(value, "jaxpr", value)
            if hasattr(inner, "eqns"):
                found |= primitives(inner)
    return found


@functools.cache
def operations(law: str) -> set[str]:
    return primitives(jax.make_jaxpr(example(law).braid_tension)(0.2, 3e5).jaxpr)


@pytest.mark.parametrize("law", SHIPPED)
def test_the_tension_of_the_braid_is_a_straight_line(law: str) -> None:
    """What cannot be lowered later (LOWERING.md): loops, branches, searches, scatters, remainders, real powers."""
    banned = {
        "while",
        "cond",
        "rem",
        "argmin",
        "argmax",
        "sort",
        "scatter",
        "scatter-add",
        "scatter_add",
        "pow",
        "gather",
    }
    banned |= {"pure_callback", "io_callback", "debug_callback", "custom_root", "switch"}
    if law not in SEATED:  # five fixed steps
        banned.add("scan")
    assert "mul" in operations(law)  # the walk has found something
    assert not operations(law) & banned, operations(law) & banned


def test_the_loop_of_the_seated_braid_is_seen() -> None:
    # else the test above would pass for want of looking inside
    assert "scan" in operations("seated_braid")
