"""Protocol of the serial line: framing with checksums, and the content of each message.

Protocol version 1. Every number is little endian; `u16` is an unsigned and `i32` a signed number of so many bits; a text is
its length in bytes (u8) and that many bytes of UTF-8.

    frame  =  COBS(body) 00
    body   =  kind u8 | sequence u32 | payload | CRC-32 u32 of all before it

COBS (S. Cheshire and M. Baker, IEEE/ACM Trans. Networking 7(2), 1999, doi:10.1109/90.769765) takes the zeros out of the
body, so that a zero byte ends a frame and nothing else: after damage or from the middle of a stream, the next zero is a
new beginning. CRC-32 is that of IEEE 802.3 (polynomial 04C11DB7, reflected, begun and ended with FFFFFFFF), as in zlib. A
body has at most 1024 bytes. Empty frames are allowed and mean nothing: a sender may put a zero first. Whatever is damaged,
too long, of an unknown kind or of another length than its kind has is dropped and counted, on both sides.

Host to device:

    01 HELLO    any number    version u16 of the protocol
    02 START    run           period u32 [ns], mode u8 (0 free, 1 lock-step), watchdog u16 [samples]
    03 COMMAND  sample        valve u32, motor u32, flags u8 (1: the shut-off is open)
    04 VENT     any number    nothing
    05 STOP     any number    nothing

Device to host:

    81 WELCOME  that of HELLO version u16, shortest period u32 [ns], flags u8 (1: an encoder, 2: a motor), count of the motor
                              at rest u32, channels u8, bits u8 of each, firmware text, name text of each
    82 SAMPLE   sample        run u16, time u64 [ns], flags u8 (1 vented, 2 by itself, 4 unanswered, 8 damaged),
                              encoder i32, count u32 of each channel
    83 FAULT    sample        code u8 (1 version, 2 refused, 3 hardware, 4 end), text

What the device does:

* HELLO: vents, stops, and answers WELCOME, also to a version that is not its own; then START is refused with FAULT.
* START: sets its outputs to rest (valve 0, shut-off open, motor at rest), zeroes the encoder, and samples. Every SAMPLE
  carries the lower 16 bits of the START's sequence, so that those of an earlier run are told apart. Samples count from 0;
  a run ends before 2^32. A period below the shortest, an unknown mode, or a watchdog below 2 when free is refused.
* COMMAND answers a sample that was sent, and one newer than the command before it did; others are ignored. Its outputs take
  effect at once and are held.
* Free: the device's timer takes the samples. The watchdog counts them since the newest command that was taken; where that
  is its number, the outputs go to rest until the next START, and every SAMPLE says "vented" and "by itself". So the machine
  is vented within that many periods of the last good command. "unanswered": the sample before had no answer when this one
  was taken. Time is the device's clock, of any origin.
* Lock-step: sample k + 1 is taken one period of the machine after COMMAND k, whenever that comes. There is no watchdog, and
  the time is the sequence times the period: for a simulated machine, not for one under pressure.
* "damaged": since the sample before, a frame came that was dropped.
* VENT: valve 0 and shut-off open at once and until the next START, whatever commands say; sampling goes on, and the motor
  follows its commands. STOP: outputs to rest, no more samples.
* FAULT: outputs to rest, no more samples; says why.
"""

from __future__ import annotations

import struct
import zlib
from typing import NamedTuple

VERSION = 1
LONGEST = 1024  # [B], of a body
LONGEST_CODED = LONGEST + LONGEST // 254 + 1  # [B], of a frame without the zero at its end
_HEAD = struct.Struct("<BI")
_CRC = struct.Struct("<I")
SHORTEST = _HEAD.size + _CRC.size  # [B], of a body


class SerialFrame(NamedTuple):
    """Content of an intact frame."""

    kind: int
    sequence: int
    payload: bytes


def frame(kind: int, sequence: int, payload: bytes = b"") -> bytes:
    """Encode a message body as bytes on the line, with the final zero.

    Raises:
        ValueError: if it is longer than a frame may be.
    """
    body = _HEAD.pack(kind, sequence) + payload
    if len(body) + _CRC.size > LONGEST:
        raise ValueError(f"a frame of {len(body) + _CRC.size} bytes; {LONGEST} are allowed")
    return coded(body + _CRC.pack(zlib.crc32(body))) + b"\0"


