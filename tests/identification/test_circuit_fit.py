"""Parameters with which a record was made are found again from it, with intervals that are honest, and predict others.

Records are runs of circuits with sensor noise of 300 Pa and fixed seeds. An interval of 95 % misses one value in twenty; the
tests take twice its half width, which a normal estimate misses once in 10^4.
"""

import numpy as np
import pytest
from scipy import stats

from mckibben.assembly.circuit_file import read_circuit
from mckibben.bench.circuit_run import run_circuit
from mckibben.engine import held, ramped
from mckibben.errors import ConvergenceError
from mckibben.identification import CircuitFit, Trial, fit_circuit
from mckibben.identification.circuit_fit import run_trial
from mckibben.identification.trial import trial_from_record
from mckibben.pneumatics.circuit import Branch, Circuit
from mckibben.pneumatics.orifice import Leak, Orifice
from mckibben.pneumatics.tubes import InertialTube, QuadraticTube
from mckibben.pneumatics.volume import FixedVolume, Isothermal, Reservoir
from mckibben.recordings import Recording

ROOM = 101325.0
STEP = 2e-4  # [s]
NOISE = 300.0  # of the sensor [Pa]
HEAD = """
schema = 1
[nodes.supply]
kind = "reservoir"
signal = "wish"
[signals.wish]
kind = "steps"
times = ["0 s", "10 ms", "50 ms"]
values = ["0 bar", "5 bar", "2 bar"]
[run]
duration = "0.1 s"
period = "1 ms"
step = "200 us"
"""
TANK = """
[nodes.{name}]
kind = "volume"
volume = "{volume}"
heat = "isothermal"
"""
TUBE = """
[elements.tube]
kind = "lumped_tube"
from = "supply"
to = "tank"
length = "1 m"
diameter = "3.175 mm"
friction_scale = {scale}
"""
HOLE = """
[elements.{name}]
kind = "orifice"
from = "supply"
to = "{to}"
conductance = "{conductance} m^3/(s*Pa)"
critical_ratio = 0.28
"""
LEAK = """
[nodes.room]
kind = "atmosphere"
[elements.leak]
kind = "leak"
from = "tank"
to = "room"
conductance = "1e-9 m^3/(s*Pa)"
"""
VALVE = """
[nodes.room]
kind = "atmosphere"
[elements.fill]
kind = "spool_valve"
supply = "supply"
work = "tank"
exhaust = "room"
conductance = "1e-8 m^3/(s*Pa)"
lag = "2 ms"
dead_time = "2.4 ms"
command = "open"
[signals.open]
kind = "pulse"
start = "20 ms"
width = "70 ms"
high = 1
low = -0.4
"""
VESSELS = {"10 in3": "163.9 ml", "3 in3": "49.2 ml"}


@pytest.fixture
def plan(tmp_path):
    def read(*parts: str):
        path = tmp_path / "circuit.toml"
        path.write_text(HEAD + "".join(parts))
        return read_circuit(path)

    return read


def recorded(plan, seed: int, late: dict[str, int] | None = None):
    """Gauge pressures of a run's volumes with noise, and its inputs as they were asked for, `late` samples too early."""
    run = run_circuit(plan)
    channels = {}
    for name in plan.signals:
        ahead = (late or {}).get(name, 0)
        values = run[name]
        asked = np.concatenate([values[ahead:], np.full(ahead, values[-1])])
        channels[name] = run.channels[name].with_values(asked)
    random = np.random.default_rng(seed)
    for node in plan.circuit.chambers:
        channel = run.channels[f"{node}.pressure"]
        noise = random.normal(0.0, NOISE, len(channel))
        noise[0] = 0.0  # the model begins where the record does
        channels[f"{node}.pressure"] = channel.with_values(channel.values + noise)
    return run.pick([]).with_channels(channels)


def assert_found(found: CircuitFit, truth: dict[str, float], within: float) -> None:
    """Each value within twice its half interval of the truth, which is not wider than a share of it."""
    assert found.converged, found.message
    for path, value in truth.items():
        estimate = found.parameters[path]
        half = 0.5 * (estimate.high - estimate.low)
        assert 0.0 < half < within * value, (path, estimate)
        assert abs(estimate.value - value) < 2.0 * half, (path, estimate)
    assert found.warnings == ()


