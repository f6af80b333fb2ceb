"""Friction takes energy and never makes any: over random paths with changing pressure, for random parameters."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mckibben.components.element import Hysteresis
from mckibben.errors import InputError
from mckibben.muscles.check import follow
from mckibben.muscles.hysteresis import (
    HYSTERESES,
    BoucWen,
    Coulomb,
    Dahl,
    FrictionLimit,
    MaxwellSlip,
    PlayMap,
    PrandtlIshlinskii,
)
from mckibben.quantities import declared, to_si

PIECES, FINE = 8, 48  # pieces of a path, and the steps in each
TRIES = settings(max_examples=40, deadline=None, database=None, derandomize=True)


def limits() -> st.SearchStrategy[FrictionLimit]:
    """Friction without pressure from 0.1 N, growing by up to 10 N/bar."""
    return st.builds(lambda c, q: FrictionLimit(constant=c, per_pressure=q), st.floats(0.1, 20.0), st.floats(0.0, 1e-4))


def of_kind(name: str) -> st.SearchStrategy[Hysteresis]:
    """Random frictions of one kind; the shapes stay, so that each is compiled once."""
    stiffness = st.floats(1e2, 1e5)
    if name == "coulomb":
        return st.builds(
            lambda f, v: Coulomb(limit=f, smoothing_velocity=v), limits(), st.sampled_from([0.0, 1e-3, 0.1])
        )
    if name == "dahl":
        return st.builds(lambda f, k: Dahl(limit=f, stiffness=k), limits(), stiffness)
    if name == "maxwell_slip":
        return st.builds(
            lambda f, d, r: MaxwellSlip.geometric(f, elements=6, shortest=d, longest=d * r, at_pressure=3e5),
            limits(),
            st.floats(1e-5, 5e-3),
            st.floats(1.0, 50.0),
        )
    if name.startswith("bouc_wen"):
        n = int(name[-1])
        return st.builds(
            lambda f, k, s: BoucWen(limit=f, stiffness=k, share=s, exponent=n), limits(), stiffness, st.floats(0.5, 5.0)
        )
    return st.builds(
        lambda w, r, q: PrandtlIshlinskii(weight=w, threshold=r, threshold_per_pressure=q),
        st.lists(st.floats(0.0, 1e5), min_size=4, max_size=4),
        st.lists(st.floats(1e-5, 1e-2), min_size=4, max_size=4),
        st.lists(st.floats(0.0, 1e-8), min_size=4, max_size=4),
    )


KINDS = ["coulomb", "dahl", "maxwell_slip", "bouc_wen_1", "bouc_wen_2", "prandtl_ishlinskii"]
MEMORY = [k for k in KINDS if k != "coulomb"]
EXAMPLES = {
    "coulomb": Coulomb(limit=FrictionLimit(constant=0.5, per_pressure=4e-6), smoothing_velocity=1e-3),
    "dahl": Dahl(limit=FrictionLimit(constant=0.5, per_pressure=4e-6), stiffness=2e3),
    "maxwell_slip": MaxwellSlip.geometric(FrictionLimit(constant=0.5, per_pressure=4e-6)),
    "bouc_wen_1": BoucWen(limit=FrictionLimit(constant=0.5, per_pressure=4e-6), stiffness=2e3, share=0.7, exponent=1),
    "bouc_wen_2": BoucWen(limit=FrictionLimit(constant=0.5, per_pressure=4e-6), stiffness=2e3, exponent=2),
    "prandtl_ishlinskii": PrandtlIshlinskii(
        weight=[1e3, 200.0, 50.0], threshold=[1e-4, 1e-3, 5e-3], threshold_per_pressure=[1e-9, 1e-9, 1e-8]
    ),
}
PATHS = st.lists(
    st.tuples(st.floats(-1.0, 1.0), st.floats(-0.9e5, 10e5)), min_size=PIECES, max_size=PIECES
)  # displacement of a piece, relative, and the gauge pressure at its end [Pa]


def fine_path(friction, pieces):
    """A path in steps no longer than the shortest yield travel at zero pressure, so that end forces tell the work."""
    travel = float(np.min(friction.travel(0.0))) if hasattr(friction, "travel") else 1e-3
    moves = np.repeat([m * travel for m, _ in pieces], FINE)
    marks = np.arange(PIECES + 1) * FINE
    return moves, np.interp(np.arange(PIECES * FINE + 1), marks, [1e5] + [p for _, p in pieces])


@pytest.mark.parametrize("kind", KINDS)
def test_no_path_yields_work(kind):
    @TRIES
    @given(of_kind(kind), PATHS)
    def check(friction, pieces):
        moves, pressures = fine_path(friction, pieces)
        before, after, work, lost, energy = (np.asarray(x) for x in follow(friction, moves, pressures))
        # From the forces alone, not from the ledger: what the outside has put in covers what is stored.
        put_in = np.cumsum(0.5 * (before + after) * moves)
        # Rounding: a few hundred sums of terms of at most that size.
        scale = 1e-12 * np.sum(np.abs(work)) + 1e-18
        assert np.all(put_in >= energy - scale)
        np.testing.assert_allclose(np.cumsum(work), put_in, atol=scale, rtol=0.0)
        assert np.all(lost >= 0.0)
        np.testing.assert_allclose(np.cumsum(work - lost), energy, atol=scale, rtol=0.0)

    check()


@pytest.mark.parametrize("kind", MEMORY)
def test_the_ledger_is_passive_for_steps_of_any_length(kind):
    @TRIES
    @given(of_kind(kind), PATHS, st.floats(1e-6, 10.0))
    def check(friction, pieces, length):
        moves = np.array([m * length for m, _ in pieces])
        pressures = np.array([1e5] + [p for _, p in pieces])
        _, after, work, lost, energy = (np.asarray(x) for x in follow(friction, moves, pressures))
        assert np.all(lost >= 0.0)
        scale = 1e-12 * np.sum(np.abs(work) + energy + lost) + 1e-18  # rounding, as above
        np.testing.assert_allclose(np.cumsum(work - lost), energy, atol=scale, rtol=0.0)
        largest = np.asarray(friction.largest_force(pressures[1:]))
        assert np.all(np.abs(after) <= largest * (1.0 + 1e-12))  # rounding of k * (Fc / k)

    check()


@pytest.mark.parametrize("kind", MEMORY)
def test_a_change_of_pressure_alone_does_no_work(kind):
    friction = EXAMPLES[kind]
    state = friction.advance(friction.initial(), 3e-3, start_pressure=5e5, end_pressure=5e5).state
    for p0, p1 in [(5e5, 0.0), (5e5, 8e5), (5e5, -0.8e5)]:
        out = friction.advance(state, 0.0, start_pressure=p0, end_pressure=p1)
        assert float(out.work) == 0.0  # the two terms are the same products with opposite signs
        assert float(out.dissipated) >= 0.0
        assert float(friction.stored_energy(out.state)) <= float(friction.stored_energy(state))


@pytest.mark.parametrize("kind", MEMORY)
def test_no_friction_without_a_limit(kind):
    """A limit of zero gives zero force, no NaN and finite derivatives."""
    friction = EXAMPLES[kind].lubricated(0.0)

    def force(f, dx):
        out = f.advance(f.initial(), dx, start_pressure=1e5, end_pressure=2e5)
        return f.force(out.state) + out.work

    for dx in (0.0, 1e-3, -1e-3):
        assert float(force(friction, dx)) == 0.0
        slopes = jax.tree.leaves(jax.grad(force, argnums=(0, 1))(friction, dx))
        assert all(np.all(np.isfinite(x)) for x in slopes)


@pytest.mark.parametrize("kind", KINDS)
def test_friction_does_not_know_the_rate(kind):
    friction = EXAMPLES[kind]
    if kind == "coulomb":
        friction = friction.replace(smoothing_velocity=0.0)
    moves, pressures = fine_path(friction, [(1.0, 3e5), (-0.5, 1e5), (0.7, 8e5), (-1.0, 0.0)] * 2)
    slow, fast = follow(friction, moves, pressures, 10.0), follow(friction, moves, pressures, 1e-5)
    for a, b in zip(slow, fast, strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("kind", ["maxwell_slip", "prandtl_ishlinskii"])
def test_a_slipping_contact_does_not_know_the_step(kind):
    """At constant pressure one long step and many short ones end in the same state."""
    friction = EXAMPLES[kind]
    start = friction.advance(friction.initial(), -4e-3, start_pressure=5e5, end_pressure=5e5).state
    once = friction.advance(start, 7e-3, start_pressure=5e5, end_pressure=5e5).state
    state = start
    for _ in range(100):
        state = friction.advance(state, 7e-5, start_pressure=5e5, end_pressure=5e5).state
    np.testing.assert_allclose(state, once, rtol=0.0, atol=1e-16)  # 100 roundings of millimetres


def test_the_loop_of_one_contact_has_the_area_of_its_parallelogram():
    """4 Fc (A - d) for an amplitude A; exact where steps end at the corners, as here."""
    contact = MaxwellSlip.geometric(FrictionLimit(constant=2.0), elements=1, shortest=1e-3, longest=1e-3)
    cycle = np.concatenate([np.full(40, 1e-4), np.full(80, -1e-4), np.full(80, 1e-4)])
    _, _, work, lost, energy = follow(contact, cycle, np.zeros(201))
    last = slice(40, 200)  # the loop from the largest length round to it again
    np.testing.assert_allclose(np.sum(work[last]), 4 * 2.0 * (4e-3 - 1e-3), rtol=1e-12)  # 160 roundings
    np.testing.assert_allclose(np.sum(lost[last]), np.sum(work[last]), rtol=1e-12)


@pytest.mark.parametrize(
    ("friction", "exact"),
    [
        (Dahl(limit=FrictionLimit(constant=2.0), stiffness=1e3), lambda x: -np.expm1(-x)),
        (BoucWen(limit=FrictionLimit(constant=2.0), stiffness=1e3, exponent=1), lambda x: -np.expm1(-x)),
        (BoucWen(limit=FrictionLimit(constant=2.0), stiffness=1e3, exponent=2), np.tanh),
    ],
)
def test_gradual_friction_follows_its_equation_with_order_two(friction, exact):
    errors = []
    for steps in (20, 40, 80):
        after = follow(friction, np.full(steps, 4e-3 / steps), np.zeros(steps + 1))[1]
        x = 2.0 * np.arange(1, steps + 1) / steps  # travels moved; d = 2 mm
        errors.append(np.max(np.abs(after - 2.0 * exact(x))))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(np.abs(orders - 2.0) < 0.1)  # the next term is two orders smaller
    assert errors[-1] < 2e-4  # N, of 2 N


@TRIES
@given(limits(), st.floats(1e2, 1e5), PATHS)
def test_dahl_is_bouc_wen_with_gamma_zero(limit, stiffness, pieces):
    dahl, wen = Dahl(limit=limit, stiffness=stiffness), BoucWen(limit=limit, stiffness=stiffness, share=1.0, exponent=1)
    moves, pressures = fine_path(dahl, pieces)
    for a, b in zip(follow(dahl, moves, pressures), follow(wen, moves, pressures), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-13)  # same formula, hundreds of roundings


@TRIES
@given(of_kind("maxwell_slip"), PATHS)
def test_stops_are_maxwell_slip_elements(maxwell, pieces):
    stops = PrandtlIshlinskii(
        weight=maxwell.stiffness,
        threshold=maxwell.limit.constant / maxwell.stiffness,
        threshold_per_pressure=maxwell.limit.per_pressure / maxwell.stiffness,
    )
    moves, pressures = fine_path(maxwell, pieces)
    for a, b in zip(follow(maxwell, moves, pressures), follow(stops, moves, pressures), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-13)  # thresholds differ in the last bit


def test_wens_coefficients_give_the_same_curve_and_active_ones_are_refused():
    wen = BoucWen.from_coefficients(stiffness=1e3, beta=300.0, gamma=200.0, exponent=1)
    np.testing.assert_allclose(wen.largest_force(0.0), 1e3 / 500.0, rtol=1e-15)
    np.testing.assert_allclose(wen.share, 0.6, rtol=1e-15)
    for beta, gamma in [(1.0, 1.5), (1.0, -1.5), (0.0, 0.0), (-1.0, 2.0)]:
        with pytest.raises(InputError, match="gamma"):
            BoucWen.from_coefficients(stiffness=1e3, beta=beta, gamma=gamma)
    with pytest.raises(InputError, match="share"):
        BoucWen(limit=FrictionLimit(constant=1.0), stiffness=1e3, share=0.4)
    with pytest.raises(InputError, match="exponent"):
        BoucWen(limit=FrictionLimit(constant=1.0), stiffness=1e3, exponent=3)


@pytest.mark.parametrize(("muscle", "newton"), [("nylon", 2.5), ("fiberglass", 5.0), ("Bridgestone", 5.0)])
def test_constant_coulomb_friction_as_printed(muscle, newton):
    """Chou and Hannaford (1996), Table 1: positive for lengthening, negative for shortening."""
    sharp = Coulomb(limit=FrictionLimit(constant=newton))
    soft = sharp.replace(smoothing_velocity=1e-3)
    for friction in (sharp, soft):
        force = friction.force(friction.initial(), jnp.array([-0.07, -1e-3, 0.0, 1e-3, 0.07]), 5e5)
        np.testing.assert_array_equal(force, [-newton, -newton, 0.0, newton, newton])
    np.testing.assert_allclose(soft.force(soft.initial(), 5e-4), newton * 0.6875, rtol=1e-15)  # u (3 - u^2)/2 at 1/2
    out = sharp.advance(sharp.initial(), -0.035, start_pressure=5e5, end_pressure=5e5)
    assert float(out.work) == float(out.dissipated) == pytest.approx(newton * 0.035, rel=1e-15)


def test_the_friction_of_the_nylon_muscle_grows_from_the_threshold_to_the_printed_value():
    friction = MaxwellSlip.geometric(FrictionLimit(constant=0.5, per_pressure=0.4e-5))
    np.testing.assert_allclose(
        friction.largest_force(jnp.array([-0.5e5, 0.0, 1e5, 5e5])), [0.5, 0.5, 0.9, 2.5], rtol=1e-14
    )
    travel = friction.travel(5e5)
    np.testing.assert_allclose(travel[jnp.array([0, 7])], [0.2e-3, 8e-3], rtol=1e-14)
    np.testing.assert_allclose(travel[1:] / travel[:-1], 40.0 ** (1 / 7), rtol=1e-14)
    np.testing.assert_allclose(friction.limit.force(5e5), 2.5 / 8, rtol=1e-14)  # of equal force


@pytest.mark.parametrize("kind", KINDS)
def test_lubricant_takes_a_tenth_of_the_loop(kind):
    """Three lubricants on the nylon muscle: 10 % less friction, here far beyond every yield travel."""
    dry = EXAMPLES[kind]
    heights = []
    for friction in (dry, dry.lubricated()):
        after = follow(friction, np.repeat([2e-4, -2e-4], 300), np.full(601, 5e5))[1]
        heights.append(float(after[299] - after[-1]))
    assert heights[1] / heights[0] == pytest.approx(0.9, abs=1e-9)  # 60 mm are 48 travels of 1.25 mm: exp(-48)


@pytest.mark.parametrize("kind", KINDS)
def test_batches_are_the_single_muscle_many_times(kind):
    """Leading axes of the state, and vmap over parameters, agree with one muscle after the other."""
    friction = EXAMPLES[kind]
    moves, p0, p1 = jnp.array([1e-3, -2e-3, 0.0]), jnp.array([1e5, 5e5, 0.0]), jnp.array([2e5, 4e5, -0.5e5])
    state = jnp.broadcast_to(friction.initial(), (3, friction.initial().size))

    def go(f, z, dx, a, b):
        out = f.advance(z, dx, start_pressure=a, end_pressure=b, duration=1e-3)
        return out, f.force(out.state, dx / 1e-3, b) + 0.0 * f.stored_energy(out.state), f.largest_force(b)

    single = [go(friction, friction.initial(), moves[i], p0[i], p1[i]) for i in range(3)]
    stacked = jax.tree.map(lambda *x: jnp.stack(x), *single)
    mapped = jax.jit(jax.vmap(go, in_axes=(None, 0, 0, 0, 0)))(friction, state, moves, p0, p1)
    fleet = jax.tree.map(lambda x: jnp.stack([x] * 3), friction)
    for result in (go(friction, state, moves, p0, p1), mapped, jax.vmap(go)(fleet, state, moves, p0, p1)):
        for a, b in zip(jax.tree.leaves(result), jax.tree.leaves(stacked), strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-13, atol=1e-16)  # fused multiply-adds


@pytest.mark.parametrize("kind", KINDS)
def test_derivatives_are_finite_everywhere(kind):
    friction = EXAMPLES[kind]

    def total(f, moves, pressures):
        before, after, work, lost, energy = follow(f, moves, pressures)
        return jnp.sum(after) + jnp.sum(work) + jnp.sum(lost) + energy[-1]

    slope = jax.jit(jax.grad(total, argnums=(0, 1, 2)))
    for moves in (np.zeros(12), np.full(12, 1e-3), np.array([1e-4, -5e-2, 0.0] * 4), np.array([1e-9, 5.0, -5.0] * 4)):
        for pressures in (np.zeros(13), np.full(13, 5e5), np.linspace(8e5, -0.9e5, 13)):
            assert all(np.all(np.isfinite(x)) for x in jax.tree.leaves(slope(friction, moves, pressures)))


def primitives(jaxpr) -> set[str]:
    """Names of all primitives in a jaxpr and in those inside it."""
    found: set[str] = set()
    for equation in jaxpr.eqns:
        found.add(equation.primitive.name)
        for value in jax.tree.leaves(list(equation.params.values()), is_leaf=lambda v: hasattr(v, "eqns")):
            inner = getattr(value, "jaxpr", value)
            found |= primitives(inner) if hasattr(inner, "eqns") else set()
    return found


FORBIDDEN = {"while", "cond", "scan", "rem", "argmin", "argmax", "sort", "pow", "custom_root", "gather"}


@pytest.mark.parametrize("kind", KINDS)
def test_advance_and_force_are_straight_line(kind):
    friction = EXAMPLES[kind]

    def go(z, dx, p0, p1, dt):
        out = friction.advance(z, dx, start_pressure=p0, end_pressure=p1, duration=dt)
        return out, friction.force(out.state, dx, p1), friction.stored_energy(out.state)

    found = primitives(jax.make_jaxpr(go)(friction.initial(), 1e-3, 1e5, 2e5, 1e-3).jaxpr)
    assert not found & FORBIDDEN, found & FORBIDDEN
    assert not any(name.startswith("scatter") for name in found)


def test_every_kind_is_in_the_table_and_its_parameters_carry_units():
    assert {k.rsplit("_", 1)[0] if k[-1] in "12" else k for k in KINDS} == set(HYSTERESES)
    for kind in (*HYSTERESES.values(), FrictionLimit, PlayMap):
        for name, q in declared(kind).items():
            assert to_si(1.0, q.unit, q.unit, field=name) == 1.0
            assert q.doc


def test_parameters_out_of_bounds_are_refused():
    with pytest.raises(InputError, match="constant"):
        FrictionLimit(constant=-1.0)
    with pytest.raises(InputError, match="constant"):
        EXAMPLES["dahl"].lubricated(-0.5)
    with pytest.raises(InputError, match="stiffness"):
        Dahl(limit=FrictionLimit(constant=1.0), stiffness=0.0)
    with pytest.raises(InputError, match="elements"):
        MaxwellSlip.geometric(FrictionLimit(constant=1.0), elements=0)
