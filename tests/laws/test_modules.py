"""Values with parameters: immutable trees, whose static fields are their structure, checked when they are made."""

import dataclasses
import types
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mckibben.components import AbstractVar, Module, Scalar, field
from mckibben.errors import InputError
from mckibben.quantities import quantity


class Base(Module):
    gain: AbstractVar[Scalar]

    def output(self, x: Any) -> Any:
        return self.gain * x


class Spring(Base):
    gain: Scalar = quantity("N/m", (0.0, 1e6), "slope", default=2.0)
    label: str = field(static=True, kw_only=True, default="s")
    beside: Any = None

    def __check_init__(self) -> None:
        if self.label == "bad":
            raise InputError("label", "bad", "must be another")


def test_a_module_is_taken_apart_and_put_together():
    one = Spring(gain=3.0, beside={"a": 1.0})
    leaves, structure = jax.tree.flatten(one)
    again = jax.tree.unflatten(structure, leaves)
    assert isinstance(again, Spring) and again == one and again.label == "s"
    paths = [jax.tree_util.keystr(path) for path, _ in jax.tree.leaves_with_path(one)]
    assert sorted(paths) == [".beside['a']", ".gain"]
    assert [float(x) for x in leaves].count(3.0) == 1


def test_static_fields_are_structure_and_parameters_are_not():
    structure = jax.tree.structure
    assert structure(Spring(label="a")) != structure(Spring(label="b"))
    assert structure(Spring(gain=1.0)) == structure(Spring(gain=2.0))


def test_parameters_become_arrays_and_are_checked_as_are_those_of_every_type_above():
    made = Spring(gain=3)
    assert made.gain.dtype == float and made.gain.shape == ()
    with pytest.raises(InputError, match="gain"):
        Spring(gain=-1.0)
    with pytest.raises(InputError, match="label"):
        Spring(label="bad")
    with pytest.raises(InputError, match="gain"):
        made.replace(gain=2e6)


def test_what_is_put_together_of_tracers_or_placeholders_is_not_checked():
    # as in a batch, where no lane may raise
    assert float(jax.jit(lambda s: s.output(2.0))(jax.tree.map(lambda x: -x, Spring(gain=3.0)))) == -6.0
    assert jax.tree.map(lambda _: object(), Spring()) is not None
    assert float(jax.jit(lambda g: Spring(gain=g).output(2.0))(-3.0)) == -6.0


def test_nothing_can_be_set_or_deleted():
    made = Spring()
    for change in (
        lambda: setattr(made, "gain", 1.0),
        lambda: setattr(made, "other", 1.0),
        lambda: delattr(made, "gain"),
    ):
        with pytest.raises(dataclasses.FrozenInstanceError):
            change()


def test_a_type_without_what_its_kinds_must_have_has_no_such_field():
    assert "gain" not in {f.name for f in dataclasses.fields(Base)}


def test_equal_is_what_has_the_same_structure_and_numbers_and_a_hash_is_an_identity():
    a, b = Spring(gain=3.0), Spring(gain=3.0)
    assert a == b and hash(a) != hash(b)
    assert a != Spring(gain=4.0) and a != Spring(gain=3.0, label="t") and a != 3.0
    assert a != Spring(gain=jnp.full(2, 3.0))


def test_a_method_that_a_module_holds_is_a_branch_of_it():
    holder = Spring(beside=Spring(gain=5.0).output)
    assert not isinstance(holder.beside, types.MethodType)
    assert len(jax.tree.leaves(holder)) == 2
    doubled = jax.tree.map(lambda x: 2.0 * x, holder)
    assert float(holder.beside(3.0)) == 15.0 and float(doubled.beside(3.0)) == 30.0
    # and its owner's parameter can be differentiated by
    slope = jax.grad(lambda h: h.beside(3.0))(holder)
    assert float(slope.beside.__self__.gain) == 3.0


def test_a_bound_method_is_compiled_as_a_newcomer_writes_it():
    assert float(jax.jit(Spring(gain=3.0).output)(2.0)) == 6.0


def test_a_module_shows_its_numbers():
    assert repr(Spring(gain=3.0)) == "Spring(gain=3.0, label='s', beside=None)"
    assert "float64[9]" in repr(Spring(gain=np.ones(9)))
