"""The messages of the serial line as tuples; `frames` says what each of them means."""

from __future__ import annotations

import struct
from typing import NamedTuple

from . import frames
from .frames import SerialFrame

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
    """The host is there, and speaks a version of the protocol."""

    sequence: int
    version: int


class Start(NamedTuple):
    """Begin a run with a number, a period [ns], a mode, and a watchdog [samples]."""

    run: int
    period: int
    mode: int
    watchdog: int


class CommandMessage(NamedTuple):
    """Counts of the outputs in answer to a sample, and whether the shut-off is open."""

    sequence: int
    valve: int
    motor: int
    opened: bool


class Vent(NamedTuple):
    """Valve to zero and shut-off open, at once."""

    sequence: int = 0


class Stop(NamedTuple):
    """Outputs to rest, and no more samples."""

    sequence: int = 0


class Welcome(NamedTuple):
    """What the device is; `shortest` period [ns], `motor_rest` the count at which the motor does nothing."""

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
    """The device has stopped, and why."""

    sequence: int
    code: int
    text: str


Message = Hello | Start | CommandMessage | Vent | Stop | Welcome | SampleMessage | Fault


def encode(message: Message) -> bytes:
    """The frame of a message.

    Raises:
        ValueError, struct.error: if it does not fit into one.
    """
    match message:
        case CommandMessage(sequence, valve, motor, opened):
            return frames.frame(0x03, sequence, _COMMAND.pack(valve, motor, OPEN if opened else 0))
        case SampleMessage(sequence, run, time, flags, encoder, counts):
            payload = _SAMPLE.pack(run, time, flags, encoder) + struct.pack(f"<{len(counts)}I", *counts)
            return frames.frame(0x82, sequence, payload)
        case Hello(sequence, version):
            return frames.frame(0x01, sequence, _HELLO.pack(version))
        case Start(run, period, mode, watchdog):
            return frames.frame(0x02, run, _START.pack(period, mode, watchdog))
        case Vent(sequence):
            return frames.frame(0x04, sequence)
        case Stop(sequence):
            return frames.frame(0x05, sequence)
        case Welcome():
            return frames.frame(0x81, message.sequence, _welcome(message))
        case Fault(sequence, code, text):
            return frames.frame(0x83, sequence, bytes((code,)) + _text(text))


def message_of(frame: SerialFrame) -> Message | None:
    """The message of a frame, or None of an unknown kind or another length than its kind has."""
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


def _welcome(message: Welcome) -> bytes:
    flags = (ENCODER if message.encoder else 0) | (MOTOR if message.motor else 0)
    head = _WELCOME.pack(message.version, message.shortest, flags, message.motor_rest, len(message.names))
    return head + bytes(message.bits) + b"".join(_text(text) for text in (message.firmware, *message.names))


def _welcomed(sequence: int, payload: bytes) -> Welcome | None:
    """Of a version that is not ours, only the version."""
    if len(payload) < _HELLO.size:
        return None
    (version,) = _HELLO.unpack_from(payload)
    if version != frames.VERSION:
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
