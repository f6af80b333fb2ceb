"""Frames are themselves after the line, damage is noticed, and the firmware writes and reads the same bytes."""

import random
import tracemalloc
import zlib

import pytest
from hypothesis import given
from hypothesis import strategies as st
from serial_devices import Codec

from mckibben_hardware.serial_line import messages
from mckibben_hardware.serial_line.messages import LONGEST, LONGEST_CODED, Frames, SerialFrame, coded, decoded, frame

# Zeros and runs of 254 and more are where COBS has its cases.
BYTES = st.binary(max_size=60) | st.lists(
    st.sampled_from([b"\0", b"\1", b"\xff", b"a" * 253, b"b" * 254, b"c" * 255]), max_size=6
).map(b"".join)
WORD = st.integers(0, 2**32 - 1)
TEXT = st.text(max_size=20)
PAYLOADS = BYTES.filter(lambda data: len(data) <= LONGEST - messages.SHORTEST)


def counts(reader: Frames) -> tuple[int, int, int]:
    return reader.bad_checksum, reader.oversized, reader.undecodable


@given(BYTES)
def test_cobs_has_no_zero_and_comes_back(data: bytes) -> None:
    code = coded(data)
    assert 0 not in code
    assert len(code) <= len(data) + len(data) // 254 + 1
    assert decoded(code) == data


@pytest.mark.parametrize(
    ("data", "code"),
    [
        # The examples of the paper's authors, as they are known from its implementations.
        ("00", "0101"),
        ("0000", "010101"),
        ("00110000", "0102110101"),
        ("11220033", "0311220233"),
        ("11223344", "0511223344"),
        ("11000000", "0211010101"),
    ],
)
def test_cobs_is_that_of_cheshire_and_baker(data: str, code: str) -> None:
    assert coded(bytes.fromhex(data)) == bytes.fromhex(code)


@given(st.integers(0, 255), WORD, PAYLOADS, st.integers(1, 40))
def test_a_frame_comes_back_in_whatever_parts_it_comes(kind: int, number: int, payload: bytes, part: int) -> None:
    line = frame(kind, number, payload) + frame(kind, number, payload)
    reader = Frames()
    found = [one for at in range(0, len(line), part) for one in reader.feed(line[at : at + part])]
    assert found == [SerialFrame(kind, number, payload)] * 2
    assert reader.damaged == 0


MESSAGES = st.one_of(
    st.builds(messages.Hello, WORD, st.integers(0, 65535)),
    st.builds(messages.Start, WORD, WORD, st.integers(0, 255), st.integers(0, 65535)),
    st.builds(messages.CommandMessage, WORD, WORD, WORD, st.booleans()),
    st.builds(messages.Vent, WORD),
    st.builds(messages.Stop, WORD),
    st.builds(
        messages.SampleMessage, WORD, st.integers(0, 65535), st.integers(0, 2**64 - 1), st.integers(0, 15),
        st.integers(-(2**31), 2**31 - 1), st.lists(WORD, max_size=32).map(tuple),
    ),
    st.builds(messages.Fault, WORD, st.integers(0, 255), TEXT),
    st.lists(st.tuples(st.integers(2, 32), TEXT), max_size=8).flatmap(
        lambda channels: st.builds(
            messages.Welcome, WORD, st.just(messages.VERSION), WORD, st.booleans(), st.booleans(), WORD,
            st.just(tuple(bits for bits, _ in channels)), TEXT, st.just(tuple(name for _, name in channels)),
        )
    ),
)  # fmt: skip


@given(MESSAGES)
def test_a_message_comes_back(message: messages.Message) -> None:
    (found,) = Frames().feed(messages.encode(message))
    assert messages.message_of(found) == message


@given(st.integers(0, 255), st.binary(max_size=40))
def test_no_payload_is_more_than_no_message(kind: int, payload: bytes) -> None:
    message = messages.message_of(SerialFrame(kind, 1, payload))
    # What is understood says all that was there: the same again, but for flags and texts that mean nothing.
    assert message is None or messages.message_of(Frames().feed(messages.encode(message))[0]) == message


