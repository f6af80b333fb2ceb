"""FONSim's case, a source, 2 mm x 0.6 m of tube and a tank of 120 ml: the same pressure from the same physics."""

import importlib.util
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def case():
    """The benchmark's own case, so that what is timed is what is compared."""
    spec = importlib.util.spec_from_file_location("fonsim_tank", ROOT / "benchmarks/fonsim_tank.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # a dataclass looks its module up
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def theirs(case):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # its own
        pytest.importorskip("fonsim")
        return case.Fonsim(1e-3, "tustin", 1e-4).run()


def test_the_physics_of_fonsim_gives_the_pressure_of_fonsim(case, theirs):
    """Darcy and Weisbach at the mean density, friction of the library, nothing fitted."""
    ours = case.Ours(case.DarcyTube(), 1e-4).run()
    assert theirs[-1] == pytest.approx(case.AMBIENT + case.STEP, rel=1e-6)
    assert ours[-1] == pytest.approx(theirs[-1], rel=1e-6)
    # 0.5 % of the step is asked for. What remains is the inertance and how friction passes from laminar to turbulent:
    # FONSim blends straight between Re = 2300 and 4000, the library smoothly.
    assert case.error(ours, theirs) < 0.005


@pytest.mark.slow
def test_what_fonsim_leaves_out_is_more_than_that(case, theirs):
    """The resolved tube fills more slowly: accelerating the gas and the speed lost in the tank cost pressure too."""
    reality = case.distributed()
    assert 0.03 < np.max(theirs - reality) / case.STEP < 0.08
    assert case.error(case.Ours(case.lumped(), 1e-4).run(), reality) < 0.005  # the lumped tube leaves nothing of it out
