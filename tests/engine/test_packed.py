"""Compiled functions of vectors: one for every content of what is fixed, whoever asks and how many at once."""

import threading

import jax.numpy as jnp
import numpy as np
import pytest

from mckibben.components import programs
from mckibben.engine import packed
from mckibben.engine.packed import Layout, Packed, compile_once, pack


def scaled(factors, name, x):
    return ({name: factors["a"] * x["one"] + factors["table"][1]},)


@pytest.fixture
def made(monkeypatch):
    """How many were compiled."""
    count = []

    class Counted(packed.Packed):
        def __init__(self, *given):
            count.append(1)
            super().__init__(*given)

    monkeypatch.setattr(packed, "Packed", Counted)
    monkeypatch.setattr(programs, "LIBRARIES", programs.LIBRARIES | {__name__})  # functions of this file have names
    monkeypatch.setattr(packed, "_compiled", type(packed._compiled)())
    return count


def factors(a, *table):
    return {"a": a, "table": jnp.asarray(table)}


EXAMPLE = {"one": np.zeros(())}


def test_the_same_content_is_compiled_once_and_any_other_anew(made):
    first = compile_once(scaled, (factors(2.0, 1.0, 5.0), "y"), EXAMPLE)
    assert compile_once(scaled, (factors(2.0, 1.0, 5.0), "y"), EXAMPLE) is first and len(made) == 1
    (found,) = first(pack({"one": 3.0}))
    assert first.tree(0, found) == {"y": 11.0}
    for other in ((factors(2.0, 1.0, 6.0), "y"), (factors(2.5, 1.0, 5.0), "y"), (factors(2.0, 1.0, 5.0), "z")):
        assert compile_once(scaled, other, EXAMPLE) is not first
    assert len(made) == 4
    (found,) = compile_once(scaled, (factors(2.0, 1.0, 6.0), "y"), EXAMPLE)(pack({"one": 3.0}))
    assert found[0] == 12.0


def test_all_who_ask_at_once_share_one_compilation(made):
    found = []
    threads = [
        threading.Thread(target=lambda: found.append(compile_once(scaled, (factors(1.0, 0.0, 0.0), "y"), EXAMPLE)))
        for _ in range(6)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len({id(f) for f in found}) == len(made) == 1


def test_a_failure_is_told_to_everybody_and_not_remembered(made):
    for _ in range(2):
        with pytest.raises(KeyError):
            compile_once(scaled, ({"a": 1.0}, "y"), EXAMPLE)
    assert len(made) == 2 and not packed._compiled


TREE = {
    "on": np.array([True, False, True]),
    "n": np.int32(-7),
    "x": np.arange(6.0).reshape(2, 3),
    "nothing": None,
    "y": 2.5,
}


def test_a_tree_lies_in_a_vector_leaf_by_leaf_and_comes_back_with_its_shapes_and_types():
    layout = Layout.of(TREE)
    vector = layout.pack(TREE)
    assert vector.dtype == np.float64 and vector.shape == (layout.size,) == (11,)
    assert np.array_equal(np.asarray(layout.packed(TREE)), vector) and np.array_equal(pack(TREE), vector)
    for given in (vector, jnp.asarray(vector)):
        found = layout.unpack(given)
        for name, value in TREE.items():
            if value is None:
                assert found[name] is None
            else:
                assert found[name].dtype == np.asarray(value).dtype and np.array_equal(found[name], value), name
    assert Layout.of({}).size == 0 and pack({}).shape == np.asarray(Layout.of({}).packed({})).shape == (0,)


def several(x):
    return {"a": x["x"] + 1.0, "b": x["y"] > 2.0, "n": x["n"]}, {"y": x["y"], "z": 2.0 * x["y"]}


@pytest.mark.parametrize("engine", ["native", "xla"])
def test_results_are_called_bound_named_and_in_columns_the_same_by_either_engine(engine, monkeypatch):
    if engine == "xla":
        made = packed.compile_function
        monkeypatch.setattr(packed, "compile_function", lambda *a, **b: made(*a, **b | {"engine": "xla"}))
    run, vector = Packed(several, TREE), pack(TREE)
    first, second = run(vector)
    assert np.array_equal(run.tree(0, first)["a"], TREE["x"] + 1.0) and run.tree(0, first)["n"] == -7
    assert run.tree(0, first)["b"] and run.tree(0, first)["b"].dtype == bool
    assert (run.size(0), run.size(1), run.index(1, "y"), run.index(1, "z")) == (3, 2, 0, 1)
    assert second[run.index(1, "z")] == 5.0
    again, results = run.bind(vector)
    assert [len(one) for one in results] == [8, 2] and not any(one.any() for one in results)
    for y in (2.5, 1.0):
        vector[-1] = y
        again()
        assert results[1].tolist() == [y, 2.0 * y] and run.tree(0, results[0])["b"] == (y > 2.0)
    columns = run.columns(1, np.array([[1.0, 2.0], [3.0, 6.0], [5.0, 10.0]]))
    assert columns["y"].tolist() == [1.0, 3.0, 5.0] and columns["z"].tolist() == [2.0, 6.0, 10.0]


def test_those_that_were_asked_for_last_are_remembered(made, monkeypatch):
    monkeypatch.setattr(packed, "MOST_COMPILED", 2)

    def ask(a):
        return compile_once(scaled, (factors(a, 0.0, 0.0), "y"), EXAMPLE)

    first = ask(1.0)
    ask(2.0)
    assert ask(1.0) is first and len(made) == 2  # it is the newer one now
    ask(3.0)
    assert ask(1.0) is first and len(made) == 3
    ask(2.0)
    assert len(made) == 4
