"""Conformance of hosts: the hosts of the package meet the limits, and a host that couples wrongly does not."""

import json
import shutil
from collections.abc import Mapping

import pytest

from mckibben.cli import main
from mckibben.errors import InputError
from mckibben.hosts import Part, conform
from mckibben.hosts.adapters import CHost, LoopHost, PartInstance, PythonHost, _PythonInstance
from mckibben.hosts.conformance import STATE_CHECKS, is_stable, read_certificate

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
    assert {v.what for v in certificate.verdicts} == {"hang: error at 1 ms", "hang: order", "hang: gap at the border"}
    assert read_certificate(certificate.save(tmp_path / "python.json")).document() == certificate.document()


def test_a_host_that_couples_wrongly_misses_the_limits(certificate):
    hasty = conform(HastyHost(), scenarios=["hang"], steps=STEPS, states=False)
    assert not hasty.holds
    wrong, right = (c.content["scenarios"]["hang"]["steps"]["0.001"] for c in (hasty, certificate))
    assert wrong["position_error"] > 10.0 * right["position_error"]


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
    monkeypatch.setattr("mckibben.hosts.conformance.conform", lambda *_, **__: certificate)
    with pytest.raises(SystemExit) as ended:
        main(["conform", "python", "--json"])
    assert ended.value.code == 0
    assert json.loads(capsys.readouterr().out)["scenarios"]["hang"]["order"] > 1.7
