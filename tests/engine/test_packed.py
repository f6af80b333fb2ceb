"""Compiled functions of vectors: one for every content of what is fixed, whoever asks and how many at once."""

import threading

import jax.numpy as jnp
import numpy as np
import pytest

from mckibben.components import programs
from mckibben.engine import packed
from mckibben.engine.packed import compile_once, pack


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
