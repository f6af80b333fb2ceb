"""Signals between their samples, at once and late, and units side by side: closed forms of each."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mckibben.components import Module, Scalar, paths
from mckibben.components.system import UnitRows, as_rows, for_each_unit
from mckibben.engine import held
from mckibben.engine.signals import ramped
from mckibben.errors import InputError
from mckibben.quantities import quantity

PERIOD = 1e-2
VALUES = np.array([2.0, 3.0, 7.0, 5.0, 5.0, 1.0])
TIMES = PERIOD * np.arange(len(VALUES))
ROUNDING = 1e-12


def at(signal, time):
    """The value at a time [s], and the rate, as a step of the engine asks for them."""
    index = min(int(time / PERIOD + 1e-9), len(VALUES) - 2)
    value = signal.at(index, time / PERIOD - index, PERIOD)
    return float(value.value), float(value[1])


@pytest.mark.parametrize("delay", [0.0, 0.4, 1.0, 2.7])  # samples
@pytest.mark.parametrize("time", [0.0, 0.1, 0.5, 1.3, 2.0, 3.75, 4.9])  # samples
def test_a_late_signal_is_what_it_was_that_long_before_and_rests_before_it_begins(delay, time):
    early = max(time - delay, 0.0)
    for name, signal in (("held", held(VALUES)), ("straight", ramped(VALUES))):
        late = signal if delay == 0.0 else signal.delayed(delay * PERIOD)
        value, rate = at(late, time * PERIOD)
        place = int(early + 1e-9)
        if name == "held":
            assert (value, rate) == (VALUES[place], 0.0)
        else:
            assert value == pytest.approx(np.interp(early, np.arange(len(VALUES)), VALUES), rel=ROUNDING)
            slope = (VALUES[place + 1] - VALUES[place]) / PERIOD if time >= delay else 0.0
            assert rate == pytest.approx(slope, rel=1e-9, abs=1e-9)


def test_delays_add_up():
    once, twice = ramped(VALUES).delayed(3e-3).delayed(9e-3), ramped(VALUES).delayed(12e-3)
    assert at(once, 0.034) == pytest.approx(at(twice, 0.034), rel=ROUNDING)


@pytest.mark.parametrize("rounding", [-1e-12, 0.0, 1e-12])
def test_a_delay_of_whole_samples_to_rounding_is_one_and_still_has_a_slope(rounding):
    delay = PERIOD * (1.0 + rounding)  # such as 0.07 / 0.01, which is more than 7
    assert [at(held(VALUES).delayed(delay), t)[0] for t in TIMES[1:5]] == VALUES[:4].tolist()
    slope = jax.grad(lambda d: ramped(3.0 * TIMES).delayed(d).at(2, 0.0, PERIOD).value)(delay)
    assert float(slope) == pytest.approx(-3.0, rel=1e-9)


@pytest.mark.parametrize("delay", [0.3, 1.6])  # samples
@pytest.mark.parametrize(("begin", "end"), [(0.0, 1.0), (0.2, 0.4), (0.5, 0.75), (0.0, 0.3)])
def test_a_late_jump_inside_a_step_is_seen_as_its_mean_over_the_step_at_each_stage(delay, begin, end):
    index = 3
    fine = begin + (end - begin) * (np.arange(20000) + 0.5) / 20000
    mean = np.mean(VALUES[np.floor(index + fine - delay).astype(int)])
    late = held(VALUES).delayed(delay * PERIOD)
    for share in (0.0, 0.5, 1.0):
        value = late.within(index, begin, end, share, PERIOD)
        assert float(value.value) == pytest.approx(mean, abs=1e-3)  # of 20,000 points, against jumps of 4
        assert float(value[1]) == 0.0
        at_once = held(VALUES).within(index, begin, end, share, PERIOD)
        assert float(at_once.value) == VALUES[index]
        straight = ramped(VALUES).within(index, begin, end, share, PERIOD)
        place = index + begin + (end - begin) * share
        assert float(straight.value) == pytest.approx(np.interp(place, np.arange(len(VALUES)), VALUES), rel=ROUNDING)


@pytest.mark.parametrize("mapped", [True, False])
def test_units_side_by_side_are_each_what_it_is_alone_and_their_shares_add_up(mapped):
    matrix, one, common = np.arange(24.0).reshape(2, 3, 4), np.arange(4.0), 5.0

    def function(a, b, c):
        return {"scaled": c * a * b, "sum": a.sum() + b}, {"share": b * c, "rows": a[0]}

    trees = as_rows((jnp.asarray(matrix), jnp.asarray(one), jnp.asarray(common)))
    assert isinstance(trees[0], UnitRows) and len(trees[0].rows) == 6 and trees[0].whole.shape == (2, 3, 4)
    np.testing.assert_array_equal(trees[0].whole, matrix)
    assert trees[1].shape == (4,)
    results, sums = for_each_unit(function, trees, [True] * 7 + [False], mapped=mapped)
    for k in range(4):
        alone, _ = function(matrix[..., k], one[k], common)
        np.testing.assert_allclose(results["scaled"].whole[..., k], alone["scaled"], rtol=ROUNDING)
        np.testing.assert_allclose(results["sum"][k], alone["sum"], rtol=ROUNDING)
    assert float(sums["share"]) == pytest.approx(common * one.sum(), rel=ROUNDING)
    np.testing.assert_allclose(sums["rows"], matrix[0].sum(-1), rtol=ROUNDING)


class Bore(Module):
    """A part with a number, and one that it may not have."""

    width: Scalar = quantity("m", (0.0, 1.0), "width", default=0.1)
    depth: Any = quantity("m", (0.0, 1.0), "depth", default=None)


class Block(Module):
    """Parts by name, of which one has a dot."""

    bores: dict[str, Bore]
    mass: Scalar = quantity("kg", (0.0, 9.0), "mass", default=2.0)


def test_a_parameter_is_found_and_put_by_its_path_though_names_have_dots():
    block = Block(bores={"a": Bore(width=0.2), "a.b": Bore(width=0.3, depth=0.5)})
    known = {path: float(value) for path, _, value in paths.declared_values(block)}
    assert known == {"bores.a.width": 0.2, "bores.a.b.width": 0.3, "bores.a.b.depth": 0.5, "mass": 2.0}
    assert {path for path, _ in paths.parameters({"x": block}, "y.")} == {f"y.x.{path}" for path in known}
    assert paths.resolved(block)["bores.a.width"] == {"value": 0.2, "unit": "m"}
    assert {path: float(paths.get(block, path)) for path in known} == known
    changed = paths.put(block, {"bores.a.b.width": 0.7, "mass": 3.0})
    now = {path: float(value) for path, _, value in paths.declared_values(changed)}
    assert now == known | {"bores.a.b.width": 0.7, "mass": 3.0}
    assert float(block.mass) == 2.0  # the first one stays
    assert paths.get(paths.put(block, {"bores.a": Bore(width=0.9)}), "bores.a.width") == 0.9
    assert paths.declaration(block, "mass").unit == "kg"
    for path, near in (("mas", "mass"), ("zzz", "bores.a.b.depth")):
        with pytest.raises(InputError, match=near):
            paths.declaration(block, path)
