"""Cycles of the STM32F405, from the instructions that QEMU executes one by one: QEMU itself counts instructions only.

    cycles = sum of (cycles of the instruction + 3 if it jumps) + 12 for each interrupt, and as many at its end

after the table of instructions of the Cortex-M4's technical reference manual, with a pipeline filled anew in 3 cycles and
a division in 12. The larger count adds the 5 wait states of the flash at 168 MHz to every jump, to every 16 bytes that are
fetched and to every constant, as if cache and prefetch never had them. Left out are the functions that the emulator has
in the place of `peripherals.c`: 60 instructions in a sample.
"""

import re
import subprocess
from collections import defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

REFILL, INTERRUPT, WAIT_STATES, LINE = 3, 12, 5, 16
TASKS = {"on_systick": "timer", "on_usart3": "receive", "bench_tick": "sample", "bench_receive": "command"}
INTERRUPTS = ("on_systick", "on_usart3")
TABLE_READER = "frame_crc"  # its loads are from a table in the flash
START = "converter_start"  # of a period
OF_EMULATOR = (
    "__wrap_", "host", "put_", "get_number", "request", "go_on", "converter_", "encoder_latched", "outputs_", "alive_",
    "lamp_", "watchdog_", "sampling_begin", "peripherals_", "wait_for_interrupt",
)  # fmt: skip
Count = dict[str, list[int]]  # by task: instructions, cycles, cycles without cache


class Instruction(NamedTuple):
    """An instruction of a program: its function, whether it is the first there, text, size [bytes] and cycles."""

    function: str
    first: bool
    mnemonic: str
    operands: str
    size: int
    cycles: int

    @property
    def calls(self) -> bool:
        """Whether it calls a function."""
        return self.mnemonic in ("bl", "blx")

    @property
    def returns(self) -> bool:
        """Whether it ends a function, if it jumps."""
        return self.mnemonic.startswith("bx") or (
            self.mnemonic.startswith(("pop", "ldm", "ldr")) and "pc" in self.operands
        )

    @property
    def reads_flash(self) -> bool:
        """Whether it loads a constant from the flash."""
        return self.mnemonic.startswith("ldr") and ("[pc" in self.operands or self.function == TABLE_READER)


def cycles_of(mnemonic: str, operands: str) -> int:
    """Return the cycles of an instruction without a jump and without wait states."""
    if "{" in operands:
        ranges = re.findall(r"r(\d+)-r(\d+)", operands)
        registers = operands[operands.index("{") :].count(",") + 1 + sum(int(b) - int(a) for a, b in ranges)
        return 1 + registers
    if mnemonic.startswith(("ldrd", "strd")):
        return 3
    if mnemonic.startswith(("udiv", "sdiv")):
        return 12
    return 2 if mnemonic.startswith(("ldr", "str", "cps", "mrs", "msr", "tb")) else 1


def program(image: Path) -> dict[int, Instruction]:
    """Return the instruction at each address of a linked program."""
    made = subprocess.run(["arm-none-eabi-objdump", "-d", str(image)], capture_output=True, text=True, check=True)
    instructions, function, first = {}, "", False
    for line in made.stdout.splitlines():
        if head := re.match(r"[0-9a-f]+ <(.+)>:", line):
            function, first = head[1], True
        elif row := re.match(r"\s*([0-9a-f]+):\t([0-9a-f ]+?)\s*\t([^\s;@]+)\s*([^;@]*)", line):
            size, mnemonic = len(row[2].replace(" ", "")) // 2, row[3].removesuffix(".n").removesuffix(".w")
            cycles = cycles_of(mnemonic, row[4])
            instructions[int(row[1], 16)] = Instruction(function, first, mnemonic, row[4], size, cycles)
            first = False
    return instructions


def addresses(log: Path) -> Iterator[int]:
    """Yield the addresses of the instructions of a log of QEMU (``-singlestep -d exec,nochain``)."""
    with open(log, encoding="ascii", errors="replace") as lines:
        for line in lines:
            if line.startswith("Trace"):
                yield int(line.split("/", 2)[1], 16)


def count_periods(instructions: dict[int, Instruction], trace: Iterable[int]) -> list[Count]:
    """Return the counts of the tasks in each whole period of a trace."""
    periods: list[Count] = []
    count: Count = defaultdict(lambda: [0, 0, 0])
    calls: list[tuple[str, int]] = []  # tasks that have begun, and how deep the calls were
    depth, task, begun, before, address = 0, "main", False, None, 0
    for here in trace:
        now = instructions.get(here)
        if now is None:
            continue
        if before is not None:
            interrupted = now.first and now.function in INTERRUPTS
            jumps = here != address + before.size and not interrupted
            line = here // LINE != address // LINE
            ours = begun and not before.function.startswith(OF_EMULATOR)
            if ours:
                row = count[task]
                waits = jumps + (line and not jumps) + before.reads_flash
                row[0] += 1
                row[1] += before.cycles + REFILL * jumps
                row[2] += before.cycles + REFILL * jumps + WAIT_STATES * waits
            depth += before.calls
            if before.returns and (jumps or interrupted):
                depth -= 1
                while calls and depth < calls[-1][1]:
                    ended = calls.pop()[0]
                    if ended in ("timer", "receive"):
                        count[ended][1] += INTERRUPT
                        count[ended][2] += INTERRUPT + WAIT_STATES
            if interrupted:
                depth += 1
                count[TASKS[now.function]][1] += INTERRUPT
                count[TASKS[now.function]][2] += INTERRUPT + WAIT_STATES
        if now.first and now.function in TASKS:
            calls.append((TASKS[now.function], depth))
        if now.first and now.function == START:
            if begun:
                periods.append({name: list(row) for name, row in count.items()})
            count.clear()
            begun = True
        task = calls[-1][0] if calls else "main"
        before, address = now, here
    return periods
