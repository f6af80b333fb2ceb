"""Values that a person could slip into the public functions: each is refused in a sentence, and none ends in a traceback."""

import numpy as np
import pytest

import mckibben as mk
from mckibben.errors import InputError
from mckibben_hosts import Part

NAN = float("nan")
NYLON = mk.muscle("nylon")
IDEAL = {"thread_length": 0.16, "turns": 3.2}
POINTS = mk.ForceMap("points", np.array([0.12, 0.13, 0.14]), np.full(3, 3e5), np.array([12.0, 26.0, 40.0]))

SLIPS = {
    # text, truth values, lists and other things where a number goes
    "bool as a parameter": lambda: mk.muscle("nylon", passive_stiffness=True),
    "list as a parameter": lambda: mk.muscle("nylon", passive_stiffness=[1.0, 2.0]),
    "text as creep": lambda: mk.muscle("nylon", creep="maxwell"),
    "number as friction": lambda: mk.muscle("nylon", friction=3),
    "nothing as parameters of a law": lambda: mk.law("ideal", None),
    "list as parameters of a law": lambda: mk.law("ideal", [1, 2]),
    "bool in a law": lambda: mk.law("ideal", IDEAL | {"turns": True}),
    "none among lengths": lambda: NYLON.tension(np.array([None, 0.1]), 3e5),
    "words in an array": lambda: NYLON.tension(np.array(["13 cm", "12 cm"]), 3e5),
    "complex length": lambda: NYLON.tension(0.1 + 1j, 3e5),
    "muscle as a length": lambda: NYLON.tension(NYLON, 3e5),
    "shapes that do not fit": lambda: NYLON.tension([0.13, 0.12], [1e5, 2e5, 3e5]),
    "several tensions for one pressure": lambda: NYLON.pressure_for([50.0, 60.0], 0.13),
    "words as a direction": lambda: NYLON.quasi_static_tension(0.13, 3e5, "up"),
    "five as a direction": lambda: NYLON.quasi_static_tension(0.13, 3e5, 5),
    "words as a truth": lambda: mk.energy("nylon", accumulator="no"),
    "list as changes": lambda: mk.energy("nylon", parameters=[1]),
    "number as names": lambda: mk.energy("nylon", cycles=3),
    "number as a muscle": lambda: mk.compare(3),
    "number as recordings": lambda: mk.compare("nylon", recordings=3),
    "number as a valve": lambda: mk.size(force=50, stroke=0.03, valve=3),
    "muscle as a name": lambda: mk.size(force=50, stroke=0.03, muscle=NYLON),
    "pair as a space": lambda: mk.size(force=50, stroke=0.03, space=(0.2, 0.03)),
    "number as a tank": lambda: mk.size(force=50, stroke=0.03, tank=2),
    "truth as a force": lambda: mk.size(force=True, stroke=0.03),
    "array as a force": lambda: mk.size(force=np.array([50.0, 60.0]), stroke=0.03),
    "force as a wish": lambda: mk.size(50),
    # names that nothing takes
    "unknown parameter of a fit": lambda: mk.fit(POINTS, "ideal", known={"turn": 3.0}),
    "list as known": lambda: mk.fit(POINTS, "ideal", known=[1]),
    "no number as known": lambda: mk.fit(POINTS, "ideal", known={"turns": NAN}),
    "unknown option of a fit": lambda: mk.fit(POINTS, "ideal", nothing=3),
    "number as a law": lambda: mk.fit(POINTS, 3),
    "number as a like muscle": lambda: mk.fit(POINTS, "ideal", like=3),
    "number as loops": lambda: mk.fit(POINTS, "ideal", hysteresis=3),
    "list as columns": lambda: mk.read("x.csv", columns=["length"]),
    "text as units": lambda: mk.read("x.csv", units="bar"),
    "a room in bar": lambda: mk.read("x.csv", ambient=1),
    "no room": lambda: mk.read("x.csv", ambient=NAN),
    "unequal columns": lambda: mk.ForceMap("x", np.zeros(3), np.zeros(2), np.zeros(3)),
    "words as columns": lambda: mk.ForceMap("x", ["a"], ["b"], ["c"]),
    "two dimensions": lambda: mk.ForceMap("x", *[np.ones((2, 2))] * 3),
    # things where a name or a path goes
    "number as a rig": lambda: mk.rig(3),
    "list as changes of a rig": lambda: mk.rig("paper", [1]),
    "number as a protocol": lambda: mk.protocol(3),
    "number as a recording": lambda: mk.diagnose(3),
    "number as a part": lambda: mk.part(3),
    "number as a circuit": lambda: mk.circuit(3),
    "NUL in a path": lambda: mk.circuit("a\0b"),
    "NUL in a rig": lambda: mk.rig("a\0b.toml"),
    # stepping
    "number as a room": lambda: mk.Simulation(mk.Plate(), mk.Air(environment=293)),
    "list as noise": lambda: mk.Simulation(mk.Plate(), noise=[1]),
    "words as noise": lambda: mk.Simulation(mk.Plate(), noise={"tension": "1 bar"}),
    "number as noise": lambda: mk.Simulation(mk.Plate(), noise=0.1),
    "number as a title": lambda: mk.Simulation(mk.Plate(), title=3),
    "a step of a femtosecond": lambda: mk.Simulation(mk.Plate(), step=1e-15),
    "more lanes than memory": lambda: mk.Simulation(mk.Plate()).batch(10**12),
    "list as changes of a simulation": lambda: mk.Simulation(mk.Plate()).with_parameters([1]),
    "truth as a command": lambda: mk.Simulation(mk.Plate()).step(muscle=True),
    "a seed below zero": lambda: mk.prepare("isometric-step", muscle="nylon", seed=-3),
    "a run of femtoseconds": lambda: mk.prepare("isometric-step", muscle="nylon", step=1e-15),
    # hosts
    "below vacuum": lambda: Part("nylon", pressure=-2e5),
    "number as the name of a muscle": lambda: Part({3: "nylon"}),
    "a word of C++ as the name of a muscle": lambda: Part({"class": "nylon"}),
    "number as the title of a part": lambda: Part("nylon", title=3),
    "a parameter of a part out of bounds": lambda: Part("nylon").with_parameters(
        {next(p for p in Part("nylon").declared() if p.endswith("passive_stiffness")): -1.0}
    ),
}


@pytest.mark.filterwarnings("ignore::mckibben.errors.PlausibilityWarning")
@pytest.mark.parametrize("slip", SLIPS.values(), ids=SLIPS)
def test_a_slip_is_refused_in_one_sentence(slip):
    with pytest.raises(InputError) as error:
        slip()
    assert "\n" not in str(error.value) and len(str(error.value)) < 2000


def test_values_with_units_are_taken_where_numbers_are():
    assert float(mk.law("ideal", {"thread_length": "16 cm", "turns": 3.2}).thread_length) == 0.16
    assert NYLON.tension("13 cm", "3 bar") == NYLON.tension(0.13, 3e5)
    assert NYLON.tension(["13 cm", "12 cm"], 3e5).shape == (2,)
