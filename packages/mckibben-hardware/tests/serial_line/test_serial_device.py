"""What a device answers, in Python and in C alike: it samples, holds its outputs, and vents when nobody speaks to it."""

import random
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from serial_devices import NANOSECONDS, Desk
from serial_machines import Tiny, controller, straight

from mckibben_hardware.serial_line import messages
from mckibben_hardware.serial_line.device import About
from mckibben_hardware.serial_line.messages import (
    BY_ITSELF,
    DAMAGED,
    FREE,
    LOCK_STEP,
    UNANSWERED,
    VENTED,
    CommandMessage,
    Fault,
    Hello,
    SampleMessage,
    Start,
    Stop,
    Vent,
    Welcome,
)  # fmt: skip

Make = Callable[..., Desk]
HELLO = Hello(1, messages.VERSION)


def test_a_device_says_what_it_is(desk: Make) -> None:
    about = About("bench 7 µ", 50_000, encoder=False, motor=True, motor_rest=2048)
    (found,) = desk(about=about).say(Hello(99, messages.VERSION))
    names = tuple(f"channel.{i}" for i in range(8))
    assert found == Welcome(99, messages.VERSION, 50_000, False, True, 2048, (12,) * 8, "bench 7 µ", names)


def test_samples_count_from_zero_and_carry_run_time_and_counts(desk: Make) -> None:
    one, twin = desk(), Tiny()
    one.begin(run=70_000)
    for k in range(5):
        (sample,) = one.tick()
        counts, edges = twin.sample()
        assert sample == SampleMessage(k, 70_000 % 2**16, 7 + (k + 1) * NANOSECONDS, 0, edges, tuple(counts))
        assert one.say(CommandMessage(k, 10 * k, 20 * k, k % 2 == 0)) == []
        twin.advance(10 * k, 20 * k, k % 2 == 0)
    assert one.machine.period == 1e-3


def test_in_lock_step_a_sample_comes_after_each_command_and_only_then(desk: Make) -> None:
    one, rows = desk(), []
    one.begin(LOCK_STEP)
    (sample,) = one.tick()
    for k in range(200):
        assert not one.device.due
        assert one.tick() == []
        command = controller(k, sample.counts, sample.encoder)
        rows.append((sample.counts, sample.encoder, command))
        one.say(CommandMessage(k + 1, 1, 1, True), CommandMessage(k, *command), CommandMessage(k, 1, 1, False))
        assert one.device.due
        (sample,) = one.tick()
        assert (sample.sequence, sample.time, sample.flags) == (k + 1, (k + 1) * NANOSECONDS, 0)
    assert rows == straight(Tiny(), 200)


@pytest.mark.parametrize("watchdog", [2, 3, 7])
def test_the_watchdog_vents_so_many_samples_after_the_last_command_and_stays(desk: Make, watchdog: int) -> None:
    one = desk(about=About(motor_rest=2048))
    one.begin(watchdog=watchdog)
    for k in range(4):
        one.tick()
        one.say(CommandMessage(k, 100, 200, False))
    held = len(one.machine.history)
    flags = [one.tick()[0].flags for _ in range(watchdog)]
    # The first of these is the one that the last command was for.
    assert flags == [0] + [UNANSWERED] * (watchdog - 2) + [UNANSWERED | VENTED | BY_ITSELF]
    assert one.machine.history[held:] == [(100, 200, False)] * watchdog
    assert one.board.outputs == (0, 2048, True)
    for _ in range(3):  # whatever comes then
        number = one.tick()[0].sequence
        one.say(CommandMessage(number, 100, 200, False))
    assert one.machine.history[held + watchdog :] == [(0, 2048, True)] * 3
    assert one.tick()[0].flags == VENTED | BY_ITSELF
    one.say(Start(6, NANOSECONDS, FREE, 2))
    assert one.tick()[0].flags == 0


def test_a_machine_that_nobody_ever_commands_is_at_rest_and_vented(desk: Make) -> None:
    one = desk(about=About(motor_rest=9))
    one.begin()
    assert [one.tick()[0].flags & VENTED for _ in range(4)] == [0, 0, VENTED, VENTED]
    assert one.machine.history == [(0, 9, True)] * 3


