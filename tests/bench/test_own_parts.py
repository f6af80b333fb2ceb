"""Parts of a user's own file stand where files name parts: laws, sensors, controllers, valves."""

from importlib import resources
from pathlib import Path

import pytest

import mckibben as mk
from mckibben.assembly.build import unit_from_specimen
from mckibben.assembly.check import _tension_and_volume
from mckibben.assembly.circuit_file import read_circuit
from mckibben.bench.rig_file import rig
from mckibben.components.programs import program_key
from mckibben.errors import InputError
from mckibben.identification import fit
from mckibben.muscles import LAWS, law_from_specimen
from mckibben.muscles.law import law_name
from mckibben.muscles.laws import law_key
from mckibben.registry import allow_code
from mckibben.specimens import map_file, specimen

PARTS = """
import jax.numpy as jnp

import mckibben as mk
from mckibben.bench.sensors import SensorKind
from mckibben.bench.software.controllers import bounded, first_trim
from mckibben.components import Module
from mckibben.components.flow import FlowElement, TwoPort
from mckibben.muscles.hysteresis import Dahl
from mckibben.pneumatics.orifice import Orifice


class Spring(mk.TensionLaw):
    title = "gas and spring"
    cites = ()
    fitted = ("gain", "slope")

    gain = mk.quantity("m^2", (1e-8, 1e-1), "force per pressure at rest", typical=(1e-4, 5e-3))
    slope = mk.quantity("m", (-1e3, 1e3), "force per pressure and length", typical=(1e-3, 1e-1))
    rest_length = mk.quantity("m", (1e-3, 10.0), "rest length")

    def elastic_tension(self, length):
        return 0.0 * length

    def gas_energy(self, length, pressure):
        x = self.rest_length - length
        return pressure * (self.gain * (self.rest_length + x) - 0.5 * self.slope * x * x)

    def length_range(self):
        return 0.5 * self.rest_length, 1.1 * self.rest_length


def _temperature(plant, state, memory, inputs):
    return plant.machine.outputs(state, memory, inputs)["muscle.temperature"]


GAS = SensorKind(
    unit="K", quantity="temperature", label="temperature, gas", symbol="T", meaning="temperature of the gas, measured",
    true_value=_temperature,
)


class Careful(Module):
    share = mk.quantity("1", (0.0, 1.0), "share of the set-point", default=0.5)

    def initial(self):
        return first_trim()

    def step(self, state, set_point, pressure, dt, active=1.0):
        return state, bounded(self.share * set_point, 0.0, 3e5)


class Needle(TwoPort):
    symbol = "restriction"
    passage: Orifice
    turns = mk.quantity("1", (0.0, 20.0), "turns of the needle")

    def mass_flow(self, a, b, state=(), command=0.0):
        return self.passage.mass_flow(a, b, (), jnp.minimum(self.turns / 8.0, 1.0))


class Switched(FlowElement):
    ports = ("supply", "outlet", "exhaust")
    paths = ((0, 1), (1, 2))
    command_unit = "Pa"
    fill: Orifice
    vent: Orifice

    def flows(self, gas, state, memory, command):
        error = (command - gas[1].pressure_abs + gas[2].pressure_abs) / 2e4
        return (
            self.fill.mass_flow(gas[0], gas[1], (), jnp.clip(error, 0.0, 1.0)),
            self.vent.mass_flow(gas[1], gas[2], (), jnp.clip(-error, 0.0, 1.0)),
        )


class Bristle(Dahl):
    pass
"""
VALVE = """[plumbing.direct.valve]
kind = "parts.py:Switched"
nominal_flow = "60 l/min"
"""
HOLD = """
schema = 1
name = "hold"
[control.pressure]
controller = "parts.py:Careful"
share = 0.4
[[steps]]
pressure = "3 bar"
for = "0.1 s"
"""
TANK = """
schema = 1
title = "A tank behind a needle"
[nodes.supply]
kind = "reservoir"
pressure = "5 bar"
[nodes.tank]
kind = "volume"
volume = "50 ml"
[elements.needle]
kind = "parts.py:Needle"
from = "supply"
to = "tank"
nominal_flow = "20 l/min"
turns = 2
[run]
duration = "60 ms"
step = "250 us"
"""
SENSOR = """
[sensors.gas]
kind = "parts.py:GAS"
low = "200 K"
high = "400 K"
cutoff = "5 Hz"
[sensors.gas.converter]
bits = 12
low = "200 K"
high = "400 K"
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with `parts.py`, which is not the one that the tests run in: paths begin at the folder of a file."""
    (tmp_path / "parts.py").write_text(PARTS)
    allow_code(tmp_path / "parts.py")
    return tmp_path


