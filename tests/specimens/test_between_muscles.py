"""How far another muscle of a specimen's make is from its law, and a muscle that was calibrated by readings."""

import csv
import dataclasses
from pathlib import Path

import numpy as np
import pytest

import mckibben as mk
from mckibben.bench.prepare import prepare
from mckibben.bench.recorder import initial_metadata
from mckibben.errors import InputError, PlausibilityWarning
from mckibben.identification.between import Between
from mckibben.identification.calibration import new_muscle
from mckibben.muscles.evidence import error_of, law_error, make_spread, tension_interval
from mckibben.specimens import SpecimenNumber, specimen_ids
from mckibben.specimens.model import BETWEEN_COMPONENTS
from mckibben.studies.next_measurement import readings_to_take
from mckibben.studies.sizing.candidate import judged
from mckibben.studies.sizing.catalogue import of_specimen
from mckibben.studies.sizing.requirements import Requirements
from mckibben.studies.tension import tension
from measured_data import FOLDER, measured

ROOT = Path(__file__).resolve().parents[2]
READINGS = "132 mm, 5.5 bar, 320 N", "126.75 mm, 5.5 bar, 160 N"


@pytest.fixture(scope="module")
def calibrated() -> mk.Muscle:
    with pytest.warns(PlausibilityWarning, match="correcting one number"):
        return mk.muscle("festo-10mm", rest_length="132 mm").calibrate(*READINGS)


def test_specimens_state_how_far_another_muscle_of_the_make_is_and_metadata_have_it() -> None:
    spec, law = mk.specimen("festo-10mm"), mk.muscle("festo-10mm").law
    assert law_error(spec, law)["between_muscles"] == make_spread(spec, law).to_dict()
    stated, usual = ({n: getattr(one, n) for n in BETWEEN_COMPONENTS} for one in (Between.of(spec), Between()))
    assert stated == pytest.approx(usual, rel=1e-12)  # 0.45 mm to rounding
    assert make_spread(mk.specimen("DMSP-40-400"), mk.muscle("DMSP-40-400").law).elsewhere == 0.2
    alone = mk.specimen("nylon"), mk.muscle("nylon").law
    assert make_spread(*alone) is None
    none = law_error(*alone)
    assert law_error(mk.specimen("MPYE-5-1-8-LF"), None) is None  # a valve has no tension
    assert "between_muscles" not in none and none["interval"].startswith("no interval: nothing says")


def test_the_page_on_trust_states_what_muscles_of_each_length_have() -> None:
    """The table of rest lengths is what `next --like` computes."""
    page = (ROOT / "docs/explanation/how-far-to-trust-a-number.md").read_text(encoding="utf-8")
    for rest in ("281 mm", "132 mm", "90 mm"):
        cells = []
        for same_rig in (True, False):
            asked = readings_to_take(mk.muscle("festo-10mm", rest_length=rest), same_rig=same_rig)
            shares = (asked.before, *(place["half_width"] for place in asked.places))
            cells.append(", ".join(f"{100.0 * share:.1f}" for share in shares) + " %")
        assert f"| {rest} | {' | '.join(cells)} |" in page


def test_a_muscle_that_was_characterised_has_its_own_interval() -> None:
    stated = mk.specimen("nylon")
    own = SpecimenNumber(value=0.5, unit="N")
    spec = dataclasses.replace(stated, properties=stated.properties | {"tension_uncertainty": own})
    answer = tension(spec, length="12 cm", pressure="5 bar")
    low, high = answer.interval
    assert high - low == pytest.approx(1.0, rel=1e-9) and answer.band == "95 %, this muscle"
    assert "within 0.5 N" in law_error(spec, answer.muscle.law)["interval"]


@pytest.mark.filterwarnings("ignore::mckibben.errors.PlausibilityWarning")
@pytest.mark.parametrize("rest", [0.281, 0.132, 0.09])
@pytest.mark.parametrize("make", ["festo-10mm", "festo-20mm"])
def test_one_muscle_at_one_length_and_pressure_has_one_interval_whoever_is_asked(make, rest) -> None:
    """`tension`, `next`, `size`, metadata and the home of intervals agree to rounding."""
    muscle = mk.muscle(make, rest_length=rest)
    at = {"length": 0.98 * rest, "pressure": 5e5}
    for rig in (False, True):
        band = tension_interval(muscle.specimen, muscle.law, *at.values(), same_rig=rig)
        answer = tension(make, **at, parameters={"rest_length": rest}, same_rig=rig)
        assert np.ravel(answer.interval) == pytest.approx(band, rel=1e-12)
        asked = readings_to_take(muscle, same_rig=rig)
        first, spread = asked.places[0], make_spread(muscle.specimen, muscle.law)
        ends = tension_interval(muscle.specimen, muscle.law, first["length"], first["pressure"], same_rig=rig)
        # several points at once or one alone: rounding of kernels, over the larger of both ends
        assert (first["low"], first["high"]) == pytest.approx(tuple(ends), abs=1e-12 * ends[1])
        assert asked.before == pytest.approx(spread.same_rig if rig else spread.elsewhere, rel=1e-12)
    wish = Requirements(force=1.0, stroke=0.04 * rest, pressure=5e5)
    judgement = judged(of_specimen(muscle.specimen, wish), wish)
    end = tension_interval(muscle.specimen, muscle.law, judgement.muscle.longest - wish.stroke, 5e5)
    around = float(muscle.law.tension(judgement.muscle.longest - wish.stroke, 5e5)) - judgement.end_force
    assert judgement.interval == pytest.approx(tuple(np.maximum(end - around, 0.0)), rel=1e-9)
    whole = law_error(muscle.specimen, muscle.law)
    assert muscle.cautions and whole["interval"] in str(muscle.cautions[0])
    simulation = mk.Simulation(mk.Joint(muscle, muscle, arm=0.01, span=0.98 * rest), mk.Air(supply=5e5))
    simulation.reset(pressure=1e5)
    simulation.step()
    assert set(map(str, simulation.recording().meta["law_error"].values())) == {str(whole)}


