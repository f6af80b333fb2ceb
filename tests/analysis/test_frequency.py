"""Frequency responses of systems whose transfer function is known: a lag with dead time, and a resonance."""

import numpy as np
import pytest
from scipy import signal

from mckibben.analysis.frequency import frequency_response, linear_response, sine_response
from mckibben.errors import InputError
from mckibben.recordings import Channel, Recording

RATE, CUTOFF, DEAD = 1000.0, 10.0, 0.004
TIME = np.arange(60001) / RATE


def transfer(f):
    return 2.0 * np.exp(-2j * np.pi * f * DEAD) / (1.0 + 1j * f / CUTOFF)


def behind(x):
    """First-order lag (bilinear, pre-warped at the cut-off), gain 2, four samples late."""
    b, a = signal.butter(1, CUTOFF, fs=RATE)
    return 2.0 * np.concatenate([np.zeros(4), signal.lfilter(b, a, x)[:-4]])


def run(x, y):
    return Recording(TIME[: len(x)], {"valve.command": Channel(x, "1", "command"), "muscle.pressure": Channel(y, "Pa")})


CHANNELS = {"source": "valve.command", "response": "muscle.pressure"}
CHIRP = signal.chirp(TIME, 0.1, 60.0, 60.0)
SINES = (0.5, 1.3, 3.1, 7.0, 10.0, 17.0, 29.0, 43.0)


def test_a_chirp_gives_the_transfer_function():
    """Segments of 2 s against 1/(2 pi 10 Hz) = 16 ms of memory: leakage between segments of some 16 ms/2 s, 1 %. Bilinear
    warping at 40 Hz: (pi 40/1000)^2/3 = 0.5 % of the frequency.
    """
    found = frequency_response(run(CHIRP, behind(CHIRP)), **CHANNELS, resolution=0.5)
    inside = (found.frequency > 0.75) & (found.frequency < 40.25)
    assert inside.sum() == 79
    truth = transfer(found.frequency[inside])
    assert np.abs(found.complex[inside] / truth - 1.0).max() < 0.02
    assert found.phase[inside] == pytest.approx(np.unwrap(np.angle(truth)), abs=0.02)
    assert found.coherence[inside].min() > 0.99
    assert found.cutoff(reference=2.0) == pytest.approx(CUTOFF, rel=0.03)


def test_noise_lowers_the_coherence_as_it_should():
    """White input, output noise of the same density as the response at low frequency: coherence 1/(1 + 1). Some 40
    independent segments: a deviation of (1 - c) sqrt(2c/40) = 0.08, over some three independent lines 0.045; two of them.
    """
    random = np.random.default_rng(2)
    x = random.normal(0.0, 1.0, TIME.size)
    y = behind(x) + random.normal(0.0, 2.0, TIME.size)
    found = frequency_response(run(x, y), **CHANNELS, resolution=0.5, band=(0.5, 2.0))
    assert found.coherence.mean() == pytest.approx(0.5, abs=0.09)
    assert found.segments == 117
    assert np.median(found.magnitude) == pytest.approx(2.0, rel=0.1)


@pytest.mark.parametrize("count", [0.0, 4.0 / 256])
def test_many_sines_are_exact_and_survive_eight_bits(count):
    """The response is built from its own sines, so that no transient is in it. Counts of 4/256: 4.5e-3 of white noise over
    10001 samples leave 4.5e-3 sqrt(2/1e4) = 6e-5 per sine, beside 0.09 at 43 Hz 0.07 %; five of them.
    """
    time = TIME[:10001]
    phases = np.random.default_rng(1).uniform(0.0, 2.0 * np.pi, len(SINES))
    waves = [0.2 * np.exp(1j * (2.0 * np.pi * f * time + p)) for f, p in zip(SINES, phases, strict=True)]
    x = np.real(sum(waves))
    y = np.real(sum(w * transfer(f) for f, w in zip(SINES, waves, strict=True))) + 3.0
    y = count * np.round(y / count) if count else y
    found = sine_response(run(x, y), SINES, **CHANNELS)
    off = np.abs(found.complex / transfer(np.array(SINES)) - 1.0)
    assert off.max() < (4e-3 if count else 1e-9)
    assert found.coherence.min() > 0.999


