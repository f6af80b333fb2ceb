"""The emergency stop: the first reason stays, an ordinary stop may become an emergency, and signals press it."""

import signal

import pytest

from mckibben.bench.software.interlocks import EmergencyStop, stop_sentence

ORDINARY, EMERGENCY = True, False


@pytest.mark.parametrize(
    ("first", "second", "counts"),
    [
        (ORDINARY, ORDINARY, "first"),
        (ORDINARY, EMERGENCY, "second"),  # more than an ordinary stop has happened
        (EMERGENCY, ORDINARY, "first"),
        (EMERGENCY, EMERGENCY, "first"),
    ],
)
def test_only_an_emergency_after_an_ordinary_stop_replaces_its_reason(first, second, counts):
    heard = []
    button = EmergencyStop(lambda reason, ordinary: heard.append((reason, ordinary)))
    assert not button()
    button.press("first", ordinary=first)
    assert button() and (button.reason, button.ordinary) == ("first", first)
    button.press("second", ordinary=second)
    assert button() and (button.reason, button.ordinary) == (counts, first if counts == "first" else second)
    assert heard == [("first", first), ("second", second)]  # who listens is told of each


def test_a_sentence_says_which_kind_of_stop_it_was_and_that_the_machine_vented():
    button = EmergencyStop()
    assert stop_sentence(button, 1.5) == "emergency stop at 1.5 s: asked to; stopped and vented"
    button.press("by hand", ordinary=True)
    assert stop_sentence(button, 1.5) == "stopped at 1.5 s: by hand; vented"
    button.press("Esc")
    assert stop_sentence(button, 1.5) == "emergency stop at 1.5 s: Esc; stopped and vented"
    assert stop_sentence(lambda: True, 0.1) == "emergency stop at 0.1 s: asked to; stopped and vented"


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="signals of POSIX")
def test_every_signal_that_ends_a_program_presses_it_once_and_the_next_ends_the_program():
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        button, before = EmergencyStop(), signal.getsignal(number)
        with button.on_signals():
            signal.raise_signal(number)
            assert button.reason == f"signal {number.name}" and not button.ordinary
            with pytest.raises(KeyboardInterrupt):
                signal.raise_signal(number)
        assert signal.getsignal(number) is before


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="signals of POSIX")
def test_a_hang_up_that_is_ignored_ends_no_run():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as nohup does
    try:
        button = EmergencyStop()
        with button.on_signals():
            signal.raise_signal(signal.SIGHUP)
            assert not button()
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)
