"""The serial line by name: the speed of its port."""

import types

import pytest

from mckibben.bench.hardware.backends import connected
from mckibben.bench.rig_file import rig
from mckibben.errors import InputError


@pytest.mark.parametrize(
    ("place", "port", "speed"),
    [
        ("/dev/ttyUSB0@3000000", "/dev/ttyUSB0", {"baud": 3_000_000}),
        ("/dev/ttyACM0", "/dev/ttyACM0", {}),
        ("/dev/by-id/a@b", "/dev/by-id/a@b", {}),  # a port whose name has such a character
    ],
)
def test_the_speed_of_a_serial_port_stands_behind_its_name(monkeypatch, place, port, speed):
    opened = []

    def open_port(at, *arguments, **options):
        opened.append((at, {name: value for name, value in options.items() if name == "baud"}))
        return types.SimpleNamespace(close=lambda: None)

    monkeypatch.setattr("mckibben_hardware.serial_line.SerialHardware", open_port)
    with connected(f"serial:{place}", rig("paper"), 1e-3):
        assert opened == [(port, speed)]


def test_a_serial_port_without_speed_is_refused():
    with (
        pytest.raises(InputError, match="must state 1 bit per second or more"),
        connected("serial:x@0", rig("paper"), 1e-3),
    ):
        pass
