"""In every host that is installed, a muscle that carries a weight at rest pulls as its law says."""

import shutil

import pytest

from learned_muscle import learned_muscle
from mckibben.errors import InputError, MckibbenError
from mckibben.simulation import Air
from mckibben_hosts import Part
from mckibben_hosts.conformance import HOSTS, adapter
from mckibben_hosts.scenarios import GRAVITY, GRID, HostMechanism, Scenario

PERIOD, SAMPLES, PRESSURE = 1e-3, 10, 5e5
AIR = Air(supply="8 bar", valve="regulator")
NEEDS_COMPILER = {"c", "mujoco", "fmi3", "fmi2", "libcosim", "warp", "newton"}


def carried(muscle):
    """A muscle at 0.95 of its length and 5 bar under the weight that its law carries, at rest."""
    part = Part(muscle, AIR, span=0.95 * float(Part(muscle).hosted.muscles["muscle"].law.rest_length))
    span = part.span["muscle"]
    part = Part(muscle, AIR, span=span, pressure=PRESSURE)
    weight = float(part.hosted.muscles["muscle"].law.tension(span, PRESSURE))
    mechanism = HostMechanism(weight / GRAVITY, {"muscle": -1.0}, {"muscle": 0.0}, load=weight, start=span)
    return Scenario("carried", "a weight carried at rest", part, mechanism, {"muscle": (PRESSURE,) * SAMPLES})


@pytest.mark.parametrize("muscle", ["learned", "DMSP-40-400"])
@pytest.mark.parametrize("host", HOSTS)
def test_a_muscle_in_a_host_pulls_as_its_law(host, muscle, tmp_path):
    if host in NEEDS_COMPILER and not (shutil.which("gcc") or shutil.which("cc")):
        pytest.skip("no C compiler here")
    scenario = carried(learned_muscle(tmp_path) if muscle == "learned" else muscle)
    try:
        opened = adapter(host)
    except (ImportError, InputError, MckibbenError) as error:
        pytest.skip(f"{host}: {error}")
    try:
        mechanism = opened.open(scenario, PERIOD)
        for moment in scenario.moments(PERIOD, staggered=opened.staggered):
            readings = mechanism.step(moment)
        assert len(scenario.moments(PERIOD, staggered=opened.staggered)) == round(SAMPLES * GRID / PERIOD)
        weight, start = scenario.mechanism.load, scenario.mechanism.start
        assert readings.tension["muscle"] == pytest.approx(weight, rel=1e-3)  # 0.1 % is asked for
        assert mechanism.position == pytest.approx(start, rel=1e-3)
    finally:
        opened.close()
