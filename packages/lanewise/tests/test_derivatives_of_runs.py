"""Tangents and adjoints made of a program itself: JAX's values, in every lane and width the same bits."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from c_programs import COMPILER, InC, same_bits
from lanewise import ArgumentError, LoweringError, Program, adjoint, lower, tangents
from lowered_examples import CASES, OTHERS, orbit_program, orbit_values
from lowered_systems import positions, rubbing

SAMPLES, INNER = 70, 5  # the signal is long enough to be read from memory


def bent(x, y):
    """What has a corner where it is looked at, and what says its slope itself."""
    return (
        jnp.maximum(x, y) + 3.0 * jnp.minimum(x, 0.0),
        jnp.abs(x) + 2.0 * jnp.abs(-y),
        jnp.tanh(x),
        jnp.sign(x) * y,
        told(x, y) * y,
    )


@jax.custom_jvp
def told(x, y):
    return x * y + x


@told.defjvp
def _(at, by):
    return told(*at), 7.0 * at[1] * by[0] - by[1]  # not its slope, so that it is seen whose is taken


def held(x, y):
    return x * jax.lax.stop_gradient(x * y), jax.lax.stop_gradient(y) + y


def solved(x, y):
    matrix = jnp.array([[2.0, x, 0.0], [y, 3.0, x * y], [0.1, 0.0, 1.0 + x * x]])
    return jnp.linalg.solve(matrix, jnp.array([x, 1.0, y]))


def channels(x, rows):
    _, (a, _) = CASES["loops"][0](x, rows)
    return jnp.stack([a, a * rows])  # long ones


RUNS = {
    "arithmetic": (CASES["arithmetic"][0], (1.3, -0.4)),
    "elementary": (CASES["elementary"][0], (1.3, -0.4)),
    "tables": (CASES["tables"][0], CASES["tables"][1]),
    "loops": (CASES["loops"][0], CASES["loops"][1]),
    "channels": (channels, (0.3, np.linspace(-1.0, 2.0, 90))),
    "corners": (bent, (0.0, 0.0)),
    "slopes": (bent, (0.3, 0.8)),
    "held": (held, (0.3, 0.8)),
    "solved": (solved, (0.3, 0.8)),
    "steps": (positions(SAMPLES, INNER), rubbing(SAMPLES)),
    "stiff steps": (positions(SAMPLES, INNER, stiff=True), rubbing(SAMPLES)),
}


class Case:
    """A function, its program, and both derivatives by all its real arguments, by kernels and by JAX."""

    def __init__(self, function, arguments):
        self.program, _ = lower(function, *arguments)
        self.values = [np.asarray(x) for x in jax.tree.leaves(arguments)]
        self.places = [k for k, leaf in enumerate(self.program.arguments) if leaf.kind == "real"]
        structure = jax.tree.structure(arguments)

        def flat(*given):
            full = list(self.values)
            for k, x in zip(self.places, given, strict=True):
                full[k] = x
            leaves = jax.tree.leaves(function(*jax.tree.unflatten(structure, full)))
            return [x for x in leaves if jnp.issubdtype(jnp.asarray(x).dtype, jnp.floating)]

        self.flat, self.real = flat, [jnp.asarray(self.values[k], float) for k in self.places]
        chance = np.random.default_rng(4)
        self.changes = [chance.normal(size=x.shape) * (np.abs(x) + 0.1) for x in self.real]
        self.weights = [chance.normal(size=x.shape) for x in jax.eval_shape(flat, *self.real)]

    def forwards(self, changes):
        """Changes of the real results for those of the real arguments, (directions, ...) each."""
        made = tangents(self.program, self.places, len(changes[0]))
        rows = zip(self.program.results, made.call([*self.values, *changes])[len(self.program.results) :], strict=True)
        nothing = lambda leaf: np.zeros((len(changes[0]), *leaf.shape))  # noqa: E731
        return [nothing(leaf) if x is None else x for leaf, x in rows if leaf.kind == "real"]

    def backwards(self, most=1_000_000):
        """Derivatives by the real arguments of the weighted sum."""
        made = adjoint(self.program, self.places, most=most)
        return made.call([*self.values, *self.weights])[len(self.program.results) :]


def agree(found, want):
    """To rounding of up to 350 steps; the largest of an array counts, for derivatives pass through zero."""
    for a, b in zip(found, map(np.asarray, want), strict=True):
        np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-12 * np.abs(b).max(initial=0.0))


@pytest.mark.parametrize("name", RUNS)
def test_tangents_are_those_of_jax(name):
    case = Case(*RUNS[name])
    want = jax.jit(lambda: jax.jvp(case.flat, case.real, list(map(jnp.asarray, case.changes)))[1])()
    agree([x[0] for x in case.forwards([c[None] for c in case.changes])], want)


@pytest.mark.parametrize("name", RUNS)
def test_adjoints_are_those_of_jax_whether_much_is_kept_or_little(name):
    case = Case(*RUNS[name])
    want = jax.jit(lambda: jax.vjp(case.flat, *case.real)[1](list(map(jnp.asarray, case.weights))))()
    agree(case.backwards(), want)
    agree(case.backwards(most=0), want)


def test_derivatives_at_other_places_are_those_of_jax():
    function, _ = CASES["arithmetic"]
    for x, y in OTHERS["arithmetic"][:2]:
        case = Case(function, (x, y))
        want = jax.jvp(case.flat, case.real, list(map(jnp.asarray, case.changes)))[1]
        if np.isfinite(np.asarray(want)).all():  # the root of zero has no derivative
            agree([v[0] for v in case.forwards([c[None] for c in case.changes])], want)


def test_directions_go_side_by_side():
    case = Case(positions(SAMPLES, INNER), rubbing(SAMPLES))
    chance = np.random.default_rng(3)
    many = [chance.normal(size=(3, *x.shape)) for x in case.changes]
    together = case.forwards(many)
    for k in range(3):
        one = case.forwards([x[k : k + 1] for x in many])
        agree([x[k] for x in together], [x[0] for x in one])  # shortened otherwise, so to rounding only


def orbit_places():
    names = [leaf.name for leaf in orbit_program().arguments]
    wanted = ("['planet']['mass']", "['ship']['mass']", "['drag']", "['softening']")
    return [next(k for k, n in enumerate(names) if n.endswith(w)) for w in wanted]


@pytest.mark.slow
def test_tangents_of_an_orbit_are_differences_of_the_strict_kernel():
    program, values, places = orbit_program(), orbit_values(), orbit_places()
    seeds = [np.eye(4)[k] for k in range(4)]
    seeds = [
        s.reshape(4, *np.shape(values[p])) if np.size(values[p]) == 1 else s for s, p in zip(seeds, places, strict=True)
    ]
    found = tangents(program, places, 4).call([*values, *seeds])[2:]
    for k, place in enumerate(places):
        step = 1e-5 * float(np.ravel(values[place])[0])
        ends = []
        for sign in (1.0, -1.0):
            moved = list(values)
            moved[place] = np.asarray(values[place]) + sign * step
            ends.append(program.call(moved, mode="strict"))
        for tangent, high, low in zip(found, *ends, strict=True):
            rough = (high - low) / (2.0 * step)
            # central differences: rounding over the step, 1e-16 / 1e-5 of what changes little, and its square by curvature
            np.testing.assert_allclose(tangent[k], rough, rtol=0.0, atol=2e-4 * np.abs(rough).max())


def test_forwards_and_backwards_are_transposed():
    program, values, places = orbit_program(), orbit_values(), orbit_places()
    chance = np.random.default_rng(8)
    changes = [chance.normal(size=np.shape(values[p])) * np.asarray(values[p]) for p in places]
    forwards = tangents(program, places, 1).call([*values, *(c[None] for c in changes)])[2:]
    weights = [chance.normal(size=x.shape[1:]) / np.abs(x).max() for x in forwards]
    backwards = adjoint(program, places).call([*values, *weights])[2:]
    parts = [float(np.sum(g * c)) for g, c in zip(backwards, changes, strict=True)]
    along = sum(float(np.sum(w * x[0])) for w, x in zip(weights, forwards, strict=True))
    assert sum(parts) == pytest.approx(along, rel=1e-12, abs=1e-12 * sum(map(abs, parts)))


@pytest.mark.parametrize("derive", [lambda p, k: tangents(p, k, 2), adjoint])
def test_any_width_and_any_lane_have_the_same_bits(derive):
    case = Case(positions(SAMPLES, INNER), rubbing(SAMPLES))
    made = derive(case.program, case.places)
    chance = np.random.default_rng(5)
    more = [chance.normal(size=leaf.shape) for leaf in made.arguments[len(case.values) :]]
    many = [np.stack([v, 1.01 * v, 1.02 * v], -1) if k in case.places else v for k, v in enumerate(case.values)]
    results = [made.call([*many, *more], lanes=3, width=width) for width in (1, 2, 8)]
    alone = made.call([*[v[..., 1] if k in case.places else v for k, v in enumerate(many)], *more])
    for first, second, third, single in zip(*results, alone, strict=True):
        if single is not None:
            np.testing.assert_array_equal(first, second)
            np.testing.assert_array_equal(first, third)
            np.testing.assert_array_equal(first[..., 1], single)


def test_places_that_differ_from_lane_to_lane_get_their_own_derivatives():
    function, (_, table) = CASES["tables"]
    program, _ = lower(function, 1.3, table)
    at = np.array([0.2, 1.3, 2.4, 0.9, 1.7])
    results = adjoint(program, [0, 1]).call([at, table, np.ones(())], lanes=5)
    for k, x in enumerate(at):
        want = jax.grad(lambda x, t: function(x, t)[0], (0, 1))(x, table)
        np.testing.assert_allclose(results[2][..., k], want[0], rtol=1e-14)
        np.testing.assert_allclose(results[3][..., k], want[1], rtol=1e-14, atol=1e-15)


def test_derived_programs_are_saved_and_loaded(tmp_path):
    case = Case(positions(SAMPLES, INNER), rubbing(SAMPLES))
    made = adjoint(case.program, case.places)
    made.save(tmp_path / "adjoint.kernel")
    again = Program.load(tmp_path / "adjoint.kernel")
    for a, b in zip(made.call([*case.values, *case.weights]), again.call([*case.values, *case.weights]), strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
@pytest.mark.parametrize("derive", [lambda p, k: tangents(p, k, 2), adjoint])
def test_derivatives_in_c_have_the_bits_of_the_kernel(derive, tmp_path):
    case = Case(channels, RUNS["channels"][1])
    made = derive(case.program, case.places)
    chance = np.random.default_rng(6)
    given = [*case.values, *(chance.normal(size=leaf.shape) for leaf in made.arguments[len(case.values) :])]
    assert same_bits(InC(tmp_path, made)(given), made.call(given))


def test_what_has_no_derivative_is_refused():
    program, _ = lower(CASES["integers"][0], 1.37, 4)
    with pytest.raises(ArgumentError, match="only real numbers have derivatives"):
        tangents(program, [1], 1)
    with pytest.raises(ArgumentError, match="2 arguments"):
        adjoint(program, [2])
    with pytest.raises(ArgumentError, match="at least one direction"):
        tangents(program, [0], 0)


def test_a_loop_of_unknown_trips_goes_forwards_only():
    function, arguments = CASES["counted"]
    program, _ = lower(function, *arguments)
    found = tangents(program, [0], 1).call([0.7, 5, np.ones(1)])[1]
    want = jax.jvp(lambda x: function(x, 5), (0.7,), (1.0,))[1]
    np.testing.assert_allclose(found[0], want, rtol=1e-14)
    with pytest.raises(LoweringError, match="known before it runs"):
        adjoint(program, [0])


def test_the_adjoint_of_an_adjoint_is_refused():
    program, _ = lower(*[RUNS["steps"][0], *RUNS["steps"][1]])
    places = [k for k, leaf in enumerate(program.arguments) if leaf.kind == "real"]
    with pytest.raises((ArgumentError, LoweringError), match="derivative"):
        adjoint(adjoint(program, places), places)
