"""Protocols are data: they say all their numbers, come back from their text, hash alike everywhere, and expand as stated."""

import itertools
import json
import math
import re
import subprocess
import sys
from importlib import resources

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mckibben.errors import InputError
from mckibben.experiments.amounts import read_amount, read_until
from mckibben.experiments.commands import Deferred, DirectionDependent
from mckibben.experiments.protocol import clauses, expand
from mckibben.experiments.read import (
    build_protocol,
    parse_protocol,
    protocol,
    protocol_names,
    values_of,
    with_values,
)
from mckibben.experiments.waveforms import Sine, Triangle
from mckibben.quantities import from_si

L0 = 0.14  # the nylon muscle
CLASSICS = {
    "isobaric-map", "isokinetic", "isometric-step", "isotonic-triangle", "leak-down", "lubricant-test", "pneumatic-step",
    "preconditioning", "quasi-static", "quick-release", "sinusoids", "work-loop",
}  # fmt: skip


def made(text: str):
    return parse_protocol(text, where="p.toml")


def labelled(plan, label):
    return [s for s in plan.steps if s.step.label == label]


def numbers(value):
    """All numbers with their units that stand in the words of a protocol."""
    if isinstance(value, dict):
        return set().union(*(numbers(v) for v in value.values()), set())
    if isinstance(value, list | tuple):
        return set().union(*(numbers(v) for v in value), set())
    if isinstance(value, bool):
        return set()
    if isinstance(value, int | float):
        return {value}
    return {float(n) for n in re.findall(r"(?<![\w.$])\d+(?:\.\d+)?(?![\w.])", value)}


def test_all_classic_experiments_ship():
    assert set(protocol_names()) == CLASSICS


@pytest.mark.parametrize("name", sorted(CLASSICS))
def test_sentence_states_every_number_and_every_inferred_one(name):
    p = protocol(name)
    said = p.sentence()
    document = p.document()
    stated = numbers(
        [
            document["steps"],
            document.get("last", []),
            [v["value"] for v in document["parameters"].values() if "value" in v],
        ]
    )
    for choice in p.choices:
        stated |= numbers([list(choice.sets(o).values()) for o in choice.values])
    heard = {float(n) for n in re.findall(r"\d+(?:\.\d+)?", said)}
    # a time is said in the unit that fits
    missing = {n for n in stated if n not in heard and n * 1e3 not in heard}
    assert not missing, said
    assert "$" not in said
    for parameter in p.parameters:
        assert not (set(parameter.inferred) & set(parameter.values)) or "nferred" in said


def test_the_experiments_not_printed_are_marked():
    said = protocol("isotonic-triangle").sentence()
    assert "load of 10, 30 (inferred), 50 N" in said
    assert "frequency of 1, 2 (inferred), 5 Hz" in said
    assert "(inferred)" not in protocol("isotonic-triangle", load="50 N", frequency="5 Hz").sentence()


@pytest.mark.parametrize("name", sorted(CLASSICS))
def test_text_and_tables_give_the_same_protocol_again(name):
    p = with_values(protocol(name), {"order": "random", "seed": 7, "repeat": 2, "note": 'a "quoted" note'})
    assert made(p.toml()) == p
    assert build_protocol(json.loads(json.dumps(p.document())), where="x") == p
    assert made(p.toml()).toml() == p.toml()
    assert hash(made(p.toml())) == hash(p)
    assert made(p.toml()).digest == p.digest


def test_hash_is_the_same_in_another_process_with_another_hash_seed():
    code = (
        "from mckibben.experiments.read import protocol, protocol_names; "
        "print(' '.join(protocol(n).digest for n in protocol_names()))"
    )
    for seed in ("1", "77"):
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True,
            env={"PYTHONHASHSEED": seed, "PATH": ""},
        )  # fmt: skip
        assert done.stdout.split() == [protocol(n).digest for n in protocol_names()]