@pytest.mark.parametrize("make", ["festo-10mm", "festo-20mm"])
def test_a_run_on_a_rig_states_the_interval_of_the_muscle_that_it_runs(make) -> None:
    muscle = mk.muscle(make)
    about = initial_metadata(prepare("isometric-step", muscle=make, rig="modern"))
    assert about["law_error"] == law_error(muscle.specimen, muscle.law)


def test_nothing_is_said_of_a_muscle_of_another_bore() -> None:
    spec, law = mk.specimen("festo-10mm"), mk.muscle("festo-10mm").law
    wider = law.replace(rest_diameter=2.0 * law.rest_diameter)
    assert tension_interval(spec, wider, 0.27, 5e5) is make_spread(spec, wider) is None
    # nor where a fit wrote the file, whose bore stands with its law alone
    fitted = dataclasses.replace(
        spec, properties={k: v for k, v in spec.properties.items() if k != "rest_inner_diameter"}
    )
    assert tension_interval(fitted, law, 0.27, 5e5) is not None
    assert tension_interval(fitted, wider, 0.27, 5e5) is make_spread(fitted, wider) is None


def test_a_muscle_of_which_nothing_was_read_is_off_by_what_laboratories_differ_until_it_is() -> None:
    """Muscles of two other laboratories were 17 and 25 % off at most: 95 % of their points lie in what nobody read."""
    muscle = mk.muscle("festo-10mm", rest_length="25 cm")
    new, near = (new_muscle(muscle.specimen, muscle.law, same_rig=rig) for rig in (False, True))
    at = np.linspace(0.22, 0.25, 7), np.full(7, 5e5)
    assert (new.predict(*at)[1] >= 0.2 * new.muscle.largest * (1.0 - 1e-12)).all()
    assert (near.predict(*at)[1] < 0.2 * near.muscle.largest).all()
    assert new.conditioned([(0.25, 5.5e5, 350.0)]).predict(*at)[1].mean() < 0.12 * new.muscle.largest


def test_on_the_rig_of_its_make_a_muscle_lies_within_less() -> None:
    at = {"length": "27 cm", "pressure": "5 bar"}
    with pytest.warns(PlausibilityWarning):
        every, same = (tension("festo-10mm", **at, same_rig=rig).points[0] for rig in (False, True))
        read = [tension("festo-10mm", **at, reading=["281 mm, 5.5 bar, 390 N"], same_rig=rig) for rig in (False, True)]
    assert every["tension"] == same["tension"]
    assert same["tension_high"] < every["tension_high"]
    elsewhere, here = (one.interval[1] - one.interval[0] for one in read)
    assert here < elsewhere
    with pytest.raises(InputError, match="same_rig is allowed only for a muscle whose specimen states"):
        tension("nylon", length="12 cm", pressure="5 bar", same_rig=True)


@pytest.mark.filterwarnings("ignore::mckibben.errors.PlausibilityWarning")
@pytest.mark.parametrize("rest", [0.05, 0.09, 0.132, 0.281, 0.4])
@pytest.mark.parametrize("make", [name for name in specimen_ids() if "gain" in mk.specimen(name).between])
def test_the_rig_of_the_make_is_never_less_sure_than_another_nor_a_reading_than_none(make: str, rest: float) -> None:
    """Of the signed force whatever was read; of what is printed where the reading is what the make pulls.

    A reading that surprises leaves the law, which has three parameters, beside the mean, and the printed interval holds that
    distance, too.
    """
    muscle = mk.muscle(make, rest_length=rest)
    grid = np.meshgrid(np.linspace(0.75, 1.0, 9) * rest, np.linspace(1e4, 6e5, 8))
    length, pressure = (axis.ravel() for axis in grid)
    same, far = (new_muscle(muscle.specimen, muscle.law, same_rig=rig) for rig in (True, False))
    most = 1.0 + 1e-9  # rounding of a solve of two rows

    def deviations(new, readings=()):
        return np.sqrt(np.diag((new.conditioned(readings) if readings else new).moments(length, pressure)[1]))

    taut = same.predict(length, pressure)[0] > 0.0
    before = [tension_interval(muscle.specimen, muscle.law, length, pressure, same_rig=rig) for rig in (True, False)]
    assert (np.ptp(before[0], axis=0) <= most * np.ptp(before[1], axis=0)).all()
    assert (deviations(same) <= most * deviations(far)).all()
    for shares in ((1.0,), (0.96,), (1.0, 0.96)):
        pulls = [float(muscle.law.tension(share * rest, 5.5e5)) for share in shares]
        for off in (0.8, 1.0, 1.2):
            # a short wide muscle hangs slack when it is shortened, and a reading of nothing tells nothing
            readings = [(share * rest, 5.5e5, max(off * pull, 0.1)) for share, pull in zip(shares, pulls, strict=True)]
            assert (deviations(same, readings) <= most * deviations(far, readings)).all()
            assert (deviations(same, readings) <= most * deviations(same)).all()
        if min(pulls) > 0.0:
            readings = [(share * rest, 5.5e5, pull) for share, pull in zip(shares, pulls, strict=True)]
            halves = [one.conditioned(readings).predict(length, pressure)[1][taut] for one in (same, far)]
            assert (halves[0] <= most * halves[1]).all()
            assert (halves[0] <= most * (before[0][1] - np.asarray(muscle.law.tension(length, pressure)))[taut]).all()