@pytest.mark.slow
def test_the_friction_of_a_tube_is_found_and_predicts_another_vessel(plan):
    path = "elements.tube.friction_scale"
    truth = {name: plan(TANK.format(name="tank", volume=v), TUBE.format(scale=1.4)) for name, v in VESSELS.items()}
    guess = {name: plan(TANK.format(name="tank", volume=v), TUBE.format(scale=1.0)) for name, v in VESSELS.items()}
    trials = {name: trial_from_record(guess[name], recorded(truth[name], 3), name=name) for name in VESSELS}
    found = fit_circuit([trials["10 in3"]], [path], predict=[trials["3 in3"]], step=STEP)
    assert_found(found, {path: 1.4}, within=0.05)
    assert found.changes == {path: found.parameters[path].value}
    # what is left over is the noise alone; its rms over 101 samples scatters by 1/sqrt(2*101) = 7 %, four times of that
    assert found.rms() == pytest.approx(NOISE, rel=0.28)
    assert found.rms(fitted=False) == pytest.approx(NOISE, rel=0.28)
    assert [(e.trial, e.fitted) for e in found.errors] == [("10 in3", True), ("3 in3", False)]
    assert all(
        abs(e.lead) < 1e-4 for e in found.errors
    )  # a tenth of a sample: the model is right, noise moves the peak


@pytest.mark.slow
def test_two_like_holes_a_leak_and_a_volume_are_found_at_once(plan):
    def two(conductance: str, critical_ratio: str, leak: str, volume: str) -> str:
        parts = [TANK.format(name="tank", volume="50 ml"), TANK.format(name="other", volume=volume)]
        holes = [HOLE.format(name=f"to_{n}", to=n, conductance=conductance) for n in ("tank", "other")]
        text = "".join([*parts, *holes, LEAK])
        return text.replace("0.28", critical_ratio).replace("1e-9 m", f"{leak} m")

    record = recorded(plan(two("6e-9", "0.28", "1e-9", "80 ml")), 7)
    trial = trial_from_record(plan(two("9e-9", "0.45", "3e-9", "60 ml")), record, name="two")
    assert trial.channels == ("tank.pressure_abs", "other.pressure_abs")
    truth = {
        "elements.to_*.conductance": 6e-9,
        "elements.to_*.critical_ratio": 0.28,
        "elements.leak.conductance": 1e-9,
        "nodes.other.volume": 8e-5,
    }
    found = fit_circuit([trial], list(truth), step=STEP)
    assert_found(found, truth, within=0.1)
    assert found.paths["elements.to_*.conductance"] == ("elements.to_tank.conductance", "elements.to_other.conductance")
    assert len(found.changes) == 6
    assert found.rms(channel="other.pressure_abs") == pytest.approx(NOISE, rel=0.28)


@pytest.mark.slow
def test_the_dead_time_of_a_valve_and_the_delay_of_an_input_are_found(plan):
    """The regulator of the supply obeyed 3 ms late; the valve's own dead time is 2.4 ms. Neither is a whole step."""
    tank = TANK.format(name="tank", volume="50 ml")
    trial = trial_from_record(
        plan(tank, VALVE.replace("2.4 ms", "1 ms")), recorded(plan(tank, VALVE), 11, {"wish": 3}), name="late"
    )
    free = ["elements.fill.dead_time", "signals.wish.delay"]
    found = fit_circuit([trial], free, step=STEP)
    assert_found(found, {free[0]: 2.4e-3, free[1]: 3e-3}, within=0.2)
    assert found.rms() == pytest.approx(NOISE, rel=0.28)
    # a delay of the command reaches the valve too, and adds to its dead time
    late = trial.with_parameters({"signals.open.delay": 1.5e-3})[1]
    assert float(late["fill.command"].delay) == pytest.approx(2.5e-3, rel=1e-12)


def driven(element, name: str, period: float, seed: int, truth: dict[str, float] | None = None) -> Trial:
    """A tank of 50 ml at the end of an element, driven by 0 to 4 bar of a sweep; its pressure as the truth makes it."""
    circuit = Circuit.of(
        {"p": Reservoir(signal="p"), "tank": FixedVolume(volume=5e-5, heat=Isothermal())},
        {"tube": Branch(element, ("p", "tank"))},
    )
    t = period * np.arange(101)
    wish = ROOM + 2e5 * (1.0 - np.cos(2.0 * np.pi * (5.0 + 120.0 * t) * t))
    trial = Trial(name, circuit, {"p": ramped(wish)}, {"tank": ROOM}, {"tank.pressure_abs": wish}, period)
    made = np.asarray(trial.run(truth or {}, step=STEP).outputs["tank.pressure_abs"])
    noise = np.random.default_rng(seed).normal(0.0, NOISE, made.size)
    return Trial(name, circuit, trial.signals, trial.initial, {"tank.pressure_abs": made + noise}, period)