def test_hash_is_of_what_is_done_and_not_of_how_it_is_written():
    p = protocol("quasi-static", pressure="5 bar")
    assert protocol("quasi-static", pressure="500 kPa").digest == p.digest
    assert protocol("quasi-static", pressure="5 bar", note="n", title="t").digest == p.digest
    changed = [{"pressure": "4.999 bar"}, {"cycles": 4}, {"sample_rate": "2 kHz"}, {"repeat": 2}, {"frequency": "2 Hz"}]
    assert len({p.digest, *(with_values(p, c).digest for c in changed)}) == 6


FIVE_LINES = """protocol = "quasi-static"
pressure = ["1 bar", "5 bar"]
frequency = "0.25 Hz"
range = "small"
order = "random"
"""


def test_five_lines_are_a_protocol(tmp_path):
    file = tmp_path / "p.toml"
    file.write_text(FIVE_LINES, encoding="utf-8")
    p = protocol(file)
    assert len(FIVE_LINES.splitlines()) == 5
    assert len(p.cases()) == 2
    assert {c["pressure"] for c in p.cases()} == {"1 bar", "5 bar"}
    loop = labelled(p.expand(rest_length=L0), "loops")[0]
    assert loop.count == 3 * 4000
    assert float(loop.motor.max()) == pytest.approx(0.875 * L0)


def test_the_samples_of_all_steps_together_are_bounded(monkeypatch):
    p = made(FIVE_LINES)
    plan = p.expand(rest_length=L0)
    assert plan.samples == sum(step.count for step in plan.steps) > max(step.count for step in plan.steps)
    monkeypatch.setattr(sys.modules["mckibben.experiments.protocol"], "LONGEST", plan.samples)
    assert p.expand(rest_length=L0).samples == plan.samples
    monkeypatch.setattr(sys.modules["mckibben.experiments.protocol"], "LONGEST", plan.samples - 1)
    with pytest.raises(InputError, match=f"samples must be at most {plan.samples - 1} in all.*got {plan.samples}"):
        p.expand(rest_length=L0)
    with pytest.raises(InputError, match="rest_length must be a length above zero"):
        p.expand(rest_length=0.0)


@pytest.mark.parametrize("name", sorted(CLASSICS))
def test_every_shipped_protocol_can_be_written_in_five_lines(name):
    p = protocol(name)
    lines = [f'protocol = "{name}"']
    for v in (*p.parameters, *p.choices):
        if v.values and len(lines) < 5:
            lines.append(f"{v.name} = {json.dumps(v.values[0])}")
    short = made("\n".join(lines))
    assert short.document() == made(short.toml()).document()
    assert short.expand(rest_length=L0).samples > 0


def test_quasi_static_is_as_printed():
    p = protocol("quasi-static")
    plan = p.expand(rest_length=L0)
    loops = labelled(plan, "loops")
    # six levels from 0 to 5 bar, at 1 Hz and 0.5 L0/s; the clock has 1 kHz
    assert [float(s.pressure[0]) for s in loops] == pytest.approx([0.0, 1e5, 2e5, 3e5, 4e5, 5e5], abs=1e-6)
    for step in loops:
        assert step.count == 3000
        assert step.record
        speed = np.abs(np.diff(step.motor)) * 1e3 / L0
        np.testing.assert_allclose(speed, 0.5, rtol=1e-9)
    slow = labelled(protocol("quasi-static", frequency="0.25 Hz").expand(rest_length=L0), "loops")[0]
    np.testing.assert_allclose(np.abs(np.diff(slow.motor)) * 1e3 / L0, 0.125, rtol=1e-9)
    small = labelled(protocol("quasi-static", range="small").expand(rest_length=L0), "loops")[0]
    large = loops[0].motor
    assert float(np.ptp(small.motor)) == pytest.approx(0.5 * float(np.ptp(large)))
    assert float(small.motor.min()) == pytest.approx(float(large.min()))
    # the three muscles, within the dynamic ranges of Table 1
    for option, low, high in (("large", 0.75, 1.1), ("fiberglass", 0.85, 1.15), ("bridgestone", 0.78, 1.02)):
        s = labelled(protocol("quasi-static", range=option).expand(rest_length=1.0), "loops")[0]
        assert float(s.motor.min()) == pytest.approx(low)
        assert float(s.motor.max()) <= high + 1e-12


