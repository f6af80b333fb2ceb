"""Where the exergy of runs on a rig went: the accounts close, and a saved file is enough to find them again."""

import functools
import json

import numpy as np
import pytest
from short_runs import SHORT, bench

from mckibben.analysis.energy_accounts import energy_account
from mckibben.bench.joint_run import joint_stand, run_joint
from mckibben.bench.rig_file import rig
from mckibben.bench.run import run
from mckibben.cli import main
from mckibben.errors import InputError, PlausibilityWarning
from mckibben.recordings import read_recording

DESTROYED = ("valve", "tube", "dead_volume", "exhaust", "leak", "machine", "mixing", "heat", "friction", "viscous")


@functools.cache
def done(name):
    return run(bench(name, **SHORT[name]))


def closes(recording):
    """1e-6 of the exergy that crossed the border, as promised; nothing negative is destroyed, but for rounding."""
    stated = recording.meta["energy"]["exergy"]
    assert recording.meta["balance"]["exergy"] < 1e-6, stated
    for name in DESTROYED:
        assert stated["out"][name] >= -1e-9 * stated["throughput"], (name, stated)


@pytest.mark.parametrize("name", ["isometric-step", "isotonic-triangle"])
def test_the_exergy_of_short_protocols_closes_with_adiabatic_chambers(name):
    closes(done(name))


@pytest.mark.slow
@pytest.mark.parametrize("name", SHORT)
def test_the_exergy_of_all_shipped_protocols_closes_with_adiabatic_chambers(name):
    closes(done(name))


@pytest.mark.slow
def test_the_exergy_of_leak_down_closes_with_adiabatic_chambers():
    tight = rig("modern", {"plumbing.tight.heat": "adiabatic", "plumbing.tight.leak.flow_into_the_room": "200 ml/min"})
    recording = run(bench("leak-down", on=tight, settle="1 s", longest="5 s"))
    closes(recording)
    assert recording.meta["energy"]["exergy"]["out"]["leak"] > 0.0


def test_the_exergy_closes_with_walls_that_take_heat():
    warm = rig("paper", {"plumbing.direct.heat": "0.2 W/K"})
    recording = run(bench("isometric-step", on=warm, **SHORT["isometric-step"]))
    closes(recording)
    assert recording.meta["energy"]["exergy"]["out"]["heat"] > 0.0


@functools.cache
def turned():
    stand = joint_stand(rig=rig("modern", {"plumbing.direct.heat": "adiabatic"}))
    # 500 samples: the physics of a joint goes on to the end of a chunk of so many, and its integrals with it
    return run_joint(stand, duration=0.499, angle=lambda t: 0.2 * np.sin(2.0 * np.pi * 2.0 * t), stiffness=3.0)


@pytest.mark.slow
def test_the_exergy_of_a_joint_with_two_muscles_closes_and_is_found_again_in_its_samples():
    recording = turned()
    closes(recording)
    whole, part = energy_account(recording), energy_account(recording, start=0.0)
    assert [p.origin for p in part.parts[:-1]] == ["from samples"] * (len(part.parts) - 1)
    # the last of 500 intervals of 1 ms is not recorded; quadrature adds less than that
    for name in ("supply", "valve", "exhaust", "dead_volume", "shaft_work"):
        assert part.value(name) == pytest.approx(whole.value(name), abs=0.01 * whole.value("supply"))


def test_a_saved_file_is_enough(tmp_path):
    file = done("isometric-step").save(tmp_path / "run.nc")
    read, first = (energy_account(r) for r in (read_recording(file), done("isometric-step")))
    assert read.parts == first.parts and read.cycles == first.cycles and read.parts[0].origin == "integral"
    assert read.parts[-1].origin == "remainder"
    assert sum(p.value if p.side == "into" else -p.value for p in read.parts) == pytest.approx(0.0, abs=1e-12)


