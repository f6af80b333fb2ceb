"""Readings of a machine at rest, for its calibration."""

from __future__ import annotations

import math
import threading
from collections.abc import Mapping
from typing import Any

import numpy as np

from ...errors import InputError, LineLostError
from ..hardware.converters import SPAN, Converters
from ..hardware.interface import Hardware
from ..sensors import SENSORS
from .sources import PERIOD, ChannelScale

PATIENCE = 5.0  # beyond the time that the samples take [s]


class HardwareReadings:
    """A machine, vented and without motor force, sampled continuously in a thread.

    It is sampled between the readings too, since a machine that is told nothing takes its line for lost. The encoder is
    zeroed once, at the beginning. To be used in a ``with``.
    """

    def __init__(
        self,
        hardware: Hardware,
        converters: Converters,
        *,
        period: float = PERIOD,
        scales: Mapping[str, ChannelScale] | None = None,
    ) -> None:
        """Prepare the readings of a machine that is not started yet, with the scales of its counts.

        Args:
            hardware: the machine.
            converters: as `Rig.converters` has them; a calibration in there is not looked at.
            period: period of the samples [s].
            scales: as `grids` of the rig has them, with what the transducers see; else only the converters' ends are known.
        """
        self.period, self._hardware = period, hardware
        self._scales = dict(converters.analog)
        self._encoder = converters.encoder if hardware.has_encoder else None
        self._rest = 0 if converters.motor is None else int(converters.motor.count(0.0))
        missing = [n for n in self._scales if n not in hardware.names]
        if missing:
            raise InputError("channels", ", ".join(missing), "the machine has", known=hardware.names)
        self.grids = {
            n: ChannelScale(float(s.low), float(s.top), float(s.resolution), SENSORS[n].unit if n in SENSORS else "1")
            for n, s in self._scales.items()
        }
        if self._encoder is not None:
            self.grids[SPAN] = ChannelScale(-math.inf, math.inf, float(self._encoder.resolution), "m")
        self.grids |= {n: one for n, one in (scales or {}).items() if n in self.grids}
        self._news = threading.Condition()
        self._wanted, self._request, self._ended = 0, 0, False
        self._rows: list[tuple[tuple[int, ...], int]] = []
        self._error: Exception | None = None
        self._thread = threading.Thread(target=self._sample, name="calibration", daemon=True)

    def __enter__(self) -> HardwareReadings:
        self._hardware.start(self.period)
        self._hardware.vent()
        self._thread.start()
        return self

    def __exit__(self, *_: Any) -> None:
        with self._news:
            self._ended = True
        self._thread.join(PATIENCE)
        self._hardware.close()

    def read(self, samples: int) -> dict[str, np.ndarray]:
        """Return the next samples.

        Raises:
            LineLostError: if the machine does not give them.
        """
        with self._news:
            self._rows, self._wanted, self._request = [], samples, self._request + 1
            self._news.wait_for(
                lambda: not self._wanted or self._error is not None, samples * self.period * 2.0 + PATIENCE
            )
            if self._error is not None:
                raise LineLostError(str(self._error)) from self._error
            if self._wanted:
                raise LineLostError(f"machine: {len(self._rows)} of {samples} samples came in time")
            rows = self._rows
        names = self._hardware.names
        counts = np.array([row for row, _ in rows], float).reshape(samples, len(names))
        readings = {n: np.asarray(s.value(counts[:, names.index(n)])) for n, s in self._scales.items()}
        if self._encoder is not None:
            readings[SPAN] = np.asarray(self._encoder.span(np.array([c for _, c in rows], float), 0.0))
        return readings

    def _sample(self) -> None:
        machine, k = self._hardware, 0
        try:
            while not self._ended:
                request = self._request  # a sample that was taken before the request does not count
                machine.wait(k)
                k += 1
                counts, edges = tuple(int(c) for c in machine.counts), machine.edges
                machine.write(0, self._rest)
                with self._news:
                    if self._wanted and request == self._request:
                        self._rows.append((counts, edges))
                        self._wanted -= 1
                        if not self._wanted:
                            self._news.notify_all()
        except Exception as error:
            with self._news:
                self._error = error
                self._news.notify_all()
