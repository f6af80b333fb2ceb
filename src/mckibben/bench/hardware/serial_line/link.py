"""The host's side of the serial line: a machine behind a microcontroller as `interface.Hardware`.

The device is the clock: it sends a sample every period, and `wait` gives them one after the other. What is lost or damaged
on the way is counted and never made up: the sample is still taken, with the newest reading and `fresh` False. The loop is
over, and the machine told to vent, when more than `patience` samples in a row are missing, when nothing comes for a time,
when the port is gone, and when the device has stopped or vented by itself. That time is one of the device: an emulated board
whose second takes eight of the wall clock may be silent for eight times as long. A real board's second takes one.

Lateness is counted from the first sample on by the clock of the host. The clocks of host and device may differ by 1e-4 of
the time: by so much the time expected of a sample follows those that come later, and at once those that come earlier.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from ....errors import InputError, LineLostError
from ..interface import Hardware
from .line import BITS_PER_SECOND, Arrivals, EndedError, ReceivedSample, SerialLine, fit, greet, places, reason
from .messages import FREE, LOCK_STEP, CommandMessage, Fault, SampleMessage, Start, Stop, Vent, Welcome

SILENT = 3.0  # periods for which nothing may come at least
LONGEST = 2**32 - 1  # period [ns]


class SerialStatistics(NamedTuple):
    """Counts of received, lost and damaged frames of a run.

    Attributes:
        samples: that were taken.
        lost: number of these whose frame did not come, or damaged.
        repeated: frames of samples that had been there, dropped.
        late: frames that came more than a period late; dropped where their sample had been given up.
        bad_checksum: frames with a wrong checksum.
        undecodable: other bytes that are no frame, or none that is known.
        answers_late: samples that the device had no answer to when it took the next one.
        answers_damaged: samples between which the device got damaged frames.
    """

    samples: int
    lost: int
    repeated: int
    late: int
    bad_checksum: int
    undecodable: int
    answers_late: int
    answers_damaged: int


class SerialHardware(Hardware):
    """A machine behind a serial line, whose device was identified and suits.

    Args:
        port: name of a serial port, or an object with `read`, `write`, `close` and `fileno`.
        channels: analogue channels that are needed, in the order wanted; the device may have more. None: those it has.
        bits: bits of the converter of each channel, by name; None: as the device says.
        encoder: whether one is needed.
        motor: whether one is needed.
        lock_step: the device waits for every command, as only a simulated machine can.
        watchdog: periods after its newest command at which the device vents by itself, at least 2. A sample that is lost
            without a trace is known by the next one, so that patience for one needs 3.
        patience: samples in a row that may be missing.
        timeout: time of the device for which nothing may come, or three periods where that is longer [s].
        greeting: time within which the device must answer first [s].
        baud: bits per second of the port.

    Attributes:
        fresh: whether the newest sample was read, not repeated.
        time: time of the newest reading by the device's clock, of any origin [s].
        welcome: identification of the device.

    Raises:
        InputError: if the port cannot be opened, or the device is not the one that is needed.
        LineLostError: if it does not answer.
    """

    def __init__(
        self,
        port: str | Any,
        channels: Sequence[str] | None = None,
        *,
        bits: Mapping[str, int] | None = None,
        encoder: bool = False,
        motor: bool = False,
        lock_step: bool = False,
        watchdog: int = 3,
        patience: int = 2,
        timeout: float = 1.0,
        greeting: float = 5.0,
        baud: int = BITS_PER_SECOND,
    ) -> None:
        if not 2 <= watchdog < 2**16:
            raise InputError("watchdog", watchdog, "must be a number of samples from 2 to 65535")
        self.lock_step, self.watchdog, self.patience, self.timeout = lock_step, watchdog, patience, timeout
        self._line = SerialLine(port, baud)
        self.name = self._line.name
        try:
            self.welcome: Welcome = greet(self._line, greeting)
            fit(self.welcome, self.name, bits=bits or {}, encoder=encoder, motor=motor)
            names = self.welcome.names if channels is None else tuple(channels)
            self._places = places(self.welcome, names, self.name)
        except BaseException:
            self._line.close()
            raise
        super().__init__(
            names, encoder=self.welcome.encoder, motor=self.welcome.motor, motor_rest=self.welcome.motor_rest
        )
        self._run = int.from_bytes(os.urandom(2), "little")
        self._lost_by: str | None = None
        self._closed = False
        self._forget(0.0)

    @property
    def statistics(self) -> SerialStatistics:
        """Statistics of the latest run."""
        line, of, (bad, other) = self._line, self._arrivals, self._before
        return SerialStatistics(
            self._taken,
            of.lost,
            of.repeated,
            of.late,
            line.frames.bad_checksum - bad,
            line.undecodable - other + self._strange,
            of.answers_late,
            of.answers_damaged,
        )

    def start(self, period: float) -> None:
        """Zero the encoder and begin to sample with a period [s]; sample 0 is the next one.

        Raises:
            InputError: if the device cannot sample with this period.
            LineLostError: if nobody is there.
        """
        self._alive()
        nanoseconds = round(period * 1e9) if 0.0 < period * 1e9 <= LONGEST else 0
        if nanoseconds < max(self.welcome.shortest, 1):
            allowed = f"must be between {self.welcome.shortest * 1e-09:g} s and {LONGEST * 1e-09:.3g} s"
            raise InputError("period", period, allowed, where=self.name)
        self._forget(nanoseconds * 1e-9)
        self._run = (self._run + 1) % 2**16
        self.venting = False
        self._write(Start(self._run, nanoseconds, LOCK_STEP if self.lock_step else FREE, self.watchdog))

    def wait(self, sample: int) -> float:
        """Wait until a sample has arrived, counted from 0; return its lateness [s].

        Raises:
            LineLostError: if it will not come any more; says why.
        """
        self._alive()
        try:
            taken = self._wait(sample)
        except EndedError as error:
            raise self._lose(str(error)) from None
        message = taken.message
        self.fresh = message is not None
        if message is not None:
            counts = message.counts
            self.counts = tuple([counts[i] for i in self._places])
            self.time = message.time * 1e-9
            if self.has_encoder:
                self.edges = message.encoder
        self._sample = sample
        self._taken += 1
        return taken.lateness

    def send(self) -> None:
        """Make the outputs written since the sample take effect.

        Raises:
            LineLostError: if nobody is there to take it.
        """
        self._alive()
        count, opened = (0, True) if self.venting else (self.valve, self.opened)
        self._write(CommandMessage(self._sample, count, self.motor, opened))

    def close(self) -> None:
        """Vent, and release the machine; may be called twice."""
        if not self._closed:
            self.vent()
            with contextlib.suppress(OSError):
                self._line.write(Stop())
            self._closed = True
            self._line.close()

    def _wait(self, sample: int) -> ReceivedSample:
        arrivals = self._arrivals
        silence = max(self.timeout, SILENT * arrivals.period) * arrivals.slowness(self.timeout)
        until, looked = time.perf_counter() + silence, False
        while (taken := arrivals.take(sample)) is None:
            now, given_up = time.perf_counter(), arrivals.given_up(sample)
            if given_up is not None and now >= given_up:
                return arrivals.without(sample, now)
            if looked:
                raise EndedError(f"nothing came for {silence:.3g} s at sample {sample}")
            looked = now >= until  # once more, for it may have been this computer that paused
            self._receive(max((until if given_up is None else min(given_up, until)) - now, 0.0))
        return taken

    def _receive(self, seconds: float) -> None:
        """Process the messages that have arrived, or that arrive within a time [s]."""
        before = self._line.dropped
        try:
            arrived = self._line.read(seconds)
        except (OSError, EOFError) as error:
            raise EndedError(f"unplugged: {reason(error)}") from None
        now, channels, strange = time.perf_counter(), len(self.welcome.names), self._strange
        for message in arrived:
            if isinstance(message, Fault):
                self._arrivals.put(now, message)
            elif isinstance(message, SampleMessage) and message.run == self._run:  # others are of an earlier run
                if len(message.counts) == channels:
                    self._arrivals.put(now, message)
                else:
                    self._strange += 1
        if self._line.dropped > before or self._strange > strange:
            self._arrivals.damage(now)

    def _forget(self, period: float) -> None:
        """Clear the state of the last run; the next run has a period [s]."""
        self._arrivals = Arrivals(period, self.lock_step, self.patience)
        self._before = (self._line.frames.bad_checksum, self._line.undecodable)
        self._taken = self._strange = 0  # samples; frames with another number of channels
        self._sample = 0
        self.fresh, self.time = False, 0.0

    def _alive(self) -> None:
        if self._lost_by is not None or self._closed:
            raise LineLostError(self._lost_by or f"{self.name}: it was closed")

    def _lose(self, problem: str) -> LineLostError:
        """Vent if possible, and return the error of the lost connection."""
        if self._lost_by is None:
            action = "it was told to vent" if self._vent_now() else "it could not be told to vent, and must by itself"
            self._lost_by = f"{self.name}: {problem}; {action}"
        return LineLostError(self._lost_by)

    def _vent_now(self) -> bool:
        """Tell the machine to vent, if it can be reached."""
        with contextlib.suppress(OSError):
            if not self._closed:
                self._line.write(Vent(), before=b"\0")
                return True
        return False

    def _write(self, message: Start | CommandMessage) -> None:
        try:
            self._line.write(message)
        except OSError as error:
            raise self._lose(f"unplugged: {reason(error)}") from None