def test_one_record_gives_the_same_at_any_clock_and_start():
    time = TIME[:10001]
    x, y = np.sin(2.0 * np.pi * 3.0 * time), np.imag(transfer(3.0) * np.exp(2j * np.pi * 3.0 * time))
    whole = run(x, y)
    for part in (
        whole,
        whole.select(0.123, 4.567),
        Recording(time[::7], {n: whole.channels[n].with_values(whole[n][::7]) for n in whole.channels}),
    ):
        assert sine_response(part, [3.0], **CHANNELS).complex[0] == pytest.approx(transfer(3.0), rel=1e-9)


def test_a_resonance_is_found():
    """A magnitude good to 2 % around a top of 2.55 that bends by 1 % in 0.35 Hz places it to 0.5 Hz."""
    system = signal.TransferFunction([1.0], [1.0 / (2 * np.pi * 8.0) ** 2, 2 * 0.2 / (2 * np.pi * 8.0), 1.0])
    x = signal.chirp(TIME, 0.5, 60.0, 30.0)
    _, y, _ = signal.lsim(system, x, TIME)
    found = frequency_response(run(x, y), **CHANNELS, resolution=0.25)
    inside = (found.frequency > 1.0) & (found.frequency < 16.0)
    u = found.frequency[inside] / 8.0
    assert np.abs(found.complex[inside] * (1.0 - u**2 + 0.4j * u) - 1.0).max() < 0.02
    peak = found.frequency[found.magnitude.argmax()]
    assert peak == pytest.approx(8.0 * np.sqrt(1.0 - 2.0 * 0.2**2), abs=0.5)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"resolution": 0.01}, "two segments"),
        ({"resolution": 900.0}, "two segments"),
        ({"resolution": -1.0}, "above 0"),
        ({"band": (700.0, 800.0)}, "holds no frequency"),
    ],
)
def test_settings_that_cannot_be_are_refused(options, says):
    with pytest.raises(InputError, match=says):
        frequency_response(run(CHIRP, behind(CHIRP)), **CHANNELS, **options)


def test_records_without_a_response_are_refused():
    x, still = np.sin(2.0 * np.pi * TIME), np.ones(TIME.size)
    for bad in (run(x, still), run(still, x)):
        with pytest.raises(InputError, match="constant"):
            frequency_response(bad, **CHANNELS)
    with pytest.raises(InputError, match="nothing there"):
        sine_response(run(x, x), [1.0, 2.0], **CHANNELS)
    with pytest.raises(InputError, match="constant"):
        sine_response(run(x, still), [1.0], **CHANNELS)
    for wrong, says in (([0.0], "must be"), ([600.0], "must be"), ([1.0, 1.0], "told apart"), ([np.nan], "finite")):
        with pytest.raises(InputError, match=says):
            sine_response(run(x, x), wrong, **CHANNELS)
    with pytest.raises(InputError, match="tank"):
        sine_response(run(x, x), [1.0], source="tank", response="muscle.pressure")


def test_the_response_of_a_linear_model_is_its_transfer_function_with_a_phase_that_goes_on():
    """Three lags and a dead time turn by more than half a turn, at which an angle alone would jump."""

    class Model:
        def response(self, source, target, frequencies):
            assert (source, target) == ("valve", "force")
            return transfer(frequencies) ** 3

    at = np.geomspace(0.1, 60.0, 200)
    found = linear_response(Model(), "valve", "force", at)
    np.testing.assert_allclose(found.complex, transfer(at) ** 3, rtol=1e-12)  # rounding
    turned = -3.0 * (2.0 * np.pi * at * DEAD + np.arctan(at / CUTOFF))
    np.testing.assert_allclose(found.phase, turned, rtol=1e-12)
    assert np.all(found.coherence == 1.0) and found.segments == 0  # nothing was measured