def coded(data: bytes) -> bytes:
    """Encode bytes by COBS, without zeros."""
    parts: list[bytes] = []
    for run in data.split(b"\0"):
        whole = len(run) // 254 * 254
        parts += [b"\xff" + run[at : at + 254] for at in range(0, whole, 254)]
        parts += (bytes((len(run) - whole + 1,)), run[whole:])
    return b"".join(parts)


def decoded(data: bytes) -> bytes | None:
    """Invert `coded`; None if the bytes are no output of it."""
    parts: list[bytes] = []
    at, end = 0, len(data)
    while at < end:
        code = data[at]
        following = at + code
        if code == 0 or following > end:
            return None
        parts.append(data[at + 1 : following])
        if code < 255 and following < end:
            parts.append(b"\0")
        at = following
    return b"".join(parts)


class Frames:
    """Decoder of a stream of arbitrary bytes to intact frames; it holds at most one frame, and never raises.

    Attributes:
        bad_checksum: frames whose checksum is another.
        oversized: frames that are longer than any may be.
        undecodable: frames that are no COBS, or too short to be a frame.
    """

    def __init__(self) -> None:
        self.bad_checksum = self.oversized = self.undecodable = 0
        self._begun = bytearray()
        self._skipping = False

    @property
    def damaged(self) -> int:
        """Number of all dropped frames."""
        return self.bad_checksum + self.oversized + self.undecodable

    def feed(self, data: bytes) -> list[SerialFrame]:
        """Return the frames that some bytes complete."""
        *ended, rest = data.split(b"\0")
        frames = []
        for part in ended:
            if not self._skipping and len(self._begun) + len(part) <= LONGEST_CODED:
                one = self._frame(bytes(self._begun) + part if self._begun else part)
                if one is not None:
                    frames.append(one)
            elif not self._skipping:
                self.oversized += 1
            self._begun.clear()
            self._skipping = False
        if self._skipping or not rest:
            return frames
        if len(self._begun) + len(rest) > LONGEST_CODED:
            self.oversized += 1
            self._begun.clear()
            self._skipping = True
        else:
            self._begun += rest
        return frames

    def _frame(self, data: bytes) -> SerialFrame | None:
        if not data:
            return None
        body = decoded(data)
        if body is None or not SHORTEST <= len(body) <= LONGEST:
            self.undecodable += 1
            return None
        content = body[: -_CRC.size]
        if zlib.crc32(content) != _CRC.unpack_from(body, len(content))[0]:
            self.bad_checksum += 1
            return None
        kind, sequence = _HEAD.unpack_from(content)
        return SerialFrame(kind, sequence, content[_HEAD.size :])


FREE, LOCK_STEP = 0, 1  # modes of START
OPEN = 1  # flag of COMMAND
ENCODER, MOTOR = 1, 2  # flags of WELCOME
VENTED, BY_ITSELF, UNANSWERED, DAMAGED = 1, 2, 4, 8  # flags of SAMPLE
WRONG_VERSION, REFUSED, HARDWARE, END = 1, 2, 3, 4  # codes of FAULT

_HELLO = struct.Struct("<H")
_START = struct.Struct("<IBH")
_COMMAND = struct.Struct("<IIB")
_WELCOME = struct.Struct("<HIBIB")
_SAMPLE = struct.Struct("<HQBi")
_COUNT = 4  # [B]


class Hello(NamedTuple):
    """Greeting of the host, with its version of the protocol."""

    sequence: int
    version: int


class Start(NamedTuple):
    """Begin a run with a number, a period [ns], a mode, and a watchdog [samples]."""

    run: int
    period: int
    mode: int
    watchdog: int


class CommandMessage(NamedTuple):
    """Counts of the outputs in reply to a sample, and whether the shut-off is open."""

    sequence: int
    valve: int
    motor: int
    opened: bool


class Vent(NamedTuple):
    """Command to close the valve and open the shut-off at once."""

    sequence: int = 0


class Stop(NamedTuple):
    """Command to set the outputs to rest and end sampling."""

    sequence: int = 0


class Welcome(NamedTuple):
    """Identification of the device; `shortest` period [ns], `motor_rest` the count of a motor at rest."""

    sequence: int
    version: int
    shortest: int
    encoder: bool
    motor: bool
    motor_rest: int
    bits: tuple[int, ...]
    firmware: str
    names: tuple[str, ...]


