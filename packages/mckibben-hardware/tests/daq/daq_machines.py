"""Small machines in whole numbers, whose next counts depend on every count before."""

from mckibben_hardware.daq import Analog, CardWiring, Counter, Drive, ShutOff

LARGE = 1 << 31


class Mixer:
    """A nonlinear machine in integers: whoever loses, repeats or swaps one count gets others ever after."""

    names = ("pressure", "tension", "valve_pressure")

    def __init__(self) -> None:
        self.a, self.b, self.steps = 12345, 67890, 0
        self.log: list[tuple[int, int, bool]] = []

    def sample(self) -> tuple[list[int], int]:
        return [(self.a >> 9) & 0xFFFF, (self.b >> 5) & 0xFFFF, (self.a ^ self.b) & 0xFFF], (self.a % 4001) - 2000

    def advance(self, valve: int, motor: int, opened: bool) -> None:
        self.log.append((valve, motor, opened))
        self.steps += 1
        turn = 7 if opened else 11
        self.a = (self.a * 1103515245 + valve * valve + 12345 * turn) % LARGE
        self.b = (self.b * 69069 + motor * (self.a >> 7) + turn) % LARGE


class Clockwork:
    """Shows the number of its sample, in the first channel and by the encoder."""

    names = ("pressure",)

    def __init__(self) -> None:
        self.steps = 0

    def sample(self) -> tuple[list[int], int]:
        return [self.steps % 65536], self.steps

    def advance(self, valve: int, motor: int, opened: bool) -> None:
        self.steps += 1


def software(counts: list[int], edges: int, k: int) -> tuple[int, int, bool]:
    """Counts of valve and motor and the shut-off for what was read: every output depends on every input."""
    total = sum((i + 1) * c for i, c in enumerate(counts)) + 3 * edges + k
    return total % 4096, (total * 31) % 65536, total % 5 != 0


def mixer_wiring() -> CardWiring:
    """Scales of several kinds: one way and both ways, 12 and 16 bits, a share of the card's range."""
    return CardWiring(
        inputs={
            "tension": Analog(channel="Dev1/ai3", low=-10.0, high=10.0, bits=16),
            "pressure": Analog(channel="Dev1/ai0", low=0.0, high=10.0, bits=16, range=(-10.0, 10.0)),
            "valve_pressure": Analog(channel="Dev1/ai1", low=0.5, high=4.5, bits=12, terminal="rse"),
        },
        valve=Analog(channel="Dev1/ao0", low=0.0, high=10.0, bits=12),
        motor=Drive(channel="Dev1/ao1", low=-10.0, high=10.0, bits=16, rest=0.0),
        shut_off=ShutOff(line="Dev1/port0/line0", open_at="low"),
        encoder=Counter(counter="Dev1/ctr0", a="/Dev1/PFI8", b="/Dev1/PFI10"),
    )


def clock_wiring() -> CardWiring:
    return CardWiring(
        inputs={"pressure": Analog(channel="Dev1/ai0", low=0.0, high=10.0, bits=16)},
        valve=Analog(channel="Dev1/ao0", low=0.0, high=10.0, bits=12),
        encoder=Counter(counter="Dev1/ctr0"),
    )


def counts_of(machine: Mixer, wiring: CardWiring) -> tuple[list[int], int]:
    """A sample in the order of the wiring, not in that of the machine."""
    counts, edges = machine.sample()
    return [counts[machine.names.index(name)] for name in wiring.inputs], edges


def run(hardware, first: int, count: int) -> list[tuple]:
    """Samples through the border, and what was sent for them."""
    seen = []
    for k in range(first, first + count):
        hardware.wait(k)
        counts, edges = list(hardware.counts), hardware.edges
        valve, motor, opened = software(counts, edges, k)
        seen.append((counts, edges, valve, motor, opened))
        hardware.write(valve, motor, opened=opened)
    return seen


def run_in_process(machine: Mixer, wiring: CardWiring, count: int, zero: int = 0) -> list[tuple]:
    """The same without anything in between."""
    seen = []
    for k in range(count):
        counts, edges = counts_of(machine, wiring)
        valve, motor, opened = software(counts, edges - zero, k)
        seen.append((counts, edges - zero, valve, motor, opened))
        machine.advance(valve, motor, opened)
    return seen