def test_readings_move_an_answer_and_narrow_its_interval() -> None:
    at = {"length": "12.4 cm", "pressure": "5 bar", "parameters": {"rest_length": "132 mm"}}
    with pytest.warns(PlausibilityWarning):
        whole, read = tension("festo-10mm", **at), tension("festo-10mm", **at, reading=READINGS)
    widths = [float((answer.interval[1] - answer.interval[0])[0]) for answer in (whole, read)]
    assert widths[1] < 0.7 * widths[0]
    assert whole.points[0]["tension"] != read.points[0]["tension"]


def test_a_calibrated_muscle_is_saved_with_its_readings_and_answers_alike(calibrated, tmp_path) -> None:
    again = mk.muscle(calibrated.save(tmp_path / "mine.toml"))
    at = np.linspace(0.118, 0.132, 5), np.full(5, 5e5)
    assert np.asarray(again.law.tension(*at)).tobytes() == np.asarray(calibrated.law.tension(*at)).tobytes()
    ours, theirs = (new_muscle(one.specimen, one.law) for one in (calibrated, again))
    assert ours.readings == theirs.readings
    for one, other in zip(ours.predict(*at), theirs.predict(*at), strict=True):
        assert one == pytest.approx(other, rel=1e-12)  # digits of the file
    make = mk.muscle("festo-10mm", rest_length="132 mm")
    assert make_spread(again.specimen, again.law).calibrated < make_spread(make.specimen, make.law).elsewhere


def test_a_calibrated_muscle_is_one_and_is_not_cut(calibrated) -> None:
    with pytest.raises(InputError, match="is one muscle, calibrated by readings, got 20 cm; cut its make instead"):
        mk.muscle(calibrated.specimen, rest_length="20 cm")


def test_a_muscle_whose_make_is_not_known_is_not_calibrated() -> None:
    with pytest.raises(InputError, match="nylon does not state how far muscles of its make differ"):
        mk.muscle("nylon").calibrate("12 cm, 5 bar, 50 N")


@measured("aarl_20mm_isometric/quasistatic_plateaus.csv")
def test_the_20_mm_muscles_are_met_as_the_specimen_states_and_lie_within_its_interval() -> None:
    named = {"219": 216.0, "209": 206.0}  # set lengths as the files are named, see the specimen
    spec, errors, inside = mk.specimen("festo-20mm"), [], []
    with open(FOLDER / "aarl_20mm_isometric/quasistatic_plateaus.csv", newline="") as stream:
        rows = list(csv.DictReader(stream))
    read = [
        [float(r["rest_length_mm"]), named.get(r["test_length_mm"], float(r["test_length_mm"])),
         1e3 * (float(r["pressure_kPa"]) - 11.0), float(r["force_N"]) + 18.595]
        for r in rows
    ]  # fmt: skip
    table = np.array([row for row in read if row[2] > 2e4 and row[3] > 0.0])
    top = table[:, 3].max()
    for rest in np.unique(table[:, 0]):
        muscle = mk.muscle("festo-20mm", rest_length=1e-3 * rest)
        _, length, pressure, force = table[table[:, 0] == rest].T
        errors.append((np.asarray(muscle.law.tension(1e-3 * length, pressure)) - force) / top)
        band = tension_interval(muscle.specimen, muscle.law, 1e-3 * length, pressure, same_rig=True)
        inside.append((band[0] <= force) & (force <= band[1]))
    stated, found = error_of(spec, "seated_braid"), np.concatenate(errors)
    # stated to two digits; rest lengths, pressures and forces of the table to three
    assert np.sqrt(np.mean(found**2)) == pytest.approx(stated.rms, rel=0.03)
    assert np.abs(found).max() == pytest.approx(stated.largest, rel=0.03)
    assert np.concatenate(inside).mean() > 0.95  # the muscles that it was fitted to lie within less than others
