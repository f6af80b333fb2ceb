"""Whatever comes by the line, the host takes samples or loses the line with one sentence, in bounded time and memory."""

import os
import random
import threading
import time
import tty
from pathlib import Path

import pytest
from serial_devices import Direct
from serial_machines import Tiny, over_the_line, straight

from mckibben.errors import InputError, LineLostError
from mckibben_hardware.serial_line import SerialHardware, messages
from mckibben_hardware.serial_line.link import DRIFT, GRACE, Arrivals, EndedError, ReceivedSample
from mckibben_hardware.serial_line.messages import SampleMessage


def same(data: bytes) -> bytes:
    return data


def test_a_port_without_a_descriptor_gives_the_same_run() -> None:
    port = Direct(Tiny(), same, same)
    hardware = SerialHardware(port, lock_step=True)
    assert over_the_line(hardware, 300) == straight(Tiny(), 300)
    hardware.close()
    assert port.closed


class Noise:
    """Damages some frames, once it is switched on."""

    def __init__(self, seed: int, share: float) -> None:
        self.draw, self.share, self.on = random.Random(seed), share, False

    def __call__(self, data: bytes) -> bytes:
        draw = self.draw
        if not self.on or draw.random() > self.share:
            return data
        line = bytearray(data)
        match draw.randrange(6):
            case 0:
                line[draw.randrange(len(line))] ^= 1 << draw.randrange(8)
            case 1:
                line = line[: draw.randrange(len(line))]
            case 2:
                line = bytearray(draw.randbytes(draw.randrange(60)))
            case 3:
                line[:0] = draw.randbytes(draw.randrange(3000))
            case 4:
                line *= 2
            case 5:  # a sound frame that nobody expects
                kind, number = draw.choice([1, 3, 0x81, 0x82, 0x83, 0x99]), draw.choice([0, 1, 2**32 - 1, 30])
                line += messages.frame(kind, number, draw.randbytes(draw.randrange(60)))
        return bytes(line)


@pytest.mark.parametrize("greeted", [pytest.param(True, marks=pytest.mark.slow), False])
def test_a_thousand_noisy_conversations_end_well_or_in_one_sentence(greeted: bool) -> None:
    ended: dict[str, int] = {}
    begun = time.perf_counter()
    for seed in range(1000):
        noise = Noise(seed, 0.08 if greeted else 0.5)
        noise.on = not greeted
        port = Direct(Tiny(), noise, noise)
        try:
            hardware = SerialHardware(port, lock_step=True, timeout=0.003, greeting=0.003)
            noise.on = greeted
            rows = over_the_line(hardware, 30)
            assert len(rows) == 30
            found = hardware.statistics
            assert found.samples == 30
            if found == (30, 0, 0, 0, 0, 0, 0, 0):
                assert rows == straight(Tiny(), 30)
            hardware.close()
            ended["well"] = ended.get("well", 0) + 1
        except (LineLostError, InputError) as error:
            assert "\n" not in str(error)
            assert str(error).startswith("memory: ")
            ended[type(error).__name__] = ended.get(type(error).__name__, 0) + 1
    assert ended["LineLostError"] > 50
    assert ended["well"] > 20
    assert time.perf_counter() - begun < 60.0  # 1000 conversations that each may time out a few times


def test_noise_without_end_is_a_lost_line() -> None:
    line, other = os.openpty()
    tty.setraw(other)
    stopped = threading.Event()

    def babble() -> None:
        draw = random.Random(7)
        os.set_blocking(line, False)
        while not stopped.is_set():
            try:
                os.write(line, draw.randbytes(500))
            except BlockingIOError:
                time.sleep(0.001)

    thread = threading.Thread(target=babble)
    thread.start()
    try:
        with pytest.raises(
            LineLostError, match=r"no device answered within 0\.3 s; \d+ bytes came that are no message"
        ):
            SerialHardware(os.ttyname(other), greeting=0.3)
    finally:
        stopped.set()
        thread.join()
        os.close(line)
        os.close(other)


T = 1e-3


def frame(k: int, flags: int = 0) -> SampleMessage:
    return SampleMessage(k, 0, 0, flags, 0, (k,))


def after(start: int, times: list[float], patience: int = 2) -> Arrivals:
    arrivals = Arrivals(T, False, patience)
    for k, at in enumerate(times, start):
        arrivals.put(at, frame(k))
    return arrivals