def test_effective_cross_section_and_length_of_a_tube_with_inertia_are_found():
    """With R2 known, R1/A, R2/A^2 and l/A are three, and so are R1, A and l."""
    truth = {"elements.tube.viscous": 500.0, "elements.tube.area": 8e-6, "elements.tube.length": 1.2}
    tube = InertialTube(viscous=300.0, turbulent=80.0, area=1.2e-5, length=0.8)
    found = fit_circuit([driven(tube, "inertial", 1e-3, 13, truth)], list(truth), step=STEP)
    assert_found(found, truth, within=0.5)


def test_both_resistances_and_the_cross_section_of_a_tube_without_inertia_cannot_be_told_apart():
    """w = rho A v with R1 v + R2 v^2: a k times larger A with k R1 and k^2 R2 carries the same flow."""
    tube = QuadraticTube(viscous=500.0, turbulent=80.0, area=8e-6)
    free = [f"elements.tube.{name}" for name in ("viscous", "turbulent", "area")]
    trial = driven(tube, "quadratic", 1e-3, 17)
    known = fit_circuit([trial], free[:2], step=STEP, start={free[0]: 300.0, free[1]: 120.0})
    assert_found(known, {free[0]: 500.0, free[1]: 80.0}, within=0.2)
    found = fit_circuit([trial], free, step=STEP)
    assert any("cannot tell" in w and all(path in w for path in free) for w in found.warnings), found.warnings
    assert found.rms() == pytest.approx(known.rms(), rel=1e-6)  # the further freedom explains nothing


def test_a_chain_of_three_volumes_is_found_by_the_stiff_method():
    """Six states: their linear system goes through memory, where derivatives were once lost."""
    names = ("first", "second", "third")
    holes = zip(("p", *names), names, strict=False)
    circuit = Circuit.of(
        {"p": Reservoir(signal="p"), **{n: FixedVolume(volume=1e-5, heat=Isothermal()) for n in names}},
        {f"to_{b}": Branch(Orifice(conductance=1.5e-8, critical_ratio=0.28), (a, b)) for a, b in holes},
    )
    path, period, start = "elements.to_*.conductance", 2e-3, dict.fromkeys(names, ROOM)
    wish = ROOM + 2e5 * (1.0 - np.cos(2.0 * np.pi * 10.0 * period * np.arange(61)))
    trial = Trial("chain", circuit, {"p": ramped(wish)}, start, {"third.pressure_abs": wish}, period)
    true = {f"elements.to_{n}.conductance": 1e-8 for n in names}
    made = np.asarray(trial.run(true, step=4e-4, method="ros2").outputs["third.pressure_abs"])
    noise = np.random.default_rng(29).normal(0.0, NOISE, made.size)
    trial = trial.replace(measured={"third.pressure_abs": made + noise})
    assert trial.run(true, step=4e-4).stiff
    assert_found(fit_circuit([trial], [path], step=4e-4), {path: 1e-8}, within=0.05)


@pytest.mark.slow
def test_intervals_of_95_percent_hold_the_truth_in_95_percent_of_records():
    """White noise of 1 kPa on 60 samples of a tank that leaks; the count is binomial, and its bounds hold in 99.8 %."""
    records, period = 80, 5e-3
    truth = {"elements.leak.conductance": 2e-9, "nodes.tank.volume": 5e-5}
    circuit = Circuit.of(
        {
            "room": Reservoir(pressure_abs=ROOM),
            "tank": FixedVolume(volume=5e-5, heat=Isothermal()),
            "source": Reservoir(pressure_abs=4e5),
        },
        {
            "leak": Branch(Leak(conductance=2e-9), ("tank", "room")),
            "feed": Branch(Leak(conductance=1e-9), ("source", "tank")),
        },
    )
    still = {"time": held(np.zeros(60))}
    first = Trial("0", circuit, still, {"tank": 5e5}, {"tank.pressure_abs": np.full(60, 5e5)}, period)
    clean = np.asarray(first.run({}, step=period).outputs["tank.pressure_abs"])
    random = np.random.default_rng(2024)
    inside = dict.fromkeys(truth, 0)
    for _ in range(records):
        measured = {"tank.pressure_abs": clean + random.normal(0.0, 1e3, 60)}
        found = fit_circuit([Trial("0", circuit, still, {"tank": 5e5}, measured, period)], list(truth), step=period)
        for path, value in truth.items():
            inside[path] += found.parameters[path].low <= value <= found.parameters[path].high
    low, high = stats.binom.ppf([0.001, 0.999], records, 0.95)
    assert all(low <= n <= high for n in inside.values()), (inside, low, high)