def test_old_repeated_and_future_commands_do_not_keep_it_alive(desk: Make) -> None:
    one = desk()
    one.begin(watchdog=3)
    for _ in range(3):
        one.tick()
    one.say(CommandMessage(2, 100, 0, True))
    for _ in range(3):
        flags = one.tick()[0].flags
        one.say(CommandMessage(2, 1, 1, False), CommandMessage(0, 1, 1, False), CommandMessage(10**6, 1, 1, False))
    assert flags & BY_ITSELF
    assert one.machine.history[-1] == (100, 0, True)


def test_a_late_command_is_used_and_its_sample_flagged(desk: Make) -> None:
    one = desk()
    one.begin(watchdog=5)
    one.tick()
    assert one.tick()[0].flags == UNANSWERED
    one.say(CommandMessage(0, 33, 44, False))
    assert one.board.outputs == (33, 44, False)
    assert one.tick()[0].flags == UNANSWERED  # sample 1 has no answer yet
    one.say(CommandMessage(2, 33, 44, False))
    assert one.tick()[0].flags == 0


@pytest.mark.parametrize("mode", [FREE, LOCK_STEP])
def test_vent_holds_against_commands_while_the_motor_follows_them(desk: Make, mode: int) -> None:
    one = desk()
    one.begin(mode)
    one.tick()
    one.say(CommandMessage(0, 100, 200, False), Vent())
    assert one.board.outputs == (0, 200, True)
    one.tick()
    one.say(CommandMessage(1, 100, 300, False))
    assert one.board.outputs == (0, 300, True)
    (sample,) = one.tick()
    assert sample.flags == VENTED


def test_stop_and_a_new_greeting_end_the_run_at_rest(desk: Make) -> None:
    for last in (Stop(), HELLO):
        one = desk(about=About(motor_rest=5))
        one.begin()
        one.tick()
        one.say(CommandMessage(0, 100, 200, False))
        one.say(last)
        assert one.board.outputs == (0, 5, True)
        assert not one.board.clocked
        assert one.tick() == []


@pytest.mark.parametrize(
    "start",
    [Start(1, 99_999, FREE, 2), Start(1, 0, FREE, 2), Start(1, NANOSECONDS, 2, 2), Start(1, NANOSECONDS, FREE, 1)],
)
def test_a_start_that_cannot_be_is_refused(desk: Make, start: Start) -> None:
    one = desk()
    one.say(HELLO)
    (fault,) = one.say(start)
    assert isinstance(fault, Fault)
    assert fault.code == messages.REFUSED
    assert one.tick() == []


def test_nobody_starts_without_the_right_version(desk: Make) -> None:
    for greeting in ([], [Hello(1, messages.VERSION + 1)]):
        one = desk()
        one.say(*greeting)
        (fault,) = one.say(Start(1, NANOSECONDS, FREE, 2))
        assert isinstance(fault, Fault)
        assert fault.code == messages.WRONG_VERSION


def test_a_machine_that_fails_ends_the_run_with_a_fault(desk: Make) -> None:
    one = desk(machine=Tiny(fails_at=1))
    one.begin()
    one.tick()
    one.say(CommandMessage(0, 100, 200, False))
    (fault,) = one.tick()
    assert fault == Fault(1, messages.HARDWARE, "the machine cannot be read")
    assert one.board.outputs == (0, 0, True)
    assert str(one.board.failed) == "the physics failed"


def test_what_is_damaged_is_told_once(desk: Make) -> None:
    one = desk()
    one.begin(watchdog=9)
    one.tick()
    bad = bytearray(messages.encode(CommandMessage(0, 100, 200, False)))
    bad[6] ^= 1
    one.feed(bytes(bad))
    assert one.board.outputs == (0, 0, True)
    assert [one.tick()[0].flags for _ in range(2)] == [UNANSWERED | DAMAGED, UNANSWERED]
    one.feed(messages.frame(0x77, 1) + messages.frame(3, 1, b"short"))
    assert one.tick()[0].flags & DAMAGED