def test_sinusoids_are_twelve_to_ten_hertz_and_reach_eight_rest_lengths_a_second():
    p = protocol("sinusoids")
    frequencies = [float(c["frequency"].split()[0]) for c in p.cases()]
    figure = [f for f in frequencies if f <= 10.0]
    assert (len(figure), min(figure), max(figure), frequencies[-1]) == (12, 1.0, 10.0, 40.0)
    fine = with_values(p, {"sample_rate": "100 kHz", "cycles": 1, "precondition": 0}).expand(rest_length=L0)
    peaks = [float(np.abs(np.diff(s.motor)).max()) * 1e5 / L0 for s in labelled(fine, "sines")]
    # Fig. 4 and the text: 0.2, 2.0 and 8.0 L0/s, printed with one digit
    assert [round(peaks[0], 1), round(peaks[11], 1), round(peaks[12], 1)] == [0.2, 2.0, 8.0]


def test_isotonic_is_three_loads_by_three_frequencies_with_the_motor_on_tension():
    plan = protocol("isotonic-triangle").expand(rest_length=L0)
    cycles = labelled(plan, "cycles")
    assert len(cycles) == 9
    assert {s.mode for s in cycles} == {"tension"}
    assert {float(s.motor[0]) for s in cycles} == {10.0, 30.0, 50.0}
    assert {s.count for s in cycles} == {5000, 2500, 1000}
    assert all(float(s.pressure.max()) == pytest.approx(5e5, rel=1e-2) for s in cycles)
    # where the span is when the motor takes it over again is for the machine to find
    assert isinstance(labelled(plan, "fill")[1].motor, Deferred)


def test_isometric_steps_jump_on_their_sample():
    full, half = labelled(protocol("isometric-step").expand(rest_length=L0), "steps")
    for step, high in ((full, 5e5), (half, 2.95e5)):
        assert step.count == 15000
        one = step.pressure[:5000]
        np.testing.assert_allclose(one[:2500], high)
        np.testing.assert_array_equal(one[2500:], 0.0)
        np.testing.assert_allclose(step.motor, L0)


def test_preconditioning_is_not_recorded_and_may_be_left_out():
    plan = protocol("quasi-static", precondition=5, pressure="3 bar").expand(rest_length=L0)
    before = labelled(plan, "preconditioning")
    assert len(before) == 5
    assert not any(s.record for s in before)
    assert not labelled(protocol("quasi-static", precondition=0).expand(rest_length=L0), "preconditioning")


def test_random_order_is_a_shuffle_that_the_seed_decides():
    plain = protocol("isokinetic", repeat=2)
    a, b, c = (protocol("isokinetic", repeat=2, order="random", seed=s) for s in (1, 1, 2))

    def key(p):
        return [json.dumps(x, sort_keys=True) for x in p.cases()]

    assert key(a) == key(b)
    assert key(a) != key(c)
    assert key(a) != key(plain)
    assert sorted(key(a)) == sorted(key(plain)) == sorted(key(c))


@pytest.mark.parametrize("phase", [math.pi / 2, 0.3, -math.pi / 2])
@pytest.mark.parametrize("kind", ["sine", "triangle"])
def test_pressure_by_direction_leads_every_reversal(kind, phase):
    motion = (
        Sine(mean=1.0, amplitude=0.1, frequency=2.0, phase=phase)
        if kind == "sine"
        else Triangle(low=0.9, high=1.1, frequency=2.0, rising=0.4)
    )
    lead, ramp = 0.03, 0.05
    wave = DirectionDependent(shortening=4e5, lengthening=1e5, lead=lead, ramp=ramp).table(motion, 3.0)
    t = np.arange(1000, 3000) * 1e-3
    later = motion.at(t + lead + 1e-6) - motion.at(t + lead - 1e-6)
    done = motion.at(t + lead - ramp + 1e-6) - motion.at(t + lead - ramp - 1e-6)
    settled = np.sign(later) == np.sign(done)  # no reversal within the ramp
    np.testing.assert_allclose(wave.at(t)[settled & (later < 0)], 4e5)
    np.testing.assert_allclose(wave.at(t)[settled & (later > 0)], 1e5)
    assert np.abs(np.diff(wave.at(np.arange(3000) * 1e-3))).max() <= 3e5 / ramp * 1e-3 * 1.001
    assert float(wave.at(0.0)) == 1e5