def own_rig(folder: Path, old: str = "", new: str = "") -> Path:
    text = (resources.files("mckibben.bench") / "rigs" / "modern.toml").read_text()
    controller = '[control.pressure]\ncontroller = "parts.py:Careful"\nshare = 0.4\n[unused]\n'
    head, _, tail = text.partition("[control.pressure]\n")
    text = head + controller.removesuffix("[unused]\n") + tail[tail.index("[") :] + SENSOR
    path = folder / "my-rig.toml"
    path.write_text(text.replace(old, new) if old else text)
    return path


def test_a_rig_takes_a_controller_and_a_sensor_of_its_own(folder: Path) -> None:
    mine = rig(own_rig(folder))
    assert type(mine.pressure).__name__ == "Careful"
    _, asked = mine.pressure.step(mine.pressure.initial(), 2e5, 0.0, 1e-3)
    assert float(asked) == pytest.approx(0.4 * 2e5)  # a product of two floats
    # 200 K over the steps of 12 bits
    assert mine.resolution()["gas"] == pytest.approx(200.0 / 4096)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("parts.py:Careful", "parts.py:Carefree", "has no 'Carefree'. Did you mean 'Careful'? It has Spring, "),
        ("parts.py:Careful", "parts.py:GAS", "parts.py:GAS must be a class derived from "),
        ("parts.py:GAS", "parts.py:Careful", "parts.py:Careful must be a mckibben.bench.sensors"),
        ("parts.py:GAS", "gone.py:GAS", "File not found: "),
        ("share = 0.4", "share = 4", "control.pressure.share must be between 0 and 1, got 4"),
    ],
)
def test_a_part_that_cannot_be_loaded_is_refused_in_a_sentence(old: str, new: str, sentence: str, folder: Path) -> None:
    with pytest.raises(InputError) as error:
        rig(own_rig(folder, old, new))
    assert str(error.value).startswith(str(folder / "my-rig.toml"))
    assert sentence in str(error.value)


def test_a_circuit_takes_a_valve_of_its_own(folder: Path) -> None:
    (folder / "tank.toml").write_text(TANK)
    plan = read_circuit(folder / "tank.toml")
    assert "Needle" in repr(plan.circuit)
    (folder / "tank.toml").write_text(TANK.replace("Needle", "Careful"))
    with pytest.raises(InputError, match="Careful must be a class derived from mckibben.components.flow"):
        read_circuit(folder / "tank.toml")


def own_valve(folder: Path, old: str = "", new: str = "") -> Path:
    text = (resources.files("mckibben.bench") / "rigs" / "modern.toml").read_text()
    head, _, tail = text.partition("[plumbing.direct.valve]\n")
    path = folder / "my-rig.toml"
    path.write_text((head + VALVE + tail[tail.index("[") :]).replace(old or "\0", new))
    return path


def test_a_rig_takes_a_valve_of_its_own(folder: Path) -> None:
    mine = rig(own_valve(folder))
    valve = mine.plumbing["direct"].valve
    assert type(valve).__name__ == "Switched"
    # Both are choked from 9 bar, so that the rates are in the ratio of the conductances.
    usual = rig("modern")
    share = float(valve.fill.conductance / usual.plumbing["direct"].valve.fill.conductance)
    rates = [one.limits("direct").pressure_rate for one in (mine, usual)]
    assert rates[0] / rates[1] == pytest.approx(share, rel=1e-12)  # rounding of a few products
    circuit = mk.Air(supply="6 bar", valve=valve).build({"muscle": unit_from_specimen("nylon")})
    assert [(drive.command, drive.unit) for drive in circuit.drives] == [("muscle", "Pa")]
    assert circuit.settles == {"muscle": "muscle"}


@pytest.mark.parametrize(
    ("kind", "sentence"),
    [
        ("parts.py:Needle", "plumbing.direct.valve.kind must be an element with the ports supply, outlet and exhaust"),
        ("spool_valve", "whose command is a gauge pressure (command_unit = 'Pa'), got 'spool_valve'"),
        ("spool", "Unknown plumbing.direct.valve.kind 'spool'. Did you mean 'spool_valve'?"),
    ],
)
def test_a_valve_that_a_rig_cannot_use_is_refused_in_a_sentence(kind: str, sentence: str, folder: Path) -> None:
    with pytest.raises(InputError) as error:
        rig(own_valve(folder, "parts.py:Switched", kind))
    assert sentence in str(error.value)
    assert str(error.value).count("my-rig.toml") == 1


