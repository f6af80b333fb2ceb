"""Conformance of hosts: the hosts of the package meet the limits, and a host that couples wrongly does not."""

import copy
import json
import shutil
from collections.abc import Mapping

import pytest

from mckibben.cli import main
from mckibben.errors import InputError
from mckibben_hosts import Part, conform
from mckibben_hosts.adapters import CHost, LoopHost, PartInstance, PythonHost, _PythonInstance
from mckibben_hosts.conformance import STATE_CHECKS, _verdicts, is_stable, read_certificate

STEPS = (1e-3, 2e-3)


class HastyHost(LoopHost):
    """A host that says that its rates are half a step older than they are: its ramps end too early."""

    name, title, staggered = "hasty", "a host with a mistake", False

    def version(self) -> str:
        return "0"

    def instance(self, part: Part, parameters: Mapping[str, float]) -> PartInstance:
        return _PythonInstance(part.with_parameters(parameters), staggered=True)

    def close(self) -> None:
        pass


@pytest.fixture(scope="module")
def certificate():
    return conform(PythonHost(), scenarios=["hang"], steps=STEPS, states=False)


def test_a_loop_in_python_meets_the_limits_and_its_certificate_can_be_read_again(certificate, tmp_path):
    assert certificate.holds
    judged = ("error at 1 ms", "order", "gap at the border", "tension when slack")
    assert {v.what for v in certificate.verdicts} == {f"hang: {what}" for what in judged}
    assert read_certificate(certificate.save(tmp_path / "python.json")).to_dict() == certificate.to_dict()


def test_a_host_that_couples_wrongly_misses_the_limits(certificate):
    hasty = conform(HastyHost(), scenarios=["hang"], steps=STEPS, states=False)
    assert not hasty.holds
    wrong, right = (c.content["scenarios"]["hang"]["steps"]["0.001"] for c in (hasty, certificate))
    assert wrong["position_error"] > 10.0 * right["position_error"]


@pytest.mark.slow  # two programs of a part with two muscles, some seconds to compile
def test_two_muscles_on_a_tank_hand_over_a_weight_without_losing_gas_and_do_not_pull_when_slack():
    tank = conform(PythonHost(), scenarios=["tank"], steps=STEPS, states=False)
    assert tank.holds and len(tank.verdicts) == 5
    assert tank.content["scenarios"]["tank"]["range"] > 0.04  # thrown up by several centimetres


def test_lost_gas_and_a_slack_muscle_that_pulls_miss_their_limits(certificate):
    content = copy.deepcopy(certificate.content)
    row = content["scenarios"]["hang"]["steps"]["0.001"]
    assert row["slack_tension"] == 0.0
    row |= {"slack_tension": 0.1, "gas_change": 1e-6}
    missed = {v.what for v in _verdicts(content) if not v.holds}
    assert missed == {"hang: tension when slack", "hang: gas gained or lost"}


@pytest.mark.skipif(not (shutil.which("gcc") or shutil.which("cc")), reason="no C compiler here")
def test_parts_in_c_keep_their_bits_when_saved_copied_reset_and_on_threads(monkeypatch):
    monkeypatch.setenv("CFLAGS", "-O0")  # compiled sooner; the bits are the same
    host = CHost()
    try:
        assert {name: check(host) for name, check in STATE_CHECKS.items()} == dict.fromkeys(STATE_CHECKS, True)
    finally:
        host.close()


def test_a_part_in_python_keeps_its_bits_on_threads():
    assert STATE_CHECKS["on four threads"](PythonHost())


def test_masses_well_above_slope_times_step_squared_are_stable_and_those_well_below_are_not(certificate):
    host, limit = PythonHost(), 0.030  # [kg]: what the export prints for 1 ms
    assert is_stable(host, 3.0 * limit, 1e-3)
    assert not is_stable(host, limit / 10.0, 1e-3)


def test_an_unknown_host_or_scenario_is_answered_with_the_known_ones(capsys):
    with pytest.raises(InputError, match="python"):
        conform("matlab")
    with pytest.raises(InputError, match="Did you mean 'hang'"):
        conform("python", scenarios=["hangs"])


def test_the_command_prints_the_certificate(certificate, capsys, monkeypatch):
    monkeypatch.setattr("mckibben_hosts.conformance._certify", lambda *_, **__: certificate)
    with pytest.raises(SystemExit) as ended:
        main(["conform", "python", "--json"])
    assert ended.value.code == 0
    assert json.loads(capsys.readouterr().out)["scenarios"]["hang"]["order"] > 1.7
