"""One friction and one creep of several muscles: what goes into recordings comes out, and nothing where nothing went in."""

import json
from dataclasses import replace

import numpy as np
import pytest

import mckibben as mk
from mckibben.errors import InputError
from mckibben.estimation import Estimate
from mckibben.identification import shared_hysteresis
from mckibben.identification.fit import Fit, fitted_specimen
from mckibben.identification.shared_hysteresis import (
    LOW,
    NOTHING,
    HysteresisModel,
    SharedHysteresis,
    fit_shared_hysteresis,
    read_recordings,
)
from mckibben.muscles.build import build_law
from mckibben.muscles.laws import law_type
from mckibben.quantities import declared
from mckibben.recordings import Channel, ForceMap, Recording
from mckibben.specimens import save_specimen

RESTS = (0.2, 0.3)
PARAMETERS = dict(rest_radius=0.01, rest_angle=0.45, end_factor=1.2)
NOISE = 0.3  # of the tension [N]
TIME = np.linspace(0.0, 8.0, 400)
TIMES = np.array([0.1, 1.0, 10.0])  # of the Maxwell elements [s]
# Corners of the motion in time [s] and from the longest length [m].
CORNERS = np.array([0.0, 1.0, 3.0, 4.5, 6.0, 8.0]), np.array([0.0, -0.008, 0.0, -0.012, -0.004, -0.01])


def static_fit() -> Fit:
    """The exact law on a table of two muscles."""
    rest, share, pressure = (a.ravel() for a in np.meshgrid(RESTS, (0.9, 0.95, 1.0), (2e5, 4e5, 6e5)))
    law = build_law("tondu_lopez", PARAMETERS | {"rest_length": rest, "upper_length": rest})
    points = ForceMap(
        name="two",
        length=rest * share,
        pressure=pressure,
        tension=np.asarray(law.tension(rest * share, pressure)),
        rest_length=rest,
    )
    units = declared(law_type("tondu_lopez"))
    exact = {name: Estimate(value, value, value, units[name].unit) for name, value in PARAMETERS.items()}
    known = {"rest_length": rest, "upper_length": rest}
    return Fit("tondu_lopez", exact, known, points, np.zeros(len(points)), True, "", ())


FIT = static_fit()


def friction(displacement: np.ndarray, limit: float, stiffness: float) -> np.ndarray:
    """Bouc and Wen's friction with a share of one half along a path, by its closed form between the samples."""
    force, forces = 0.0, []
    for dx in np.diff(displacement, prepend=displacement[0]):
        way = np.sign(dx)
        f, left = way * force, abs(dx)
        if f < 0.0:  # it unloads with the stiffness of the contact
            used = min(left, -f / stiffness)
            f, left = f + stiffness * used, left - used
        f = limit - (limit - f) * np.exp(-left * stiffness / limit) if left > 0.0 else f
        force = way * f if way else force
        forces.append(force)
    return np.array(forces)


def creep(total: float) -> np.ndarray:
    """Maxwell elements along the straight pieces of the motion, by superposition of ramps."""
    rates = np.diff(CORNERS[1]) / np.diff(CORNERS[0])
    force = np.zeros(len(TIME))
    for start, change in zip(CORNERS[0], np.diff(rates, prepend=0.0), strict=False):
        since = np.maximum(TIME - start, 0.0)[:, None]
        force += total / 3.0 * change * np.sum(TIMES * (1.0 - np.exp(-since / TIMES)), axis=1)
    return force


