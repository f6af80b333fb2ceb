"""In every host that is installed, a muscle that carries a weight at rest pulls as its law says, or as it has learned."""

import dataclasses
import shutil

import pytest

from learned_muscle import learned_muscle
from mckibben.errors import InputError, MckibbenError
from mckibben.simulation import Air
from mckibben_hosts import Part, conformance
from mckibben_hosts.conformance import HOSTS, STATE_CHECKS, adapter, conform
from mckibben_hosts.scenarios import (
    GRAVITY,
    GRID,
    MASS,
    SCENARIOS,
    START,
    SUPPLY,
    HostMechanism,
    Scenario,
    hanging,
    scenario,
)

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


@pytest.fixture(scope="module")
def lifted(tmp_path_factory):
    """A weight lifted and let down by a muscle that has learned, and the same system integrated as one."""
    file = learned_muscle(tmp_path_factory.mktemp("learned"))
    air = Air(supply=SUPPLY)
    law = Part(file, air, span=START).hosted.muscles["muscle"].law
    part = Part(file, air, span=START, pressure=float(law.pressure_for(MASS * GRAVITY, START)))
    hang = dataclasses.replace(scenario("hang"), part=part, mechanism=hanging(part=part))
    return hang, hang.reference()


@pytest.mark.slow  # the system as one, and three programs of it: some seconds each to compile
@pytest.mark.parametrize("host", ["c", "fmi3", "mujoco"])
def test_a_muscle_that_has_learned_is_certified_as_any_other(host, lifted, monkeypatch):
    """Its limits, order, gap at the border, and the bits of its states, in place of the scenario that all of them take."""
    if not (shutil.which("gcc") or shutil.which("cc")):
        pytest.skip("no C compiler here")
    try:
        adapter(host).close()
    except (ImportError, InputError, MckibbenError) as error:
        pytest.skip(f"{host}: {error}")
    hang, reference = lifted
    monkeypatch.setenv("CFLAGS", "-O0")  # the same bits, in a fifth of the compiler's time
    monkeypatch.setitem(SCENARIOS, "hang", lambda: hang)
    monkeypatch.setattr(conformance, "reference_of", lambda name: reference)
    certificate = conform(host, scenarios=["hang"], steps=(1e-3, 2e-3))
    assert len(certificate.verdicts) >= 3 + len(STATE_CHECKS) and certificate.holds, certificate.verdicts
