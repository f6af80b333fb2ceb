"""Modules that are imported at their first use stand for the modules that they are."""

import subprocess
import sys
from importlib import metadata

import pytest

import mckibben.nomenclature
from mckibben import _jax
from mckibben._lazy import LazyModule


def test_a_lazy_module_has_the_names_of_the_module_and_no_others(monkeypatch):
    lazy = LazyModule("mckibben.nomenclature")
    assert vars(lazy) is vars(mckibben.nomenclature) and dir(lazy) == dir(mckibben.nomenclature)
    before = mckibben.nomenclature.TERMS
    monkeypatch.setattr(lazy, "TERMS", ())
    assert mckibben.nomenclature.TERMS == () == lazy.TERMS
    monkeypatch.undo()
    assert mckibben.nomenclature.TERMS is before is lazy.TERMS


def test_whoever_loads_jax_it_counts_with_64_bits():
    code = (
        "import mckibben, numpy as np\n"
        "from mckibben.muscles.elements import Tendon\n"
        "early = Tendon(stiffness=1e5, toe_length=5e-4, loss=0.2)\n"
        "assert isinstance(early.stiffness, np.ndarray)\n"
        "import jax\n"
        "assert jax.numpy.ones(1).dtype == 'float64'\n"
        "late = Tendon(stiffness=1e5, toe_length=5e-4, loss=0.2)\n"
        "assert isinstance(early.stiffness, jax.Array) and early == late\n"
        "assert len(jax.tree.leaves(early)) == len(jax.tree.leaves(late)) > 1\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


LATE = """
import copy, importlib.metadata, sys
import numpy
from mckibben import _jax
from mckibben._jax import jax, jnp

before, done = importlib.metadata.distributions, []
_jax.when_loaded(lambda: done.append("waited"))

@_jax.custom_jvp
def square(x):
    '''A square.'''
    return x * x

@square.defjvp
def slope(primals, tangents):
    return square(primals[0]), 5.0 * tangents[0]  # not that of a square: who asks gets this one

power = _jax.jit(lambda x, n: x**n, static_argnums=1)
seen = []
looks = _jax.jit(lambda x: seen.append((_jax.is_traced(x), _jax.is_jax_array(x))) or x)
assert jnp.zeros is numpy.zeros and jnp.where is numpy.where and jnp.pi is numpy.pi
assert square.__doc__ == "A square." and square.__name__ == "square"
assert not hasattr(power, "__deepcopy__") and copy.copy(power) is not None
assert not (_jax.is_loaded() or _jax.is_traced(1.0) or _jax.is_jax_array(numpy.ones(1))) and "jax" not in sys.modules
assert done == []
assert jnp.exp(1.0).dtype == "float64"  # which NumPy would round otherwise
assert _jax.is_loaded() and done == ["waited"]
_jax.when_loaded(lambda: done.append("at once"))
assert done == ["waited", "at once"]
import jax as real
assert jnp.zeros is real.numpy.zeros
assert power(3.0, 2) == 9.0 and square(3.0) == 9.0 and jax.grad(square)(3.0) == 5.0
assert power.lower(1.0, 3).compile() is not None
looks(1.0)
assert seen == [(True, True)]
assert _jax.is_jax_array(jnp.ones(1)) and not _jax.is_traced(jnp.ones(1)) and not _jax.is_jax_array(numpy.ones(1))
assert importlib.metadata.distributions is before and any(True for _ in before())
assert not any(type(finder).__module__ == "mckibben._jax" for finder in sys.meta_path)
"""


def test_what_waits_for_jax_is_done_when_it_is_loaded_and_not_before():
    done = subprocess.run([sys.executable, "-c", LATE], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_names_of_a_package_are_those_of_their_modules_and_loaded_when_they_are_asked_for(tmp_path, monkeypatch):
    (tmp_path / "late_package").mkdir()
    (tmp_path / "late_package/__init__.py").write_text(
        "from typing import TYPE_CHECKING\n"
        "from mckibben._lazy import lazy_names, lazy_submodules\n"
        "if TYPE_CHECKING:\n    from .one import A as A\n    from .two import B as B\n    from .two import C as C\n"
        "lazy_names(__name__)\nlazy_submodules(__name__)\n"
    )
    (tmp_path / "late_package/one.py").write_text("A = []\n")
    (tmp_path / "late_package/two.py").write_text("B, C = object(), 3\n")
    (tmp_path / "late_package/_note.txt").write_text("")
    (tmp_path / "late_package/deep").mkdir()
    (tmp_path / "late_package/deep/__init__.py").write_text("D = 4\n")
    monkeypatch.syspath_prepend(tmp_path)
    import late_package

    assert late_package.__all__ == ["A", "B", "C"] and not {"late_package.one", "late_package.two"} & set(sys.modules)
    assert late_package.A is late_package.A is late_package.one.A and "late_package.two" not in sys.modules
    assert vars(late_package)["A"] is late_package.A  # looked for once
    assert (late_package.C, late_package.deep.D) == (3, 4)
    assert isinstance(late_package.one, LazyModule) or late_package.one is sys.modules["late_package.one"]
    for missing in ("E", "_note"):
        with pytest.raises(AttributeError, match=f"has no attribute '{missing}'"):
            getattr(late_package, missing)
    for name in [name for name in sys.modules if name.partition(".")[0] == "late_package"]:
        monkeypatch.delitem(sys.modules, name)


def test_a_lazy_module_is_asked_for_nothing_by_who_only_looks():
    lazy = LazyModule("no_such_module_anywhere")
    for name in ("__path__", "__file__", "__wrapped__"):
        assert not hasattr(lazy, name)
    with pytest.raises(ModuleNotFoundError):
        lazy.anything  # noqa: B018
    lazy = LazyModule("mckibben.nomenclature")
    lazy.fresh = 1
    assert mckibben.nomenclature.fresh == 1
    del lazy.fresh
    assert not hasattr(mckibben.nomenclature, "fresh")


def test_while_jax_is_loaded_packages_are_searched_only_where_a_plugin_of_rocm_is_there(tmp_path, monkeypatch):
    real = metadata.distributions
    (tmp_path / "empty").mkdir()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [str(tmp_path / "empty"), ""])
    for plugin in (False, True):
        if plugin:
            (tmp_path / "jax_rocm7_plugin").mkdir()
        with _jax._no_search_for_rocm():
            assert (metadata.distributions is real) is plugin
            assert plugin or list(metadata.distributions(name="jax")) == []
        assert metadata.distributions is real