SMALL = st.integers(0, 6)
TALK = st.one_of(
    st.just("tick"),
    st.builds(CommandMessage, SMALL, SMALL, SMALL, st.booleans()),
    st.sampled_from([Vent(), Stop(), HELLO, Hello(2, 9)]),
    st.builds(Start, SMALL, st.sampled_from([5, NANOSECONDS, NANOSECONDS]), SMALL.map(lambda i: i % 3), SMALL),
    st.binary(max_size=12),
)


@given(st.lists(TALK, max_size=40), st.booleans())
def test_python_and_c_say_the_same_bytes_whatever_happens(library: Path, talk: list[Any], greeted: bool) -> None:
    pair = Desk(), Desk(library=library)
    begun: list[Any] = [HELLO, Start(3, NANOSECONDS, FREE, 3), "tick"] if greeted else []
    for said in [*begun, *talk]:
        for one in pair:
            if said == "tick":
                one.tick()
            else:
                one.feed(said if isinstance(said, bytes) else messages.encode(said))
        assert pair[0].sent == pair[1].sent
        assert pair[0].board.outputs == pair[1].board.outputs
        assert pair[0].device.due == pair[1].device.due
        assert pair[0].board.clocked == pair[1].board.clocked
    assert pair[0].machine.history == pair[1].machine.history


def test_thousands_of_damaged_frames_leave_the_device_as_it_should_be(desk: Make) -> None:
    draw, one = random.Random(3), desk()
    one.begin(watchdog=65535)
    one.tick()
    for k in range(3000):
        good = bytearray(messages.encode(CommandMessage(k, 1, 2, False)))
        match draw.randrange(4):
            case 0:
                good[draw.randrange(len(good) - 1)] ^= 1 << draw.randrange(8)
            case 1:
                good = good[: draw.randrange(len(good) - 1)]
            case 2:
                good = bytearray(draw.randbytes(draw.randrange(2000)))
            case 3:
                good[3:3] = draw.randbytes(draw.randrange(1, 30))
        one.feed(bytes(good))
        assert one.tick()[0].flags & BY_ITSELF == 0
    assert set(one.machine.history) == {(0, 0, True)}  # none of it was taken for a command
    one.feed(b"\0")
    one.say(CommandMessage(3000, 1, 2, False))
    assert one.board.outputs == (1, 2, False)


def test_the_firmware_stays_within_its_memory(compiler: str, tmp_path: Path) -> None:
    # The same with the compiler's checks of every access, in a separate process.
    firmware, here = Path(__file__).parents[2] / "firmware", Path(__file__).parent
    checked = ["-g", "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    sources = [str(firmware / "frame.c"), str(firmware / "bench.c"), str(here / "fuzz.c")]
    program = tmp_path / "fuzz"
    strict = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", f"-I{firmware}"]
    done = subprocess.run([compiler, *strict, *checked, "-o", str(program), *sources], capture_output=True, text=True)
    if done.returncode != 0:
        plain = subprocess.run([compiler, *strict, "-o", str(program), *sources], capture_output=True, text=True)
        assert plain.returncode == 0, plain.stderr
        pytest.skip("this C compiler has no sanitizers")
    draw, stream = random.Random(4), bytearray()
    for _ in range(20_000):
        match draw.randrange(5):
            case 0:
                one = messages.frame(
                    draw.randrange(1, 6), draw.randrange(9), draw.randbytes(draw.choice([0, 2, 7, 9, 500]))
                )
            case 1:
                one = messages.encode(Start(1, NANOSECONDS, draw.randrange(2), 5))
            case 2:
                one = messages.encode(
                    draw.choice([HELLO, Vent(), Stop(), CommandMessage(draw.randrange(50), 1, 2, True)])
                )
            case 3:
                one = draw.randbytes(draw.randrange(40)) + b"\0"
            case _:
                one = messages.coded(draw.randbytes(draw.randrange(1000, 1040))) + b"\0"
        stream += one
    ran = subprocess.run([str(program)], input=bytes(stream), capture_output=True, timeout=120)
    assert ran.returncode == 0, ran.stderr.decode(errors="replace")[-2000:]
    assert int(ran.stdout) > 1000  # frames that it answered with
