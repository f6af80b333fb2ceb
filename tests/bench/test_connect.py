"""Hardware by name: a backend that another package brings by an entry point, and what is said where there is none."""

import importlib.metadata

import pytest

from mckibben import registry
from mckibben.bench.hardware import backends
from mckibben.bench.hardware.backends import HardwareRequest, check_connection, connected
from mckibben.bench.hardware.interface import Hardware
from mckibben.bench.rig_file import rig
from mckibben.errors import InputError, MissingLibraryError


class Desk(Hardware):
    """A machine that a package of somebody else opens."""

    def __init__(self, request: HardwareRequest) -> None:
        super().__init__(request.rig.converters(0.0).names, encoder=True, motor=True, motor_rest=7)
        self.request, self.sent, self.closed = request, [], False

    def start(self, period):
        pass

    def wait(self, sample):
        return 0.0

    def send(self):
        self.sent.append((0 if self.venting else self.valve, self.motor, self.opened))

    def _vent_now(self):
        self.send()

    def close(self):
        self.closed = True


@pytest.fixture
def desk(monkeypatch):
    point = importlib.metadata.EntryPoint("desk", f"{__name__}:Desk", backends.GROUP)
    monkeypatch.setattr(importlib.metadata.EntryPoint, "load", lambda self: Desk)
    monkeypatch.setattr(registry, "_entry_points", lambda: [point])


def test_a_backend_of_another_package_is_opened_by_its_name_and_closed(desk):
    check_connection("desk:left")
    with connected("desk:left", rig("paper"), 1e-3) as machine:
        assert machine.request.place == "left" and machine.request.period == 1e-3
        machine.write(5, opened=False)
        machine.write(6, 9)
        machine.vent()
    assert machine.sent == [(5, 7, False), (6, 9, True), (0, 9, True)] and machine.closed


def test_a_backend_that_cannot_be_loaded_is_refused_in_one_sentence(monkeypatch):
    point = importlib.metadata.EntryPoint("desk", "no_such_package:Desk", backends.GROUP)
    monkeypatch.setattr(registry, "_entry_points", lambda: [point])
    with pytest.raises(InputError, match="the entry point no_such_package:Desk of mckibben.hardware cannot be loaded"):
        check_connection("desk:left")


def test_no_words_and_simulated_stand_for_no_hardware():
    for words in (None, "simulated"):
        check_connection(words)
        with connected(words, rig("paper"), 1e-3) as machine:
            assert machine is None


@pytest.mark.parametrize("words", ["desck:left", "usb", "serial", "serial:", "daq:Dev1"])
def test_words_that_name_no_backend_are_refused_with_those_that_there_are(desk, words):
    with pytest.raises(InputError, match="must be serial:PORT.* or daq, .* or desk"):
        check_connection(words)


@pytest.mark.parametrize(("words", "extra"), [("serial:/dev/ttyACM0", "serial"), ("daq", "daq")])
def test_where_the_package_of_a_backend_is_missing_one_sentence_says_what_to_install(words, extra, monkeypatch):
    def distribution(name):
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(importlib.metadata, "distribution", distribution)
    says = (
        rf"^\w[\w ]+ need mckibben-hardware, which is not installed: pip install 'mckibben\[{extra}\]', or in a copy "
    )
    says += rf"of the repository pip install './packages/mckibben-hardware\[{extra}\]'$"
    with pytest.raises(MissingLibraryError, match=says):
        check_connection(words)
    with pytest.raises(MissingLibraryError, match=says), connected(words, rig("paper"), 1e-3):
        pass


def test_what_a_backend_lacks_is_said_before_any_work(desk, monkeypatch):
    def check(place):
        raise InputError("--on", f"desk:{place}", "must stand on the left")

    monkeypatch.setattr(Desk, "check", staticmethod(check), raising=False)
    with pytest.raises(InputError, match="must stand on the left, got 'desk:right'"):
        check_connection("desk:right")