def test_a_muscle_takes_a_friction_of_its_own(folder: Path) -> None:
    text = (resources.files("mckibben.specimens") / "data" / "nylon.toml").read_text()
    stated = """
[friction."parts.py:Bristle"]
constant = { value = 3, unit = "N" }
stiffness = { value = 30, unit = "N/mm" }
"""
    (folder / "mine.toml").write_text(text + stated)
    muscle = mk.muscle(folder / "mine.toml")
    assert type(muscle.friction).__name__ == "Bristle"  # though the file states one of the package too
    assert float(muscle.friction.largest_force(5e5)) == 3.0
    assert float(muscle.friction.stiffness) == 3e4
    assert type(mk.muscle(folder / "mine.toml", friction="maxwell_slip").friction).__name__ == "MaxwellSlip"
    (folder / "mine.toml").write_text(text + stated.replace("stiffness", "stifness"))
    with pytest.raises(InputError, match=r"Did you mean 'stiffness'\?"):
        mk.muscle(folder / "mine.toml")
    with pytest.raises(InputError, match="Careful must be a class derived from mckibben.components.Hysteresis"):
        mk.muscle("nylon", friction=f"{folder}/parts.py:Careful")


def test_a_protocol_takes_a_controller_of_its_own(folder: Path) -> None:
    (folder / "hold.toml").write_text(HOLD)
    wanted = mk.protocol(folder / "hold.toml")
    assert f"The pressure is controlled by {folder}/parts.py:Careful with share 0.4." in wanted.sentence()
    prepared = mk.prepare(wanted, muscle="nylon", rig="modern")
    assert type(prepared.rig.pressure).__name__ == "Careful"
    assert prepared.rig.document["control"]["pressure"]["share"] == 0.4  # as the recording will tell
    assert prepared.rig.force == rig("modern").force
    (folder / "hold.toml").write_text(HOLD.replace("share = 0.4", "share = 4"))
    with pytest.raises(InputError, match="control.pressure.share must be between 0 and 1, got 4"):
        mk.prepare(str(folder / "hold.toml"), muscle="nylon", rig="modern")


def test_a_protocol_changes_single_gains_of_the_rig(folder: Path) -> None:
    text = HOLD.replace('controller = "parts.py:Careful"\nshare = 0.4', 'ki = "2 1/s"')
    (folder / "hold.toml").write_text(text)
    prepared = mk.prepare(str(folder / "hold.toml"), muscle="nylon", rig="modern")
    usual = rig("modern").pressure
    assert prepared.rig.pressure == usual.replace(ki=2.0)
    plain = text.replace('[control.pressure]\nki = "2 1/s"\n', "")
    (folder / "plain.toml").write_text(plain)
    assert mk.protocol(folder / "plain.toml").digest != prepared.protocol.digest


def test_a_law_is_fitted_saved_and_read_from_another_folder(folder: Path) -> None:
    points = mk.read_force_map(map_file(specimen("DMSP-20-300")), rest_length=0.3)
    ranking = fit(points, [f"{folder}/parts.py:Spring"], schemes=())
    found = ranking.best
    (folder / "below").mkdir()
    ranking.save(folder / "below" / "mine.toml")
    assert 'law = "../parts.py:Spring"' in (folder / "below" / "mine.toml").read_text()
    again = law_from_specimen(specimen(folder / "below" / "mine.toml"))
    assert float(again.gain) == found.parameters["gain"].value
    assert law_key(type(found.build())) == found.law  # the class itself stands for its name


def test_a_kept_program_is_that_of_the_file_as_it_is(folder: Path) -> None:
    def key(text: str) -> str | None:
        (folder / "parts.py").write_text(text)
        law = LAWS.find(f"{folder}/parts.py:Spring")(gain=1e-3, slope=0.02, rest_length=0.3)
        assert law_name(law) == f"{folder}/parts.py:Spring"
        return program_key(_tension_and_volume, (law, 0.2, 3e5))

    first = key(PARTS)
    assert first is not None
    assert key(PARTS.replace("0.0 * length", "1.0 * length")) not in (first, None)
    assert key(PARTS) == first
    # What the file takes from a neighbour nobody watches: it is compiled anew in each process.
    (folder / "neighbour_of_parts.py").write_text("def two():\n    return 2.0\n")
    assert key(f"from neighbour_of_parts import two\n{PARTS}") is None