def test_lateness_follows_the_clock_of_the_device_but_no_hiccup() -> None:
    # A device whose clock is slow by half of what is allowed: after 10000 samples it is half a period behind.
    arrivals, worst = Arrivals(T, False, 2), 0.0
    for k in range(10_000):
        arrivals.put(k * T * (1.0 + 0.5 * DRIFT), frame(k))
        taken = arrivals.take(k)
        assert taken is not None
        worst = max(worst, taken.lateness)
    assert worst <= DRIFT * T
    assert arrivals.late == 0
    arrivals.put(10_000 * T * (1.0 + 0.5 * DRIFT) + 3.0 * T, frame(10_000))
    hiccup = arrivals.take(10_000)
    assert hiccup is not None
    assert hiccup.lateness == pytest.approx(3.0 * T, abs=DRIFT * T)
    assert arrivals.late == 1


def test_lateness_is_that_of_the_first_sample_until_one_comes_earlier() -> None:
    arrivals = after(0, [0.5 * T, T, 2.0 * T, 3.2 * T])  # the first was half a period late
    late = [taken.lateness for k in range(4) if (taken := arrivals.take(k))]
    assert late == pytest.approx([0.0, 0.0, 0.0, 0.2 * T], abs=1e-12)


def test_a_gap_is_taken_sample_by_sample_or_ends_the_run_at_once() -> None:
    arrivals = after(0, [0.0])
    assert arrivals.take(0) == ReceivedSample(frame(0), 0.0)
    assert arrivals.take(1) is None
    arrivals.put(3.0 * T, frame(3))
    assert [arrivals.take(k).message for k in (1, 2, 3)] == [None, None, frame(3)]
    assert arrivals.lost == 2
    arrivals.put(7.0 * T, frame(7))
    with pytest.raises(EndedError, match="3 samples are missing before sample 7"):
        arrivals.take(4)


def test_damage_is_taken_for_the_sample_that_is_due_but_noise_is_not() -> None:
    arrivals = after(0, [0.0])
    arrivals.take(0)
    assert arrivals.given_up(1) is None
    arrivals.damage(0.1 * T)  # noise, long before the next sample
    assert arrivals.given_up(1) == pytest.approx((1.0 + GRACE) * T)
    arrivals.put(1.0 * T, frame(1))
    assert arrivals.take(1) == ReceivedSample(frame(1), pytest.approx(0.0))
    assert arrivals.given_up(2) is None
    arrivals.damage(2.0 * T)
    given_up = arrivals.given_up(2)
    assert given_up == pytest.approx((2.0 + GRACE) * T)
    assert arrivals.without(2, given_up).lateness == pytest.approx(GRACE * T)
    # Where it comes after all, it is dropped, and nothing else is lost for it.
    arrivals.put(2.5 * T, frame(2))
    arrivals.put(3.0 * T, frame(3))
    assert arrivals.take(3) == ReceivedSample(frame(3), pytest.approx(0.0))
    assert (arrivals.lost, arrivals.late, arrivals.repeated) == (1, 1, 0)


def test_the_first_sample_has_nothing_to_repeat() -> None:
    with pytest.raises(EndedError, match="the first sample is missing"):
        after(1, [T]).take(0)


def test_the_protocol_is_documented_where_the_firmware_is() -> None:
    text = (Path(__file__).parents[2] / "firmware" / "README.md").read_text(encoding="utf-8")
    kinds = {"HELLO": 1, "START": 2, "COMMAND": 3, "VENT": 4, "STOP": 5, "WELCOME": 0x81, "SAMPLE": 0x82, "FAULT": 0x83}
    said = [messages.Hello(0, 1), messages.Start(0, 1, 0, 2), messages.CommandMessage(0, 1, 2, True)]
    for name, kind in kinds.items():
        assert f"`{kind:02X}` | {name}" in text
    for message in said:  # of fixed length: 10 bytes of frame, and what the table says
        size = len(messages.decoded(messages.encode(message)[:-1]) or b"") - messages.SHORTEST
        name = type(message).__name__.removesuffix("Message").upper()
        assert f"| {name} | {size} |" in text
    for message in (messages.Hello(1, 1), messages.CommandMessage(7, 100, 2048, True), messages.Vent(0)):
        assert f"`{messages.encode(message).hex(' ').upper()}`" in text
