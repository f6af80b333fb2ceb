"""A learned residual: a potential beside a law, which yields nothing in a closed cycle and fades outside of its data."""

import copy
import ctypes
import dataclasses
import pickle
import shutil
import subprocess
import warnings

import numpy as np
import pytest

import lanewise
import mckibben as mk
from mckibben.errors import InputError
from mckibben.muscles.braid import braid_of
from mckibben.muscles.learned import LearnedResidual
from mckibben.quantities import declared
from mckibben.specimens import save_specimen

LENGTHS, PRESSURES = (0.115, 0.135), (1e5, 5e5)
LAW = mk.muscle("nylon").law
ROUNDING = {"rtol": 1e-13, "atol": 1e-13}  # of sums of forces of 100 N that are compiled in another order


def learned(order=(4, 4), size=0.05, seed=0):
    none = LearnedResidual.beside(LAW, lengths=LENGTHS, pressures=PRESSURES, order=order)
    return none.replace(weights=size * np.random.default_rng(seed).standard_normal(order))


def grid(count=9):
    return (x.ravel() for x in np.meshgrid(np.linspace(0.105, 0.15, count), np.linspace(0.0, 7e5, count)))


def test_weights_of_zero_leave_the_law_as_it_is():
    none = LearnedResidual.beside(LAW, lengths=LENGTHS, pressures=PRESSURES)
    length, pressure = grid()
    for ask in ("tension", "volume", "stiffness", "passive_tension"):
        given = (length,) if ask == "passive_tension" else (length, pressure)
        np.testing.assert_allclose(getattr(none, ask)(*given), getattr(LAW, ask)(*given), **ROUNDING)


def test_weights_of_zero_leave_what_the_law_says_of_itself():
    # what the house asks of a law beyond tension and volume: bore, threshold, braid, and its like with other numbers
    for name in ("DMSP-20-300", "SM20", "festo-10mm", "nylon"):
        law = mk.muscle(name).law
        none = LearnedResidual.beside(law, lengths=(0.1, 0.15), pressures=PRESSURES)
        for field in declared(law).keys() | {"rest_length"}:
            if hasattr(law, field):
                assert getattr(none, field) == getattr(law, field), field
        assert braid_of(none) == braid_of(law)
        changed = {"thread_strain": 0.02} | ({"stop_stiffness": 0.0} if hasattr(law, "stop_stiffness") else {})
        other = none.replace(**changed)
        assert other.thread_strain == 0.02 and other.of == law.replace(
            **{k: v for k, v in changed.items() if "stop" in k}
        )
        assert not hasattr(none, "nothing") and pickle.loads(pickle.dumps(copy.deepcopy(none))) == none
        spec = dataclasses.replace(mk.specimen(name), residual=none.group())
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of the laws' errors
            cycles = [mk.energy(one, pressure="3 bar").to_dataframe() for one in (spec, name)]
        for column in cycles[0].select_dtypes("number"):
            np.testing.assert_allclose(
                cycles[0][column], cycles[1][column], rtol=1e-9, atol=1e-9
            )  # a search ends at a root


@pytest.mark.parametrize("order", [(1, 1), (2, 5), (6, 3)])
def test_the_slope_of_tension_by_pressure_is_that_of_volume_by_length(order):
    # dF/dP' = -dV/dL, by central differences of 1e-6 of the ranges: errors of 1e-9 of the residual's own slopes
    law, h, k = learned(order), 1e-8, 0.4
    length, pressure = (x.ravel() for x in np.meshgrid(np.linspace(0.114, 0.136, 7), np.linspace(0.8e5, 5.2e5, 7)))
    by_pressure = (law.braid_tension(length, pressure + k) - law.braid_tension(length, pressure - k)) / (2.0 * k)
    by_length = (law.braid_volume(length + h, pressure) - law.braid_volume(length - h, pressure)) / (2.0 * h)
    np.testing.assert_allclose(by_pressure, -by_length, rtol=1e-5, atol=1e-9)


def test_a_closed_cycle_of_lengths_and_pressures_yields_no_work():
    # The work on the load less that of the gas around an ellipse, by a periodic rule that converges faster than any power.
    law = learned()
    turn = np.linspace(0.0, 2.0 * np.pi, 4096, endpoint=False)
    length, pressure = 0.125 + 0.009 * np.cos(turn), 3e5 + 1.8e5 * np.sin(turn)
    force, volume = law.braid_tension(length, pressure), law.braid_volume(length, pressure)
    work = np.sum(force * -0.009 * np.sin(turn)) - np.sum(volume * 1.8e5 * np.cos(turn))
    size = np.sum(np.abs((force - LAW.braid_tension(length, pressure)) * 0.009 * np.sin(turn)))
    assert size > 10.0 and abs(work) < 1e-9 * size