def recordings(constant: float = 0.0, per_pressure: float = 0.0, stiffness: float = 5e3, elements: float = 0.0) -> dict:
    """Both muscles at 2 and at 5 bar, from a length at which they are mounted relaxed."""
    noise, made = np.random.default_rng(4), {}
    for rest in RESTS:
        law = build_law("tondu_lopez", PARAMETERS | {"rest_length": rest, "upper_length": rest})
        for at in (2e5, 5e5):
            moved = np.interp(TIME, *CORNERS)
            length, pressure = rest + moved, np.full(len(TIME), at)
            limit = constant + per_pressure * at
            beside = creep(elements) + (friction(moved, limit, stiffness) if limit else 0.0)
            tension = np.asarray(law.tension(length, pressure)) + beside + noise.normal(0.0, NOISE, len(TIME))
            channels = {
                "span": Channel(length, "m"),
                "pressure": Channel(pressure, "Pa"),
                "force": Channel(tension + 1.5, "N"),  # the zero of a load cell
                "rest_length": Channel(np.full(len(TIME), rest), "m"),
            }
            made[f"{1e3 * rest:.0f} mm at {at / 1e5:.0f} bar"] = Recording(TIME, channels)
    return made


@pytest.fixture(scope="module")
def rubbed():
    return fit_shared_hysteresis(FIT, recordings(constant=4.0, per_pressure=1e-5, elements=900.0))


def test_friction_and_creep_that_went_in_come_out_within_their_intervals(rubbed):
    assert rubbed.title == "friction that grows with the pressure and creep"
    for name, value in {"constant": 4.0, "per_pressure": 1e-5, "stiffness": 5e3, "creep": 900.0}.items():
        e = rubbed.parameters[name]
        assert e.low < value < e.high, name
        assert e.high < 1.5 * e.low, (
            name
        )  # 1600 samples with noise of 0.3 N beside 4 N and 9 N tell them to some percent
    # Only noise is left; 1600 samples tell its size to 2 %.
    assert rubbed.rmse == pytest.approx(NOISE, rel=0.06) and rubbed.law_rmse > 5.0 * NOISE
    assert rubbed.held_back[0] < 0.3 * rubbed.held_back[1]
    assert rubbed.muscles == RESTS and len(rubbed.recordings) == 4


def test_a_recording_that_no_friction_describes_is_named(monkeypatch):
    """A wave of 60 N in one of four; where no form is fitted the law alone is left, and noise says nothing."""
    monkeypatch.setattr(shared_hysteresis, "_fits", lambda *_: dict.fromkeys(shared_hysteresis._forms(), np.array(LOW)))
    records = recordings()
    wavy = list(records)[1]
    force = records[wavy].channels["force"]
    wave = Channel(force.values + 60.0 * np.sin(40.0 * np.pi * TIME / TIME[-1]), "N")
    records[wavy] = Recording(TIME, {**records[wavy].channels, "force": wave})
    (said,) = fit_shared_hysteresis(FIT, records).warnings
    assert f"does not describe the record: it misses the tension of {wavy} by" in said


@pytest.mark.slow
def test_what_did_not_go_in_is_left_out_by_the_criterion():
    nothing = fit_shared_hysteresis(FIT, recordings())
    assert (nothing.title, nothing.parameters, nothing.friction, nothing.creep) == (NOTHING, {}, None, None)
    assert min(nothing.difference("friction"), nothing.difference("creep")) < 2.0
    alone = fit_shared_hysteresis(FIT, recordings(constant=4.0))
    assert alone.title == "constant friction" and alone.creep is None
    e = alone.parameters["constant"]
    assert e.low < 4.0 < e.high


def test_a_saved_fit_is_a_muscle_with_the_friction_and_creep_that_were_found(rubbed, tmp_path):
    fit = replace(FIT, hysteresis=rubbed)
    save_specimen(fitted_specimen([fit]), tmp_path / "two.toml")
    for muscle in (fit.muscle, mk.muscle(str(tmp_path / "two.toml"))):
        assert float(muscle.friction.largest_force(5e5)) == float(rubbed.friction.largest_force(5e5))
        assert muscle.friction.stiffness == rubbed.parameters["stiffness"].value
        # Three equal elements sum up to the total, but for rounding.
        assert float(np.sum(muscle.creep.stiffness)) == pytest.approx(rubbed.parameters["creep"].value, rel=1e-12)
    assert fit.to_dict()["hysteresis"]["title"] == rubbed.title and FIT.to_dict()["hysteresis"] is None


