"""Machines of whole numbers that tests put behind a serial line, and loops that drive them."""

from typing import Any

PERIOD = 1e-3
Row = tuple[tuple[int, ...], int, tuple[int, int, bool]]


class Tiny:
    """Channels whose counts are a nonlinear function of all commands so far: a wrong one at any sample changes the rest."""

    def __init__(self, channels: int = 8, fails_at: int | None = None) -> None:
        self.names = tuple(f"channel.{i}" for i in range(channels))
        self.bits = (12,) * channels
        self.period = 0.0
        self.state, self.edges, self.fails_at = 12345, 0, fails_at
        self.history: list[tuple[int, int, bool]] = []  # commands of each period

    def sample(self) -> tuple[list[int], int]:
        if self.fails_at is not None and len(self.history) >= self.fails_at:
            raise RuntimeError("the physics failed")
        return [(self.state >> (3 * i)) % 4096 for i in range(len(self.names))], self.edges

    def advance(self, valve: int, motor: int, opened: bool) -> None:
        self.history.append((valve, motor, opened))
        mixed = self.state ^ (valve * 2654435761) ^ (motor << 13) ^ (0x5BD1E995 if opened else 0)
        self.state = (mixed * mixed + 6364136223846793005 * self.state + 1442695040888963407) % 2**64
        self.edges = self.edges + self.state % 2001 - 1000


def controller(sample: int, counts: Any, encoder: int) -> tuple[int, int, bool]:
    """Commands that depend on everything that was read."""
    total = sum((i + 1) * int(count) for i, count in enumerate(counts))
    return (total * total + sample) % 4096, (total ^ abs(encoder)) % 65536, (total + encoder) % 7 != 0


def straight(machine: Any, samples: int) -> list[Row]:
    """What a loop in the same process sees and says."""
    rows = []
    for k in range(samples):
        counts, encoder = machine.sample()
        command = controller(k, counts, encoder)
        rows.append((tuple(counts), encoder, command))
        machine.advance(*command)
    return rows


def step(hardware: Any, sample: int) -> tuple[float, Row]:
    """One sample of a loop at the hardware border."""
    late = hardware.wait(sample)
    counts, encoder = tuple(hardware.counts), hardware.edges
    command = controller(sample, counts, encoder)
    hardware.write(command[0], command[1], opened=command[2])
    return late, (counts, encoder, command)


def over_the_line(hardware: Any, samples: int, period: float = PERIOD) -> list[Row]:
    """What a loop at the hardware border sees and says."""
    hardware.start(period)
    return [step(hardware, k)[1] for k in range(samples)]