class SampleMessage(NamedTuple):
    """Counts of a sample; `time` by the device [ns], `run` the lower 16 bits of the run's number."""

    sequence: int
    run: int
    time: int
    flags: int
    encoder: int
    counts: tuple[int, ...]


class Fault(NamedTuple):
    """The device has stopped, and the reason."""

    sequence: int
    code: int
    text: str


Message = Hello | Start | CommandMessage | Vent | Stop | Welcome | SampleMessage | Fault


def encode(message: Message) -> bytes:
    """Encode a message as a frame.

    Raises:
        ValueError, struct.error: if it does not fit into one.
    """
    match message:
        case CommandMessage(sequence, valve, motor, opened):
            return frame(0x03, sequence, _COMMAND.pack(valve, motor, OPEN if opened else 0))
        case SampleMessage(sequence, run, time, flags, encoder, counts):
            payload = _SAMPLE.pack(run, time, flags, encoder) + struct.pack(f"<{len(counts)}I", *counts)
            return frame(0x82, sequence, payload)
        case Hello(sequence, version):
            return frame(0x01, sequence, _HELLO.pack(version))
        case Start(run, period, mode, watchdog):
            return frame(0x02, run, _START.pack(period, mode, watchdog))
        case Vent(sequence):
            return frame(0x04, sequence)
        case Stop(sequence):
            return frame(0x05, sequence)
        case Welcome():
            flags = (ENCODER if message.encoder else 0) | (MOTOR if message.motor else 0)
            has = message.version, message.shortest, flags, message.motor_rest, len(message.names)
            texts = b"".join(_text(text) for text in (message.firmware, *message.names))
            return frame(0x81, message.sequence, _WELCOME.pack(*has) + bytes(message.bits) + texts)
        case Fault(sequence, code, text):
            return frame(0x83, sequence, bytes((code,)) + _text(text))


def message_of(frame: SerialFrame) -> Message | None:
    """Decode the message of a frame; None for an unknown kind or a wrong length."""
    kind, sequence, payload = frame
    size = len(payload)
    if kind == 0x82:
        many = size - _SAMPLE.size
        if many < 0 or many % _COUNT:
            return None
        counts = struct.unpack_from(f"<{many // _COUNT}I", payload, _SAMPLE.size)
        run, time, flags, encoder = _SAMPLE.unpack_from(payload)
        return SampleMessage(sequence, run, time, flags, encoder, counts)
    if kind == 0x03 and size == _COMMAND.size:
        valve, motor, flags = _COMMAND.unpack(payload)
        return CommandMessage(sequence, valve, motor, bool(flags & OPEN))
    if kind == 0x01 and size == _HELLO.size:
        return Hello(sequence, *_HELLO.unpack(payload))
    if kind == 0x02 and size == _START.size:
        return Start(sequence, *_START.unpack(payload))
    if kind in (0x04, 0x05) and not payload:
        return Vent(sequence) if kind == 0x04 else Stop(sequence)
    if kind == 0x81:
        return _welcomed(sequence, payload)
    if kind == 0x83 and size >= 2 and size == 2 + payload[1]:
        return Fault(sequence, payload[0], payload[2:].decode("utf-8", "replace"))
    return None


def _welcomed(sequence: int, payload: bytes) -> Welcome | None:
    """Decode the identification; of an unknown version only the version number."""
    if len(payload) < _HELLO.size:
        return None
    (version,) = _HELLO.unpack_from(payload)
    if version != VERSION:
        return Welcome(sequence, version, 0, False, False, 0, (), "", ())
    if len(payload) < _WELCOME.size:
        return None
    _, shortest, flags, motor_rest, channels = _WELCOME.unpack_from(payload)
    at = _WELCOME.size + channels
    texts: list[str] = []
    while at < len(payload):
        end = at + 1 + payload[at]
        texts.append(payload[at + 1 : end].decode("utf-8", "replace"))
        at = end
    if at != len(payload) or len(texts) != channels + 1:
        return None
    bits = tuple(payload[_WELCOME.size : _WELCOME.size + channels])
    encoder, motor = bool(flags & ENCODER), bool(flags & MOTOR)
    return Welcome(sequence, version, shortest, encoder, motor, motor_rest, bits, texts[0], tuple(texts[1:]))


def _text(text: str) -> bytes:
    data = text.encode()
    return bytes((len(data),)) + data