def test_a_body_longer_than_allowed_is_not_written() -> None:
    assert frame(1, 1, bytes(LONGEST - messages.SHORTEST))
    with pytest.raises(ValueError, match="1024"):
        frame(1, 1, bytes(LONGEST - messages.SHORTEST + 1))


def test_every_flipped_bit_is_noticed_and_the_next_frame_is_sound() -> None:
    # A bit of the line may end a frame early, or join two: then both are lost. Never is another frame made of it.
    good = messages.encode(messages.SampleMessage(7, 5, 10**12, 0, -3, (0, 4095, 17, 0)))
    after = messages.encode(messages.CommandMessage(8, 1, 2, True))
    sound, following = Frames().feed(good)[0], Frames().feed(after)[0]
    for bit in range(8 * len(good)):
        line = bytearray(good)
        line[bit // 8] ^= 1 << bit % 8
        reader = Frames()
        found = reader.feed(bytes(line) + after + after)
        assert sound not in found
        assert found[-1] == following
        assert set(found) == {following}
        assert reader.damaged >= 1


def test_nothing_that_comes_makes_the_decoder_grow_or_fail() -> None:
    draw, reader = random.Random(1), Frames()
    tracemalloc.start()
    for _ in range(500):
        reader.feed(draw.randbytes(4096).replace(b"\0", b"\1"))
    size, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 50_000  # a few of the parts of 4096 B that it was fed, of 2 MB in all
    assert size < 10_000
    assert counts(reader) == (0, 1, 0)
    assert reader.feed(b"\0" + frame(1, 2)) == [SerialFrame(1, 2, b"")]


def spoiled(draw: random.Random) -> bytes:
    """A stream of sound, damaged, cut, long and random frames."""
    stream = b""
    for _ in range(draw.randrange(1, 8)):
        one = bytearray(frame(draw.randrange(256), draw.randrange(2**32), draw.randbytes(draw.randrange(40))))
        match draw.randrange(7):
            case 0:
                one[draw.randrange(len(one))] ^= 1 << draw.randrange(8)
            case 1:
                one = one[: draw.randrange(len(one))]
            case 2:
                one = bytearray(draw.randbytes(draw.randrange(300)))
            case 3:
                # At the limits of what is allowed.
                one = bytearray(coded(draw.randbytes(draw.randrange(LONGEST - 8, LONGEST + 9)))) + b"\0"
            case 4:
                one = bytearray(b"\2" * draw.randrange(LONGEST_CODED - 2, LONGEST_CODED + 3)) + b"\0"
        stream += one
    return stream


def test_the_firmware_decodes_any_stream_as_python_does(codec: Codec) -> None:
    draw = random.Random(2)
    kinds = [0, 0, 0]
    sound = 0
    for _ in range(3000):
        stream = spoiled(draw)
        cuts = sorted(draw.randrange(len(stream) + 1) for _ in range(draw.randrange(4)))
        parts = [stream[a:b] for a, b in zip([0, *cuts], [*cuts, len(stream)], strict=True)]
        reader = Frames()
        found = [one for part in parts for one in reader.feed(part)]
        assert codec.decode(parts) == (found, counts(reader))
        kinds = [a + b for a, b in zip(kinds, counts(reader), strict=True)]
        sound += len(found)
    assert min(kinds) > 100  # every reason was there, and sound frames among them
    assert sound > 1000


@given(st.integers(0, 255), WORD, PAYLOADS)
def test_the_firmware_writes_the_same_bytes(codec: Codec, kind: int, number: int, payload: bytes) -> None:
    assert codec.frame(kind, number, payload) == frame(kind, number, payload)


@given(BYTES)
def test_the_firmware_has_the_same_cobs_and_checksum(codec: Codec, data: bytes) -> None:
    assert codec.coded(data) == coded(data)
    assert codec.decoded(data) == decoded(data)
    assert codec.crc(data) == zlib.crc32(data)


def test_the_firmware_refuses_a_payload_that_is_too_long(codec: Codec) -> None:
    assert codec.frame(1, 1, bytes(LONGEST - messages.SHORTEST))
    assert codec.frame(1, 1, bytes(LONGEST - messages.SHORTEST + 1)) == b""