def drive(until, values, dt=1e-3, command=0.0):
    state = until.start()
    for i, x in enumerate(values):
        state, done = until.step(state, {until.channel: x}, command, dt, L0)
        if bool(done):
            return i
    return None


def test_until_is_true_when_it_says():
    rising = np.linspace(0.0, 100.0, 101)
    assert drive(read_until("tension >= 60 N", field="u"), rising) == 60
    assert drive(read_until("tension >= 60 N for 10 ms", field="u"), rising) == 70
    assert drive(read_until("span <= 0.8 L0", field="u"), [0.14, 0.113, 0.111]) == 2
    # it moves for 50 samples, then keeps still for 0.1 s
    moving = np.append(np.linspace(0.0, 1e5, 50), np.full(300, 1e5))
    still = drive(read_until("pressure settled within 0.01 bar for 0.1 s", field="u"), moving)
    assert still is not None
    assert 148 <= still <= 152
    assert drive(read_until("pressure settled within 0.01 bar for 0.1 s", field="u"), np.linspace(0, 1e7, 300)) is None
    # a creep of 0.033 bar in that time, though of less than the band from sample to sample
    creep = np.linspace(0.0, 1e4, 300)
    assert drive(read_until("pressure settled within 0.01 bar for 0.1 s", field="u"), creep) is None
    close = read_until("pressure within 0.01 bar of its set-point for 0.1 s", field="u")
    assert drive(close, moving, command=1e5) == 149
    assert drive(close, moving, command=2e5) is None
    assert drive(read_until("tension <= 5 N for 3 ms", field="u"), [1, 1, 9, 1, 1, 1, 1]) == 6


def test_until_can_be_traced_and_batched():
    import jax

    until = read_until("tension settled within 1 N for 2 ms", field="u")
    step = jax.jit(jax.vmap(lambda s, f: until.step(s, {"tension": f}, 0.0, 1e-3, L0)))
    state = (np.full(3, np.inf), np.zeros(3))
    for row in ([5.0, 5.0, 5.0], [5.0, 9.0, 5.0], [5.0, 9.0, 5.0], [5.0, 9.0, 9.0]):
        state, done = step(state, np.asarray(row))
    assert done.tolist() == [True, False, False]


@pytest.mark.parametrize(
    "text",
    [
        "tension >= 60 N",
        "span <= 0.8 L0 for 10 ms",
        "pressure settled within 0.02 bar for 200 ms",
        "velocity <= 0.1 L0/s",
    ],
)
def test_until_reads_its_own_sentence(text):
    until = read_until(text, field="u")
    assert until.sentence() == text
    assert read_until(until.sentence(), field="u") == until


# Properties of any plan -----------------------------------------------------------------------------------------------

LEVELS = st.floats(0.0, 6.0).map(lambda x: round(x, 3))
SPANS = st.floats(0.75, 1.05).map(lambda x: round(x, 4))
TIMES = st.floats(0.002, 0.5).map(lambda x: round(x, 4))


@st.composite
def step_words(draw):
    kind = draw(st.sampled_from(["lines", "sine", "hold", "triangle"]))
    if kind == "lines":
        return {
            "pressure": {"to": f"{draw(LEVELS)} bar", "in": f"{draw(TIMES)} s"},
            "span": {"to": f"{draw(SPANS)} L0", "at": "0.3 L0/s"},
        }
    if kind == "hold":
        return {"for": f"{draw(TIMES)} s"}
    wave = {"kind": "sine", "mean": "0.9 L0", "amplitude": "0.05 L0", "frequency": f"{draw(st.integers(1, 40))} Hz"}
    if kind == "triangle":
        wave = {"kind": "triangle", "low": "0.8 L0", "high": "1 L0", "frequency": "7 Hz", "rising": 0.3}
    return {"span": wave, "for": f"{draw(TIMES)} s", "repeat": draw(st.integers(0, 3))}