def test_it_fades_to_the_law_itself_outside_of_its_data_and_its_tension_has_no_corner():
    law = learned(size=0.2)
    reach = float(law.length_reach)
    ends = [0.125 - reach, 0.125 + reach]
    outside = np.array([ends[0] - 1e-3, ends[1] + 1e-3])
    np.testing.assert_allclose(law.tension(outside, 3e5), LAW.tension(outside, 3e5), **ROUNDING)
    np.testing.assert_allclose(law.volume(0.125, [0.0, 6.5e5]), LAW.volume(0.125, [0.0, 6.5e5]), **ROUNDING)
    at = np.array([end + step for end in ends for step in (-1e-6, 1e-6)])
    added = law.braid_stiffness(at, 3e5) - LAW.braid_stiffness(at, 3e5)
    most = np.abs(
        law.braid_stiffness(np.linspace(*ends, 101), 3e5) - LAW.braid_stiffness(np.linspace(*ends, 101), 3e5)
    ).max()
    # It goes there linearly: 1e-6 m are 8e-5 of the window, and the slope of (1 - x^2)^3 there is up to ten times its mean.
    assert np.abs(added).max() < 1e-2 * most


def test_from_the_places_of_a_record_it_holds_along_them_only():
    length = np.linspace(0.11, 0.14, 200)
    pressure = 1e5 + (length - 0.11) * 1e7 + 3e4 * np.sin(400.0 * length)
    none = LearnedResidual.beside(LAW, lengths=length, pressures=pressure)
    law = none.replace(weights=np.full((4, 4), 0.05))
    along = law.tension(length, pressure) - LAW.tension(length, pressure)
    beside = law.tension(length, pressure + 1e5) - LAW.tension(length, pressure + 1e5)
    assert np.abs(along).max() > 1.0 and np.abs(beside).max() < 1e-12


def test_a_specimen_keeps_what_was_learned_bit_for_bit_and_only_beside_its_own_law(tmp_path):
    spec, law = mk.specimen("nylon"), learned()
    save_specimen(dataclasses.replace(spec, id="mine", residual=law.group("60 s of holds")), tmp_path / "mine.toml")
    read = mk.muscle(tmp_path / "mine.toml")
    length, pressure = grid()
    np.testing.assert_array_equal(read.law.tension(length, pressure), law.tension(length, pressure))
    assert read.law.rest_length == spec.property_si("rest_length", "m") and not hasattr(read.law, "colour")
    other = next(name for name in spec.laws if name != spec.law)
    assert not isinstance(mk.muscle(tmp_path / "mine.toml", law=other).law, LearnedResidual)
    with pytest.raises(InputError, match="learned on one muscle"):
        mk.muscle(tmp_path / "mine.toml", rest_length="20 cm")


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda g: g.pop("weights"), "residual.weights is missing"),
        (lambda g: g.update(colour=g["rows"]), "colour"),
        (lambda g: g.update(rows=dataclasses.replace(g["rows"], value=3.0)), "must divide the 16 weights"),
    ],
)
def test_a_residual_that_is_none_is_refused_with_its_field(change, word):
    group = learned().group()
    change(group)
    with pytest.raises(InputError, match=word):
        LearnedResidual.stated(LAW, group, where="mine.toml")


def test_balances_of_a_simulation_with_a_learned_residual_close():
    sim = mk.Simulation(
        mk.Weight(mk.Muscle(law=learned(size=0.01), specimen=mk.specimen("nylon")), mass="2 kg"), period=5e-3
    )
    sim.reset(pressure="2 bar")
    for k in range(60):
        sim.step(muscle=0.3 * np.sin(0.2 * k))
    balance = sim.recording().meta["balance"]
    assert balance and all(abs(error) < 1e-6 for error in balance.values()), balance  # of RK4 at 0.2 ms


@pytest.mark.skipif(not shutil.which("cc"), reason="no C compiler here")
def test_tension_and_volume_of_a_learned_muscle_are_plain_c_with_the_same_bits(tmp_path):
    law = learned()
    program, _ = lanewise.lower(
        lambda length, pressure: (law.tension(length, pressure), law.volume(length, pressure)), 0.1, 1e5
    )
    for name, text in lanewise.to_c(
        program, "muscle", arguments=("length", "pressure"), results=("tension", "volume")
    ).items():
        (tmp_path / name).write_text(text)
    flags = ("-std=c99", "-O0", "-ffp-contract=off", "-fPIC", "-shared")
    subprocess.run(["cc", *flags, str(tmp_path / "muscle.c"), "-o", str(tmp_path / "muscle.so"), "-lm"], check=True)
    call = ctypes.CDLL(str(tmp_path / "muscle.so")).muscle
    call.argtypes = [ctypes.POINTER(ctypes.c_double)] * 4
    places = np.stack(list(grid()), axis=1)
    expected = np.stack(program.call(list(places.T), lanes=len(places)), axis=1)
    for at, values in zip(places, expected, strict=True):
        ours = [ctypes.c_double(x) for x in (*at, np.nan, np.nan)]
        call(*ours)
        assert [one.value for one in ours[2:]] == values.tolist()
