"""Faults of a rig: each reaches the part whose physics it is, and a rig without faults is untouched."""

import numpy as np
import pytest

from mckibben.assembly.build import rig_unit
from mckibben.bench.rig import RigFaults
from mckibben.bench.rig_file import rig
from mckibben.errors import InputError
from mckibben.muscles.worn_braid import WornBraid

LEAK = "0.2 l/min/bar"


def faulty(**faults):
    return rig("modern", {f"faults.{name}": value for name, value in faults.items()})


@pytest.fixture(scope="module")
def nylon():
    return rig_unit("nylon")


def test_a_rig_without_faults_has_the_parts_of_its_file(nylon):
    sound = rig("modern")
    direct = sound.plumbing["direct"]
    assert sound.faults.present == {} and not sound.faults.drifts()
    # the same objects: so a run has the same bits
    assert sound.faults.plumbing(direct) is direct and sound.faults.unit(nylon) is nylon


def test_a_leak_adds_to_the_leak_that_the_plumbing_has():
    on = faulty(leak=LEAK)
    conductance = 0.2e-3 / 60.0 / 1e5
    for name in ("direct", "tight"):
        before = on.plumbing[name].leak
        own = 0.0 if before is None else float(before.conductance)
        assert float(on.faults.plumbing(on.plumbing[name]).leak.conductance) == pytest.approx(conductance + own)


def test_a_blocked_valve_passes_less_and_a_sticking_one_has_more_play():
    on = faulty(valve_blockage="40 %", valve_sticking="20 mbar")
    sound = on.plumbing["direct"].valve
    worn = on.faults.plumbing(on.plumbing["direct"]).valve
    assert float(worn.fill.conductance) == pytest.approx(0.6 * float(sound.fill.conductance))
    assert float(worn.relief.conductance) == pytest.approx(0.6 * float(sound.relief.conductance))
    assert float(worn.hysteresis) == pytest.approx(float(sound.hysteresis) + 2e3)


def test_wear_reaches_the_machine_and_a_slack_clamp_its_tendon(nylon):
    on = faulty(clamp_slack="1 mm", lost_threads="10 %", rubber_warming="20 K")
    unit = on.machine("direct", nylon, start=0.13, moves=True).units["muscle"]
    assert float(unit.tendon.slack_length) == pytest.approx(float(nylon.tendon.slack_length) + 1e-3)
    assert isinstance(unit.law, WornBraid) and unit.law.sound is nylon.law


def test_a_slipping_clamp_reaches_the_machine_with_its_grip(nylon):
    from mckibben.bench.rig import SOUND_GRIP

    on = faulty(clamp_grip="55 N")
    unit = on.machine("direct", nylon, start=0.13, moves=True).units["muscle"]
    assert float(unit.clamp.grip) == 55.0 and on.faults.present == {"clamp_grip": 55.0}
    assert float(rig("modern").faults.clamp_grip) == SOUND_GRIP  # which no muscle reaches


def test_a_drifting_sensor_is_off_by_its_rate_times_the_time(nylon):
    from mckibben.bench.prepare import prepare
    from mckibben.bench.segment import CHUNK, SensorNoise

    on = faulty(pressure_drift="1 mbar/s", span_drift="-0.1 mm/s")
    noise = SensorNoise(prepare("work-loop", muscle=nylon, rig=on, cycles=1), 0)
    drift = noise.next()["drift"]
    period = noise.period
    np.testing.assert_allclose(drift["pressure"], 100.0 * period * np.arange(CHUNK))
    np.testing.assert_allclose(drift["span"], -1e-4 * period * np.arange(CHUNK))
    assert "drift" not in SensorNoise(prepare("work-loop", muscle=nylon, rig="modern", cycles=1), 0).next()


@pytest.mark.parametrize(
    ("faults", "message"),
    [
        ({"leek": LEAK}, "leak"),
        ({"leak": "0.2 bar"}, "faults.leak"),
        ({"leak": "-1 l/min/bar"}, "faults.leak"),
        ({"lost_threads": "120 %"}, "faults.lost_threads"),
        ({"clamp_slack": "1 m"}, "faults.clamp_slack"),
        ({"clamp_grip": "0 N"}, "faults.clamp_grip"),
    ],
)
def test_a_wrong_fault_is_named(faults, message):
    with pytest.raises(InputError, match=message):
        faulty(**faults)


def test_only_a_pressure_regulator_can_stick():
    direct = rig("modern").plumbing["direct"]
    other = direct.with_fields(valve=direct.tube)  # no regulator
    with pytest.raises(InputError, match="pressure regulators only"):
        RigFaults(valve_sticking=1e3).plumbing(other)


def test_faults_may_stand_beside_a_base(tmp_path):
    own = tmp_path / "own.toml"
    own.write_text(f'schema = 1\nname = "own"\ntitle = "Own"\nbase = "paper"\n[faults]\nleak = "{LEAK}"\n')
    assert rig(own).faults.present == pytest.approx({"leak": 0.2e-3 / 60.0 / 1e5})