@settings(max_examples=60, deadline=None)
@given(st.lists(step_words(), min_size=1, max_size=6), st.sampled_from([200, 1000, 3000]))
def test_durations_add_up_and_lines_have_no_jumps(steps, rate):
    if not sum(s.get("repeat", 1) for s in steps):
        return
    document = {"schema": 1, "name": "x", "sample_rate": f"{rate} Hz", "steps": steps}
    p = build_protocol(document, where="x")
    plan = p.expand(rest_length=L0)
    assert plan.samples == sum(s.count for s in plan.steps)
    assert [s.start for s in plan.steps] == [0, *itertools.accumulate(s.count for s in plan.steps)][:-1]
    for s in plan.steps:
        assert s.motor.shape == s.pressure.shape == (s.count,)
        stated = s.step.stated_duration()
        if stated is not None:
            assert abs(s.count / rate - stated) <= max(0.5 / rate * (1 + 1e-9), 1.0 / rate - stated)
        if s.step.mode is None or "to" in str(s.step.motor):
            first = s.motor_before.low  # a line begins where the channel is
            assert s.motor[0] == pytest.approx(first, abs=1e-12)
        assert s.pressure[0] == pytest.approx(s.pressure_before.low, abs=1e-9)
    pressures = np.concatenate([s.pressure for s in plan.steps])
    steepest = max((6e5 / s.step.pressure.seconds for s in plan.steps if s.step.pressure is not None), default=0.0)
    # a line of no whole number of samples ends up to half a sample early, and the next step begins at its target
    assert np.abs(np.diff(pressures)).max(initial=0.0) <= 1.5 * steepest / rate * (1 + 1e-9) + 1e-6
    assert build_protocol(p.document(), where="x") == p


def test_a_line_ends_at_its_target_on_the_next_sample():
    text = """schema = 1
name = "x"
[[steps]]
pressure = { to = "3 bar", in = "1 s" }
span = { to = "0.8 L0", at = "0.1 L0/s" }
[[steps]]
for = "1 ms"
"""
    first, then = made(text).expand(rest_length=L0).steps
    assert first.count == 2000  # the longer of 1 s and 0.2 L0 at 0.1 L0/s
    assert float(first.pressure[999]) == pytest.approx(2.997e5)
    assert float(first.pressure[1000]) == pytest.approx(3e5)
    assert float(then.motor[0]) == pytest.approx(0.8 * L0, abs=1e-15)


def test_after_a_waveform_the_channel_keeps_its_end_and_after_a_jump_its_level():
    text = """schema = 1
name = "x"
sample_rate = "100 Hz"
[[steps]]
span = { kind = "sine", mean = "0.9 L0", amplitude = "0.1 L0", frequency = "1 Hz" }
pressure = { kind = "square", low = "1 bar", high = "2 bar", frequency = "4 Hz" }
for = "0.25 s"
[[steps]]
for = "1 s"
"""
    _, then = made(text).expand(rest_length=L0).steps
    # a quarter of the sine ends on its peak, past the last sample; the square's next jump up belongs to the next sample
    np.testing.assert_allclose(then.motor, 1.0 * L0, rtol=1e-12)
    np.testing.assert_allclose(then.pressure, 1e5)


