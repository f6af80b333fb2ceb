"""A chain of links: its accelerations against those of Lagrange's function, a textbook's double pendulum, and energy."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mckibben.assembly.loads import ChainLink, JointLoad, LinkChain, MomentArm
from mckibben.assembly.loads.joint import ChainState, JointState
from mckibben.errors import InputError

GRAVITY = 9.81
FREE = {"lower_stop": -10.0, "upper_stop": 10.0}


def chain(*links, arms=None, **more):
    """Links named 1, 2, .. of (length, mass, centre, inertia)."""
    names = tuple(str(k + 1) for k in range(len(links)))
    keys = ("length", "mass", "centre", "inertia")
    made = {n: ChainLink(**dict(zip(keys, link, strict=True)), **FREE) for n, link in zip(names, links, strict=True)}
    return LinkChain(made, arms or {}, order=names, gravity=GRAVITY, **more)


THREE = chain((0.3, 0.5, 0.14, 4e-3), (0.25, 0.3, 0.1, 1.5e-3), (0.2, 0.2, 0.12, 7e-4))


def lagrangian(load, angles, rates):
    """Kinetic less potential energy, from where the centres of mass are and how they move."""

    def centres(q):
        directions = jnp.cumsum(q)
        hinge, points = jnp.zeros(2), []
        for link, direction in zip(load.links.values(), directions, strict=True):
            along = jnp.stack([jnp.sin(direction), -jnp.cos(direction)])
            points.append(hinge + link.centre * along)
            hinge = hinge + link.length * along
        return jnp.stack(points)

    points, speeds = jax.jvp(centres, (angles,), (rates,))
    masses = jnp.stack([link.mass for link in load.links.values()])
    inertias = jnp.stack([link.inertia for link in load.links.values()])
    kinetic = 0.5 * jnp.sum(masses * jnp.sum(speeds**2, axis=1)) + 0.5 * jnp.sum(inertias * jnp.cumsum(rates) ** 2)
    return kinetic - GRAVITY * jnp.sum(masses * points[:, 1])


def by_lagrange(load, angles, rates, moments):
    """Accelerations that Lagrange's equations give: d/dt dL/dq' - dL/dq = moment."""
    own = functools.partial(lagrangian, load)
    mass = jax.hessian(own, 1)(angles, rates)
    turning = jax.jacobian(jax.grad(own, 1), 0)(angles, rates) @ rates
    return jnp.linalg.solve(mass, moments + jax.grad(own, 0)(angles, rates) - turning)


def accelerations(load, angles, rates, tensions=None, inputs=None):
    state = ChainState(tuple(angles), tuple(rates))
    return jnp.stack(load.rates(state, tensions or {}, inputs or {}).velocity)


def test_coupled_links_accelerate_as_the_equations_of_lagrange_say():
    rng = np.random.default_rng(1)
    arm = MomentArm(coefficients=jnp.array([0.02, -0.004]), span=0.13)
    back = MomentArm(coefficients=jnp.array([-0.015]), span=0.13)
    load = LinkChain(THREE.links, {"one": {"1": arm}, "two": {"2": back, "3": arm}}, order=THREE.order, gravity=GRAVITY)
    compared = jax.jit(by_lagrange), jax.jit(accelerations)
    for _ in range(8):
        angles, rates = jnp.asarray(rng.uniform(-2.0, 2.0, 3)), jnp.asarray(rng.uniform(-8.0, 8.0, 3))
        tensions = {"one": jnp.asarray(90.0), "two": jnp.asarray(40.0)}
        moments = jnp.stack([90.0 * arm.arm(angles[0]), 40.0 * back.arm(angles[1]), 40.0 * arm.arm(angles[2])])
        wanted, got = compared[0](load, angles, rates, moments), compared[1](load, angles, rates, tensions)
        # rounding, enlarged by the condition of the mass matrix, some 1e2
        np.testing.assert_allclose(got, wanted, rtol=1e-11, atol=1e-11 * float(jnp.abs(wanted).max()))


def test_two_point_masses_move_as_the_double_pendulum_of_the_textbook():
    m1, m2, l1, l2, g = 0.7, 0.4, 0.5, 0.35, GRAVITY
    load = chain((l1, m1, l1, 0.0), (l2, m2, l2, 0.0))

    def textbook(_, y):
        """Of two masses on massless rods, solved for the accelerations by hand; absolute angles."""
        a, b, u, v = y
        d = 2.0 * m1 + m2 - m2 * np.cos(2.0 * a - 2.0 * b)
        first = -g * (2.0 * m1 + m2) * np.sin(a) - m2 * g * np.sin(a - 2.0 * b)
        first = (first - 2.0 * np.sin(a - b) * m2 * (v**2 * l2 + u**2 * l1 * np.cos(a - b))) / (l1 * d)
        second = u**2 * l1 * (m1 + m2) + g * (m1 + m2) * np.cos(a) + v**2 * l2 * m2 * np.cos(a - b)
        return [u, v, first, 2.0 * np.sin(a - b) * second / (l2 * d)]

    rate = jax.jit(lambda y: jnp.concatenate([y[2:], accelerations(load, y[:2], y[2:])]))
    begin = np.array([1.2, -0.5, 0.0, 1.0])  # of the joints: relative
    options = {"method": "DOP853", "rtol": 1e-10, "atol": 1e-10}
    ours = solve_ivp(lambda t, y: np.asarray(rate(y)), (0.0, 2.0), begin, **options).y[:, -1]
    theirs = solve_ivp(textbook, (0.0, 2.0), np.concatenate([np.cumsum(begin[:2]), np.cumsum(begin[2:])]), **options).y[
        :, -1
    ]
    # both solvers' tolerance of 1e-10, which the motion enlarges by some 1e2 in two seconds
    np.testing.assert_allclose(np.concatenate([np.cumsum(ours[:2]), np.cumsum(ours[2:])]), theirs, atol=1e-7)


def test_a_free_chain_keeps_its_energy():
    rate = jax.jit(lambda y: jnp.concatenate([y[3:], accelerations(THREE, y[:3], y[3:])]))
    begin = np.array([1.0, 0.4, -0.7, 0.0, 2.0, -1.0])
    run = solve_ivp(lambda t, y: np.asarray(rate(y)), (0.0, 1.0), begin, method="DOP853", rtol=1e-10, atol=1e-10)
    energy = [float(THREE.stored_energy(ChainState(tuple(y[:3]), tuple(y[3:])))) for y in run.y.T[:: len(run.t) // 8]]
    # the solver's tolerance over some hundred steps, of an energy of some joules
    np.testing.assert_allclose(energy, energy[0], rtol=1e-8)


def test_what_the_muscles_deliver_is_what_the_chain_gains():
    """Power balance at a moment: dE/dt = moments times rates, for a muscle over two joints."""
    arm = MomentArm(coefficients=jnp.array([0.02, -0.004]), span=0.13)
    load = LinkChain(THREE.links, {"m": {"1": arm, "2": arm}}, order=THREE.order, gravity=GRAVITY)
    state = ChainState(tuple(jnp.array([0.3, 0.5, -0.2])), tuple(jnp.array([1.0, -2.0, 0.5])))
    tension = {"m": jnp.asarray(80.0)}
    _, gain = jax.jvp(load.stored_energy, (state,), (load.rates(state, tension, {}),))
    delivered = -tension["m"] * load.spans(state, {})["m"].velocity
    assert float(gain) == pytest.approx(float(delivered), rel=1e-12)  # rounding


def test_a_muscle_about_an_unknown_joint_is_refused():
    with pytest.raises(InputError, match="joints of m must be among 1, 2, 3, got 4"):
        LinkChain(THREE.links, {"m": {"4": MomentArm(coefficients=jnp.array([0.02]), span=0.1)}}, order=THREE.order)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_stop_counts_among_the_modes_from_before_it_is_met(side):
    """It is met within 10 ms of an angle that moves towards it, and not of one that moves away."""
    joint = JointLoad(arms={}, inertia=0.01, lower_stop=-1.0, upper_stop=1.0, stop_stiffness=2e4)
    stiff = np.sqrt(2e4 / 0.01)
    met = {(1.01, 0.0): stiff, (0.995, 1.0): stiff, (0.995, -1.0): 0.0, (0.98, 1.0): 0.0, (0.98, -3.0): 0.0}
    for (angle, rate), bound in met.items():
        found = float(joint.max_rate_bound(JointState(side * angle, side * rate), {}))
        assert found == pytest.approx(bound, rel=1e-14)  # rounding
