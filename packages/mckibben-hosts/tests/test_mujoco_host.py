"""MuJoCo with the plugin meets the limits of conformance, and keeps all bits of its states."""

import shutil

import pytest

from mckibben_hosts import conform
from mckibben_hosts.conformance import STATE_CHECKS, adapter

pytest.importorskip("mujoco", reason="MuJoCo is not installed")
pytestmark = pytest.mark.skipif(not (shutil.which("gcc") or shutil.which("cc")), reason="no C compiler here")


@pytest.fixture
def host(monkeypatch):
    monkeypatch.setenv("CFLAGS", "-O0")  # compiled sooner; the bits are the same
    opened = adapter("mujoco")
    yield opened
    opened.close()


def test_a_weight_in_mujoco_meets_the_limits(host):
    certificate = conform(host, scenarios=["hang"], steps=(1e-3, 2e-3), states=False)
    assert len(certificate.verdicts) == 4 and certificate.holds


def test_states_of_mujoco_keep_their_bits_when_saved_copied_reset_and_on_threads(host):
    assert {name: check(host) for name, check in STATE_CHECKS.items()} == dict.fromkeys(STATE_CHECKS, True)