HEAD = 'schema = 1\nname = "x"\n'
BAD = {
    "not TOML": ("steps = [", "not TOML"),
    "schema": ('name = "x"', "schema"),
    "future schema": ('schema = 9\nname = "x"', "schema"),
    "no steps": (HEAD, "steps"),
    "steps are no tables": (HEAD + "steps = [1]", "steps.1"),
    "unknown key": (HEAD + 'steps = [{presure = "1 bar", for = "1 s"}]', "Did you mean 'pressure'"),
    "unit": (HEAD + 'steps = [{pressure = "1 cm", for = "1 s"}]', "steps.1.pressure"),
    "no duration": (HEAD + 'steps = [{pressure = "1 bar"}]', "steps.1.for"),
    "two modes": (HEAD + 'steps = [{span = "1 L0", tension = "3 N", for = "1 s"}]', "steps.1.tension"),
    "until without time": (HEAD + 'steps = [{until = "tension >= 3 N"}]', "steps.1.for"),
    "until words": (HEAD + 'steps = [{until = "tension is high", for = "1 s"}]', "steps.1.until"),
    "until channel": (HEAD + 'steps = [{until = "tensio >= 3 N", for = "1 s"}]', "Did you mean 'tension'"),
    "unknown name": (HEAD + 'steps = [{pressure = "$p", for = "1 s"}]', "steps.1.pressure"),
    "cycles of nothing": (HEAD + 'steps = [{pressure = "1 bar", cycles = 3}]', "steps.1.cycles"),
    "mass among lengths": (
        HEAD + 'steps = [{span = {kind="triangle", low="12 kg", high="1 L0", frequency="1 Hz"}, for="1 s"}]',
        "steps.1.span.low",
    ),
    "line with both": (HEAD + 'steps = [{pressure = {to="1 bar", in="1 s", at="1 bar/s"}}]', "steps.1.pressure.in"),
    "infinite": (HEAD + 'steps = [{span = {to="1e999 L0", in="1 s"}}]', "steps.1.span.to"),
    "repeats without end": (
        HEAD + 'steps = [{repeat = 100000, steps = [{repeat = 100000, for = "1 s"}]}]',
        "steps.1.repeat",
    ),
    "only zero repeats": (HEAD + 'steps = [{repeat = 0, for = "1 s"}]', "steps"),
    "group in group": (HEAD + "steps = [{steps = [3]}]", "steps.1.steps.1"),
    "date": (HEAD + "steps = [{pressure = 1979-05-27, for = '1 s'}]", "steps.1.pressure"),
    "unused parameter": (HEAD + 'steps = [{for = "1 s"}]\n[parameters.a]\nunit = "Pa"\nvalue = "1 bar"', "parameters.a"),
    "reserved parameter": (
        HEAD + 'steps = [{for = "$seed"}]\n[parameters.seed]\nunit = "s"\nvalue = "1 s"',
        "parameters.seed",
    ),
    "choice of nothing": (
        HEAD + 'steps = [{for = "1 s"}]\n[choices.c]\nvalue = "a"\n[choices.c.options]\na = {x = "1 bar"}',
        "choices.c.options.a.x",
    ),
    "overtaking": (
        HEAD
        + 'steps = [{span={kind="sine",mean="0.9 L0",amplitude="0.1 L0",frequency="1 Hz"}, cycles=3, '
        + 'pressure={shortening="3 bar",lengthening="1 bar",ramp="600 ms"}}]',
        "steps.1.pressure.ramp",
    ),
    "choice without a value": (HEAD + 'steps = [{for = "1 s"}]\n[choices.c.options.a]', "choices.c.value"),
    "value that is no option": (
        HEAD + 'steps = [{for = "1 s"}]\n[choices.c]\nvalue = "b"\n[choices.c.options.aa]', "choices.c.value",
    ),
    "inferred that is no option": (
        HEAD + 'steps = [{for = "1 s"}]\n[choices.c]\nvalue = "a"\ninferred = "b"\n[choices.c.options.a]',
        "choices.c.inferred",
    ),
    "option that is no word": (
        HEAD + 'steps = [{for = "1 s"}]\n[choices.c]\nvalue = 1\n[choices.c.options.a]', "choices.c.value",
    ),
    "options of nothing": (HEAD + 'steps = [{for = "1 s"}]\n[choices.c]\nvalue = "a"\noptions = {}', "c.options"),
    "set to a list": (
        HEAD + 'steps = [{for = "1 s"}]\n[choices.c]\nvalue = "a"\noptions.a.x = [1]', "choices.c.options.a.x",
    ),
    "one bound": (HEAD + 'steps = [{for = "$a"}]\n[parameters.a]\nunit = "s"\nvalue = "1 s"\nlow = "1 s"', "a.low"),
    "bound of another kind": (
        HEAD + 'steps = [{for = "$a"}]\n[parameters.a]\nunit = "s"\nvalue = "1 s"\nlow = "1 m"\nhigh = "2 s"', "a.low",
    ),
    "inferred out of bounds": (
        HEAD + 'steps = [{for = "$a"}]\n[parameters.a]\nunit = "s"\nvalue = "1 s"\nlow = "1 s"\nhigh = "2 s"\n'
        'inferred = "3 s"',
        "parameters.a.inferred",
    ),
    "name of capitals": (HEAD + 'steps = [{for = "$A"}]\n[parameters.A]\nunit = "s"\nvalue = "1 s"', "parameters.A"),
    "unknown protocol": ('protocol = "quasistatic"', "Did you mean 'quasi-static'"),
    "unknown value": ('protocol = "quasi-static"\npresure = "1 bar"', "Did you mean 'pressure'"),
    "value out of bounds": ('protocol = "quasi-static"\nfrequency = "0 Hz"', "frequency"),
    "no values": ('protocol = "quasi-static"\npressure = []', "pressure"),
    "option": ('protocol = "quasi-static"\nrange = "tiny"', "range"),
    "order": ('protocol = "quasi-static"\norder = "backwards"', "order"),
    "seed": ('protocol = "quasi-static"\nseed = -1', "seed"),
    "control of nothing": ('protocol = "quasi-static"\ncontrol.presure.ki = 1', "Did you mean 'pressure'"),
    "control without a table": ('protocol = "quasi-static"\ncontrol.pressure = 1', "control.pressure"),
    "need of nothing": (HEAD + 'needs = ["moto"]\nsteps = [{for = "1 s"}]', "Did you mean 'motor'"),
    "needs no list": (HEAD + 'needs = "motor"\nsteps = [{for = "1 s"}]', "needs"),
    "cases": ('protocol = "quasi-static"\nrepeat = 10000', "cases"),
    "last with many values": (
        HEAD + 'steps = [{pressure="$a", for="1 s"}]\nlast = [{pressure="$a", for="1 s"}]\n[parameters.a]\nunit = "Pa"\n'
        'value = ["1 bar", "2 bar"]',
        "last",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_what_is_wrong_in_a_file_is_named(case):
    text, word = BAD[case]
    with pytest.raises(InputError) as caught:
        made(text)
    assert word in str(caught.value)
    assert str(caught.value).startswith("p.toml: ")
    assert "\n" not in str(caught.value) or case == "not TOML"


def test_a_file_that_is_not_there(tmp_path):
    for path in (tmp_path, tmp_path / "none.toml"):
        with pytest.raises(InputError):
            protocol(path)


WORDS = ("1 bar", "$a", "1 L0", "shut", "3 s", "tension >= 3 N", "sine", "go on")
KEYS = ("to", "in", "at", "kind", "steps", "repeat", "low", "high", "frequency", "shortening")


@settings(max_examples=150, deadline=None)
@given(
    st.recursive(
        st.one_of(st.text(max_size=8), st.integers(), st.floats(), st.booleans(), st.sampled_from(WORDS)),
        lambda x: st.lists(x, max_size=3) | st.dictionaries(st.sampled_from(KEYS), x, max_size=3),
        max_leaves=6,
    ),
    st.sampled_from(["pressure", "span", "tension", "until", "for", "repeat", "steps", "record", "ask", "cycles"]),
)  # fmt: skip
def test_nonsense_is_refused_and_never_crashes(value, key):
    step = {"for": "1 s"} | {key: value}
    try:
        p = build_protocol({"schema": 1, "name": "x", "steps": [step]}, where="x")
        p.sentence()
        p.expand(rest_length=L0)
    except InputError:
        pass


def test_lengths_of_a_waveform_may_be_in_rest_lengths_and_not():
    at = "0.25 s"  # a quarter of the period: at the top of the sine
    text = HEAD + 'steps = [{{span = {{kind="sine", mean={}, amplitude={}, frequency="1 Hz"}}, for="{}"}}]'
    for rest in (0.14, 0.3):
        spans = [
            made(text.format(f'"{mean}"', f'"{amplitude}"', at)).expand(rest_length=rest).steps[0].motor[-1]
            for mean, amplitude in (
                ("0.9 L0", "12 mm"),
                ("0.9 L0", f"{0.012 / rest!r} L0"),
                (f"{90.0 * rest!r} cm", "1.2 cm"),
            )
        ]
        assert spans == pytest.approx([spans[0]] * 3, rel=1e-12)  # the same sine, to rounding
    mixed = made(text.format('"0.9 L0"', '"12 mm"', at))
    assert "mean 0.9 L0, amplitude 1.2 cm" in mixed.sentence()
    assert mixed.digest == made(text.format('"0.9 L0"', '"1.2 cm"', at)).digest
    assert mixed.digest != made(text.format('"0.9 L0"', '"13 mm"', at)).digest


@pytest.mark.parametrize("name", protocol_names())
def test_every_amount_of_a_protocol_may_be_in_any_unit_of_its_dimension(name):
    p = protocol(name)
    others = {"m": ("mm", "inch"), "Pa": ("kPa", "psi"), "s": ("ms",), "N": ("mN",), "m/s": ("mm/s",), "Hz": ("mHz",)}
    for one in (q for q in p.parameters if q.unit in others):
        amount = read_amount((one.values or [case[one.name] for case in p.cases()])[0], one.unit, field=one.name)
        for unit in others[one.unit]:
            value = from_si(amount.si(0.14), one.unit, unit)
            changed = with_values(p, {one.name: f"{value!r} {unit}"})
            (found,) = {read_amount(case[one.name], one.unit, field="").value for case in changed.cases()}
            assert found == pytest.approx(amount.si(0.14), rel=1e-12)


@pytest.mark.parametrize(
    ("words", "values"), [("1 bar, 3 bar", 2), ("1 bar; 3 bar", 2), ("1 bar,3 bar", 2), ("2 bar", 1)]
)
def test_a_list_is_parted_by_semicolons_or_commas_that_stand_between_no_digits(words, values):
    changed = with_values(protocol("quasi-static"), {"pressure": values_of("pressure", words, field="")})
    assert len(changed.variables()["pressure"]) == values


@pytest.mark.parametrize("words", ["0,08", "1,5 bar", "1,2,3", "1,000 N"])
def test_a_comma_between_digits_is_refused(words):
    with pytest.raises(InputError, match="comma between two digits"):
        values_of("pressure", words, field="pressure")
    assert values_of("title", words, field="title") == words  # a comma is a comma there


@pytest.mark.parametrize("name", sorted(CLASSICS))
def test_a_plan_says_how_long_it_takes_and_its_clauses_where_they_stand(name):
    whole = protocol(name)
    plan = expand(whole, rest_length=L0)
    counts = [step.count for step in plan.steps]
    assert [step.start for step in plan.steps] == [sum(counts[:i]) for i in range(len(counts))]
    assert plan.samples == sum(counts) and plan.duration == plan.samples / plan.sample_rate
    for step in plan.steps:
        entry = step.entry(1.0, 2.0)
        assert (entry["index"], entry["path"], entry["label"]) == (step.index, step.path, step.step.label)
        assert (entry["start"], entry["end"], entry["recorded"]) == (1.0, 2.0, step.record)
        assert set(entry["case"]) == set(step.case) and all(isinstance(word, str) for word in entry["case"].values())
    text = (resources.files("mckibben.experiments") / "protocols" / f"{name}.toml").read_text(encoding="utf-8")
    assert plan.may_end_early is bool(re.search(r"\buntil = ", text))
    order = ["first", "steps", "last"]
    places = [(order.index(path.split(".")[0]), int(path.split(".")[1])) for path, words in clauses(whole) if words]
    assert places == sorted(set(places)) and len(places) == len(clauses(whole))
    assert all(1 <= at <= len(getattr(whole, order[section])) for section, at in places)