def test_samples_tell_what_the_integrals_say():
    """The isometric step is recorded but for its first quarter of a second, in which nothing flows; 0.2 ms apart."""
    record = done("isometric-step")
    whole, part = energy_account(record), energy_account(record, start=float(record.time[0]))
    assert not part.energy and whole.energy
    scale = whole.value("supply")
    for name in ("supply", "valve", "tube", "exhaust", "dead_volume", "mixing", "shaft_work"):
        assert part.value(name) == pytest.approx(whole.value(name), abs=1e-3 * scale), name
    assert abs(part.remainder) < 1e-3 * scale
    assert part.air == pytest.approx(whole.air, rel=1e-3)
    for how, work in whole.compressor.items():
        assert part.compressor[how] / part.air == pytest.approx(work / whole.air, rel=1e-9), how  # one pressure


def test_every_cycle_adds_up_and_tells_its_remainder():
    # down to 2.8 bar: with less, 50 N pull the braid taut, and the motor bounces on its threads
    low = {"low": "2.8 bar", "cycles": 3}
    account = energy_account(run(bench("isotonic-triangle", **SHORT["isotonic-triangle"] | low)))
    assert len(account.cycles) == 2
    for cycle in account.cycles:
        assert sum(p.value if p.side == "into" else -p.value for p in cycle.parts) == pytest.approx(0.0, abs=1e-12)
        assert abs(cycle.parts[-1].value) < 1e-3 * cycle.supply  # quadrature over samples of 1 ms at 5 Hz
        assert cycle.compressor > cycle.supply  # without cooling it costs more
        assert 1.0 < cycle.work_out < 1.3  # [J]; 50 N over 2.2 cm
    work, found = account.value("shaft_work"), account.efficiencies()
    assert found["supply"] == work / account.value("supply")
    assert abs(found["adiabatic compressor"]) < abs(found["isothermal compressor"])


def test_an_accumulator_saves_no_more_than_is_thrown_away_and_less_air_at_a_higher_pressure():
    account = energy_account(done("isotonic-triangle"))
    found = [account.saved_by_accumulator(p) for p in (0.5e5, 1e5, 2e5, 4e5, 6e5)]
    part = energy_account(done("isotonic-triangle"), start=float(done("isotonic-triangle").time[0]))
    thrown = part.value("exhaust") + part.value("dead_volume")
    assert all(a.air >= b.air for a, b in zip(found, found[1:], strict=False))
    assert 0.0 < found[1].exergy < thrown and found[-1].air == 0.0
    with pytest.raises(InputError, match="pressure"):
        account.saved_by_accumulator(0.0)


def test_measured_channels_give_the_work_and_roughly_the_air():
    """Work while it shortens within 8 %: 8 bits, and the lag of the cell's filter at 5 Hz. Air within a half: these chambers
    are adiabatic, and the estimate takes gas at the room's temperature.
    """
    account = energy_account(done("isotonic-triangle"))
    with pytest.warns(PlausibilityWarning, match="at different mean pressures"):  # the first cycle comes from the rest
        estimate = energy_account(done("isotonic-triangle"), measured=True)
    assert estimate.kind == "measured" and "heat" in estimate.unknown and "heat" not in [p.name for p in estimate.parts]
    assert {p.origin for p in estimate.parts} == {"estimate", "remainder"}
    true = np.mean([c.work_out for c in account.cycles])
    assert np.mean([c.work_out for c in estimate.cycles]) == pytest.approx(true, rel=0.08)
    air = np.mean([c.air for c in account.cycles])
    assert np.mean([c.air for c in estimate.cycles]) == pytest.approx(air, rel=0.5)
    with pytest.raises(InputError, match="Cannot be known"):
        estimate.value("heat")


def test_the_command_prints_one_object_and_draws(tmp_path, capsys):
    file, picture = done("isometric-step").save(tmp_path / "run.nc"), tmp_path / "flow.svg"
    with pytest.raises(SystemExit) as stop:
        main(["record", "energy", str(file), "--json", "--out", str(picture), "--accumulator-pressure", "1 bar"])
    found = json.loads(capsys.readouterr().out)
    assert stop.value.code == 0 and picture.stat().st_size > 1000
    assert found["exergy"][0]["name"] == "supply" and found["saving"]["exergy"] > 0.0
    assert abs(found["remainder"]) < 1e-6 * found["throughput"]
    with pytest.raises(SystemExit) as stop:
        main(["record", "energy", str(file)])
    out = capsys.readouterr().out
    assert stop.value.code == 0 and "dead_volume" in out and "Cycles" in out
