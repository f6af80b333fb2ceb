"""The memory of a run: refused before it begins where it does not fit, in a sentence that says what would do."""

import dataclasses
from pathlib import Path

import pytest

import mckibben as mk
from mckibben.bench.joint_run import joint_stand, run_joint
from mckibben.recordings import memory

CIRCUITS = Path(__file__).parents[2] / "examples" / "circuits"


FREE = memory.free_memory


def test_free_memory_is_what_the_system_says_or_else_a_stated_guess(monkeypatch):
    class File:
        """What the system tells."""

        text = "MemTotal: 9 kB\nMemAvailable: 2000 kB\n"

        def __init__(self, path):
            assert path == "/proc/meminfo"

        def read_text(self, encoding):
            return self.text

    monkeypatch.setattr(memory, "Path", File)
    assert FREE() == 2000 * 1024.0
    monkeypatch.setattr(File, "text", "MemTotal: 9 kB\n")
    monkeypatch.setattr(memory.os, "sysconf", {"SC_AVPHYS_PAGES": 300, "SC_PAGE_SIZE": 4096}.__getitem__)
    assert FREE() == 300 * 4096.0

    def unknown(name):
        raise ValueError

    monkeypatch.setattr(memory.os, "sysconf", unknown)
    assert FREE() == memory.UNKNOWN


@pytest.fixture(autouse=True)
def one_gigabyte(monkeypatch):
    monkeypatch.setattr(memory, "free_memory", lambda: 1e9)


def test_the_longest_run_is_the_one_that_takes_half_of_the_free_memory():
    memory.check_memory(62.5, 1e-3, bytes_per_sample=8e3)  # 62,500 samples of 8 kB are 0.5 GB
    with pytest.raises(
        mk.InputError, match=r"must be at most 62 s at a period of 0.001 s, got 63 s; it would need 0.504 GB"
    ):
        memory.check_memory(63.0, 1e-3, bytes_per_sample=8e3)
    with pytest.raises(mk.InputError, match="at most 6.2 s for each of 10 runs"):
        memory.check_memory(6.3, 1e-3, bytes_per_sample=8e3, runs=10)  # of which one alone fits


def test_joints_circuits_and_protocols_are_refused_before_they_begin(monkeypatch):
    stand = joint_stand("nylon")
    with pytest.raises(mk.InputError, match="a shorter run or a longer period would do"):
        run_joint(stand, duration=1e6, angle=0.0, stiffness=1.0)
    long = dataclasses.replace(mk.circuit(CIRCUITS / "filling-a-tank.toml"), duration=1e6)
    with pytest.raises(mk.InputError, match="a shorter run or a longer period would do"):
        long.run()
    monkeypatch.setattr(memory, "free_memory", lambda: 1e5)
    with pytest.raises(mk.InputError, match="a shorter run or a longer period would do"):
        mk.prepare("isometric-step", muscle="nylon")
