"""Trains of stimuli: what each counts, when it comes within the length cycle, and what is refused."""

import numpy as np
import pytest

from mckibben.errors import InputError
from mckibben.experiments.read import parse_protocol, protocol, protocol_names, stimulation_protocol_names

L0 = 0.14


def steps(stimulation: str, *, span: str = '"1 L0"', lasts: str = 'for = "1 s"', rate: str = "5 kHz"):
    text = (
        f'schema = 1\nname = "p"\nsample_rate = "{rate}"\n'
        f"[[steps]]\nspan = {span}\nstimulation = {stimulation}\n{lasts}\n"
    )
    return parse_protocol(text, where="p.toml").expand(rest_length=L0).steps


SINE = '{ kind = "sine", mean = "1 L0", amplitude = "0.05 L0", frequency = "5 Hz" }'


@pytest.mark.parametrize("rate", ["5 kHz", "777 Hz", "130 Hz"])
def test_every_stimulus_excites_for_its_width_at_any_sample_rate(rate):
    """Integral of the excitation: 30 stimuli of 3 ms, to rounding."""
    (step,) = steps('{ rate = "60 Hz", width = "3 ms", lasts = "0.5 s" }', rate=rate)
    assert step.stimulation.sum() / float(rate.split()[0]) / (1e3 if "k" in rate else 1.0) == pytest.approx(
        30 * 3e-3, rel=1e-9
    )
    assert step.stimulation.min() >= 0.0 and step.stimulation.max() <= 1.0


def test_stimuli_that_follow_without_a_gap_are_one_excitation():
    (step,) = steps('{ rate = "200 Hz", width = "5 ms", start = "0.1 s", lasts = "0.5 s" }')
    time = np.arange(5000) / 5e3
    wanted = ((time > 0.1 - 1e-6) & (time < 0.6 - 1e-6)).astype(float)
    np.testing.assert_allclose(step.stimulation, wanted, atol=1e-9)  # ends of stimuli, to rounding


def test_without_a_rate_there_is_one_stimulus():
    (step,) = steps('{ width = "5 ms" }')
    assert np.flatnonzero(step.stimulation > 1e-9).tolist() == list(range(25))


@pytest.mark.parametrize(("phase", "length"), [("90 deg", 1.05), ("-90 deg", 0.95), ("270 deg", 0.95), ("0 deg", 1.0)])
def test_stimulation_begins_at_its_phase_of_the_length_cycle(phase, length):
    train = f'{{ rate = "200 Hz", width = "5 ms", phase = "{phase}", duty = 0.25 }}'
    (step,) = steps(train, span=SINE, lasts="cycles = 3")
    onsets = np.flatnonzero(np.diff(step.stimulation, prepend=0.0) > 0.5)  # a quarter of a cycle is 250 samples
    assert len(onsets) == 3
    np.testing.assert_allclose(step.motor[onsets], length * L0, rtol=1e-9)


def test_duty_is_the_share_of_the_cycle_with_stimulation():
    (step,) = steps('{ rate = "200 Hz", width = "5 ms", phase = "30 deg", duty = 0.4 }', span=SINE, lasts="cycles = 5")
    assert step.stimulation.mean() == pytest.approx(0.4, rel=1e-9)  # 16 stimuli of 5 ms in each 200 ms


def test_stimulation_ends_with_its_step():
    text = (
        'schema = 1\nname = "p"\n[[steps]]\nstimulation = { rate = "200 Hz", width = "5 ms" }\nfor = "0.1 s"\n'
        '[[steps]]\nlabel = "after"\nfor = "0.1 s"\n[[steps]]\nstimulation = 0.5\nfor = "0.1 s"\n[[steps]]\nfor = "0.1 s"\n'
    )
    plan = parse_protocol(text, where="p.toml").expand(rest_length=L0).steps
    assert [float(step.stimulation[-1]) for step in plan] == [1.0, 0.0, 0.5, 0.5]


@pytest.mark.parametrize(
    ("stimulation", "problem"),
    [
        ('{ rate = "60 Hz", width = "3 ms", phase = "0 deg" }', "duty is missing: phase and duty are stated together"),
        ('{ width = "3 ms", lasts = "1 s" }', "rate is missing: a train of stimuli has one"),
        ('{ rate = "60 Hz", width = "3 ms", phase = "0 deg", duty = 0.3 }', "needs a span that follows a sine"),
        ('{ rate = "60 Hz", width = "3 ms", phase = "0 deg", duty = 1.3 }', "duty must be"),
        ('{ rate = "60 Hz", width = "3 ms", phase = "450 deg", duty = 0.3 }', "phase must be"),
        ('{ rate = "60 Hz", width = "3 ms", pace = 3 }', "pace"),
        ('{ rate = "60 bar", width = "3 ms" }', "rate"),
        ('{ width = "3 ms" }\npressure = "1 bar"', "stimulation cannot be stated beside pressure"),
    ],
)
def test_a_stimulation_that_cannot_be_is_refused_by_its_place(stimulation, problem):
    with pytest.raises(InputError, match="p.toml") as refused:
        steps(stimulation)
    assert problem in str(refused.value)


@pytest.mark.parametrize("name", stimulation_protocol_names())
def test_every_protocol_with_stimulation_comes_back_from_its_text(name):
    shipped = protocol(name)
    assert parse_protocol(shipped.toml(), where="p.toml").digest == shipped.digest
    assert "stimulator" in shipped.required() and name not in protocol_names()
    assert "stimulation" in shipped.sentence()
