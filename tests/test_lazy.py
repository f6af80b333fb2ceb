"""Modules that are imported at their first use stand for the modules that they are."""

import subprocess
import sys

import mckibben.nomenclature
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