def test_residuals_that_follow_one_another_widen_the_intervals():
    """Noise with a correlation of 0.8 per sample holds a ninth of the information: intervals three times as wide."""
    tube = QuadraticTube(viscous=500.0, turbulent=80.0, area=8e-6)
    free = ["elements.tube.viscous", "elements.tube.turbulent"]
    white = driven(tube, "white", 1e-3, 19)
    model = np.asarray(white.run({}, step=STEP).outputs["tank.pressure_abs"])
    steps = white.measured["tank.pressure_abs"] - model
    slow = np.zeros_like(steps)
    for i, push in enumerate(steps):
        slow[i] = 0.8 * slow[i - 1] * (i > 0) + 0.6 * push  # 0.6 = sqrt(1 - 0.8^2) keeps the size
    red = Trial("red", white.circuit, white.signals, white.initial, {"tank.pressure_abs": model + slow}, white.period)
    half = [fit_circuit([t], free, step=STEP).parameters[free[1]] for t in (white, red)]
    ratio = (half[1].high - half[1].low) / (half[0].high - half[0].low)
    # 100 samples know the correlation to sqrt((1 - 0.8^2)/100) = 0.06, twice of which is a factor of 2.1 to 4.9
    assert 2.1 < ratio < 4.9


RECORDED_SUPPLY = """\
schema = 1
[nodes.port]
kind = "reservoir"
{port}
[nodes.tank]
kind = "volume"
volume = "1 cm^3"
[elements.tube]
kind = "lumped_tube"
from = "port"
to = "tank"
length = "3 m"
diameter = "{diameter}"
[run]
duration = "0.3 s"
period = "1 ms"
"""


def test_a_recorded_supply_drives_its_reservoir_though_the_file_has_a_constant(tmp_path):
    """The record of a ramp: with the constant of the file in its place the fit is off by more than a bar."""
    signal = 'signal = "wish"\n[signals.wish]\nkind = "ramp"\nfrom = "0 bar"\nto = "3 bar"\nduration = "0.2 s"'
    (tmp_path / "made.toml").write_text(RECORDED_SUPPLY.format(port=signal, diameter="2 mm"))
    (tmp_path / "asked.toml").write_text(RECORDED_SUPPLY.format(port='pressure = "2.1 bar"', diameter="3 mm"))
    record = run_circuit(read_circuit(tmp_path / "made.toml"))
    plan = read_circuit(tmp_path / "asked.toml")
    trial = trial_from_record(plan, record, name="ramp")
    assert trial.channels == ("tank.pressure_abs",) and trial.cautions == ()
    fit = fit_circuit([trial], ["elements.tube.diameter"])
    # what the ends of the tube lose follows from the file's diameter, and is not fitted: some 200 Pa of 3 bar
    assert fit.rms() < 500.0
    renamed = {n.replace("port.", "hose."): c for n, c in record.channels.items()}
    other = trial_from_record(plan, Recording(record.time, renamed), name="ramp")
    assert "hose.pressure is not used" in str(other.cautions[0])


@pytest.mark.parametrize("halvings", range(6))
def test_a_trial_that_needs_a_shorter_step_gets_half_of_it_up_to_four_times(halvings):
    asked = []

    class Stiff:
        def run(self, changes, *, step):
            asked.append(step)
            if step > 1e-3 / 2**halvings:
                raise ConvergenceError("too stiff")
            return changes

    if halvings <= 4:
        assert run_trial(Stiff(), {"a": 1.0}, step=1e-3) == {"a": 1.0}
    else:
        with pytest.raises(ConvergenceError):
            run_trial(Stiff(), {}, step=1e-3)
    assert asked == [1e-3 / 2**k for k in range(min(halvings, 4) + 1)]