@pytest.mark.parametrize("held_back", [None, (0.4, 1.6)])
@pytest.mark.parametrize("muscles", [RESTS, (float("nan"),)])
def test_the_plain_form_states_each_number_of_the_answer_and_null_where_there_is_none(muscles, held_back):
    e = Estimate(4.0, 3.8, 4.2, "N")
    form = HysteresisModel("constant friction", ("constant", "stiffness"), 0.31, 812.5)
    others = [
        replace(form, title=title, free=free, aicc=900.0) for title, free in ((NOTHING, ()), ("creep", ("creep",)))
    ]
    answer = SharedHysteresis(
        title=form.title, parameters={"constant": e, "stiffness": e}, models=(form, *others), muscles=muscles,
        recordings=("a", "b"), samples=1600, independent=80, rmse=0.31, law_rmse=1.5, uncorrected_rmse=2.5,
        held_back=held_back, warnings=("one",),
    )  # fmt: skip
    plain = json.loads(json.dumps(answer.to_dict(), allow_nan=False))
    for name in ("title", "samples", "independent", "rmse", "law_rmse", "uncorrected_rmse"):
        assert plain[name] == getattr(answer, name), name
    assert plain["recordings"] == ["a", "b"] and plain["warnings"] == ["one"]
    assert plain["muscles"] == [None if muscle != muscle else muscle for muscle in muscles]
    assert plain["held_back"] == (None if held_back is None else [0.4, 1.6])
    assert plain["parameters"]["constant"] == e._asdict()
    said = "\n".join(remark for table in answer.tables() for remark in table.notes)
    assert ("held back in turn: 0.4 N rms, 1.6 N" in said) == (held_back is not None)


def changed(**channels) -> dict:
    """The first recording with other channels; None leaves one out."""
    name, one = next(iter(recordings().items()))
    kept = {n: c for n, c in one.channels.items() if n not in channels}
    return {name: Recording(TIME, kept | {n: c for n, c in channels.items() if c is not None})}


STILL = Channel(np.full(len(TIME), 0.19), "m")


@pytest.mark.parametrize(
    ("records", "said"),
    [
        (changed(force=None), "tension must be one channel; the recording has span, pressure, rest_length"),
        (changed(rest_length=None), "a column rest_length says of which muscle the recording is, of 20 cm, 30 cm"),
        (changed(rest_length=Channel(np.full(len(TIME), 0.25), "m")), "rest_length must be of a muscle of the table"),
        (changed(span=Channel(np.full(len(TIME), 0.15), "m")), "length must be between 18 cm and 20 cm"),
        (changed(span=STILL), "pressure is 2 bar throughout, and the length does not change either"),
        (
            changed(span=STILL, pressure=Channel(np.linspace(1e5, 4e5, len(TIME)), "Pa")),
            "the law tondu_lopez has no ends that settle",
        ),
        (changed(force=Channel(np.zeros(len(TIME)), "N")), "tension must pull at 20 of the samples"),
        ({}, "hysteresis must be at least one recording"),
    ],
)
def test_a_recording_that_tells_nothing_is_refused_in_one_sentence(records, said):
    with pytest.raises(InputError) as error:
        fit_shared_hysteresis(FIT, records)
    assert said in str(error.value) and "\n" not in str(error.value)


def test_files_folders_and_patterns_name_recordings(tmp_path):
    for i, one in enumerate(list(recordings().values())[:2]):
        one.save(tmp_path / f"run{i}.csv")
    everything = [str(tmp_path / f"run{i}.csv") for i in (0, 1)]
    for sources in (tmp_path, tmp_path / "run?.csv", everything):
        assert list(read_recordings(sources)) == everything
    with pytest.raises(InputError, match="must hold at least one recording"):
        read_recordings(tmp_path / "none*.csv")
