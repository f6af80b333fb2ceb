"""Time of a step of every controller: in Python, as C on this processor, and on an Uno and an STM32F405 in emulators.

    python benchmarks/controllers.py [--json FILE]

Needs gcc; gcc-avr, avr-libc and libsimavr-dev for the Uno; gcc-arm-none-eabi and qemu-system-arm for the STM32F405. What
is not measured, for want of a tool, is said. Cycles of the Uno are simavr's; those of the STM32F405 are counted from the
instructions that QEMU executes, after the manual's table (`firmware/emulator/cortex_m4.py`), with the flash's cache and, in
brackets, without. Below is what controllers stand on: an inverse, a pressure for a tension, a linear model, a gradient.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

FIRMWARE = Path(__file__).parents[1] / "packages/mckibben-hardware/firmware"
sys.path.insert(0, str(FIRMWARE / "emulator"))

from cortex_m4 import addresses, cycles_of, program  # noqa: E402
from timing import in_turns  # noqa: E402

from mckibben.control import CONTROLLERS, control_task  # noqa: E402
from mckibben.control.inverse import Inverse  # noqa: E402
from mckibben.control.steps import StepControl  # noqa: E402

# Why a controller that is no pure step is on no board.
ON_NO_BOARD = {
    "learning": "on none: 8 KB for R2, computed between its repeats",
    "mpc": "on none: a plan steps the whole simulation in 9 lanes",
    **dict.fromkeys(("published-feedforward", "published-pid", "published-lqi"),
                    "not written: two lookups of 3,000 points, 36 KB"),
}  # fmt: skip
TOOLS = {
    "gcc": ("gcc",),
    "Uno": ("gcc", "avr-gcc", "/usr/include/simavr"),
    "STM32F405": ("arm-none-eabi-gcc", "qemu-system-arm"),
}
STEPS = 3  # of a board
REFILL, SLOW = 3, {"vdiv": 14, "vsqrt": 14, "vfma": 3, "vmla": 3, "vldr": 2, "vstr": 2}  # cycles of a jump, of floats
UNO = ["avr-gcc", "-mmcu=atmega328p", "-DF_CPU=16000000ul", "-Dnearbyintf=lrintf", "-std=gnu99", "-O2"]
ARM = ["arm-none-eabi-gcc", "-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16", "-std=gnu99", "-O2",
       "-ffp-contract=off", "-Wl,--no-warn-rwx-segments"]  # fmt: skip
QUIET = ["-display", "none", "-monitor", "none", "-serial", "none", "-semihosting-config", "enable=on,target=native",
         "-singlestep", "-d", "exec,nochain"]  # fmt: skip
SAMPLE = """
#include "board.h"
static board_state state;
static board_sample sample;
volatile float number __attribute__((used));
static __attribute__((noinline)) void go(int k) {
    static board_outputs outputs;
    sample.wanted = 0.012f + 0.0005f * k;
#ifdef OUTPUT
    sample.output = 0.0121f + 0.0004f * k;
#endif
#ifdef PRESSURE
    sample.pressure = 2.1e5f;
#endif
    board_step(&board_default_parameters, &state, &sample, &outputs);
    number = (float)outputs.number;
}
"""
HOST = """#include <stdio.h>
#include <time.h>
int main(void) {
    struct timespec a, b; int k;
    state = board_default_state;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &a);
    for (k = 0; k < 20000; k++) go(k % 20);
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &b);
    printf("%g\\n", ((b.tv_sec - a.tv_sec) * 1e9 + (b.tv_nsec - a.tv_nsec)) / 20000.0);
    return 0;
}
"""
ON_UNO = """#include <avr/io.h>
#include <avr/sleep.h>
int main(void) { int k; state = board_default_state; for (k = 0; k < COUNT; k++) go(k); sleep_cpu(); return 0; }
"""
# The processor's floats switched on; at the end QEMU is told to end.
ON_ARM = """#include <stdint.h>
extern uint32_t stack_top[], data_from[], data_begin[], data_end[], bss_begin[], bss_end[];
void on_reset(void);
void on_reset(void) {
    uint32_t *to, *from = data_from; int k;
    *(volatile uint32_t *)0xE000ED88u |= 0xFu << 20;
    __asm volatile("dsb\\n isb");
    for (to = data_begin; to != data_end; to++) *to = *from++;
    for (to = bss_begin; to != bss_end; to++) *to = 0;
    state = board_default_state;
    for (k = 0; k < COUNT; k++) go(k);
    __asm volatile("mov r0, #0x18\\n ldr r1, =0x20026\\n bkpt 0xAB");
    for (;;) {}
}
__attribute__((section(".vectors"), used)) static void (*const vectors[16])(void) = {
    (void (*)(void))(uintptr_t)stack_top, on_reset};
"""
# Runs an image until it sleeps, with the stack painted: cycles, a word of its memory, and bytes of the stack.
EMULATOR = """#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sim_avr.h>
#include <sim_elf.h>
int main(int argc, char **argv) {
    elf_firmware_t image; avr_t *avr; unsigned at, low = 0; int state;
    (void)argc; memset(&image, 0, sizeof image);
    if (elf_read_firmware(argv[1], &image)) return 1;
    avr = avr_make_mcu_by_name("atmega328p"); avr_init(avr); avr->frequency = 16000000; avr_load_firmware(avr, &image);
    at = (unsigned)strtoul(argv[2], 0, 0) & 0xffff; memset(avr->data + 0x100, 0xC5, 0x800);
    do state = avr_run(avr);
    while (state != cpu_Sleeping && state != cpu_Done && state != cpu_Crashed && avr->cycle < 4000000000ull);
    for (low = (unsigned)strtoul(argv[3], 0, 0) & 0xffff; low < 0x900 && avr->data[low] == 0xC5; low++) {}
    printf("%llu %.9g %u %d\\n", (unsigned long long)avr->cycle, *(float *)(avr->data + at), 0x900 - low, state);
    return 0;
}
"""


def run(*command: object, **options: Any) -> str:
    """What a program prints."""
    done = subprocess.run([*map(str, command)], capture_output=True, text=True, check=False, **options)
    if done.returncode:
        raise RuntimeError(f"{command[0]}: {done.stderr[-2000:]}")
    return done.stdout


def in_python(name: str) -> dict[str, float]:
    """Median and 99th percentile of the time of a step on one core [s]."""
    task = control_task("B1")
    controller, machine = CONTROLLERS[name](task), task.model
    measured, count = machine.reset(), 2000 if name == "mpc" else 4000
    wanted = 12e-3 + 4e-3 * np.sin(0.03 * np.arange(count + controller.preview))
    controller.reset(measured, wanted[: controller.preview + 1])
    twin, times = task.model.with_arrays({}), []  # what steps the machine is not measured
    twin.reset()
    for k in range(count):
        window = wanted[k : k + controller.preview + 1]
        begin = time.thread_time()
        number = controller.step(measured, window)
        times.append(time.thread_time() - begin)
        if name == "mpc" or k % 20 == 0:
            measured = twin.step(**task.commands(task.saturated(number)))
    return {"python": float(np.median(times)), "python_p99": float(np.quantile(times, 0.99))}


def build(controller: StepControl, folder: Path, real: str, main: str) -> list[str]:
    """Write the sources of a controller with a main program, and return flags and files for a compiler."""
    texts = controller.c_source("board", real=real, output=12e-3) | {"main.c": SAMPLE + main}
    for name, text in texts.items():
        (folder / name).write_text(text)
    # what a controller does not look at is no member of its sample
    flags = [f"-D{one.upper()}" for one in ("output", "pressure") if f" {one};" in texts["board.h"]]
    return [*flags, f"-DCOUNT={STEPS}", str(folder / "board.c"), str(folder / "main.c")]


def sizes(tool: str, image: Path) -> dict[str, int]:
    """Bytes of flash and of fixed memory of an image."""
    text, data, bss = map(int, run(tool, image).splitlines()[1].split()[:3])
    return {"flash": text + data, "fixed": data + bss}


def on_host(controller: StepControl, folder: Path) -> dict[str, float]:
    """Time of a step of the C in float64 [s]."""
    files = build(controller, folder, "float64", HOST)
    image = folder / "host"
    run("gcc", "-std=gnu99", "-O2", "-march=native", "-ffp-contract=off", *files, "-o", image, "-lm")
    return {"host": min(float(run(image)) for _ in range(5)) * 1e-9}


def on_uno(controller: StepControl, folder: Path) -> dict[str, Any]:
    """Cycles of a step in float32, flash and memory of an image with nothing else in it."""
    emulator = folder / "simavr"
    if not emulator.exists():
        (folder / "simavr.c").write_text(EMULATOR)
        run("gcc", "-I/usr/include/simavr", folder / "simavr.c", "-o", emulator, "-lsimavr")
    image, cycles = folder / "uno.elf", {}
    files = build(controller, folder, "float32", ON_UNO)
    for count in (0, STEPS):
        counted = [f"-DCOUNT={count}" if f.startswith("-DCOUNT") else f for f in files]
        try:
            run(*UNO, "-Wno-builtin-declaration-mismatch", *counted, "-o", image, "-lm")
        except RuntimeError as error:
            if "will not fit" in str(error):
                return {"uno": "more than 32 KB of flash"}
            raise
        place = {line.split()[-1]: line.split()[0] for line in run("avr-nm", image).splitlines()}
        spent, number, stack, state = (
            run(emulator, image, f"0x{place['number']}", f"0x{place['_end']}").splitlines()[-1].split()
        )
        if int(state) not in (3, 6):  # asleep, or done
            return {"uno": f"does not end: state {state}"}
        cycles[count] = int(spent)
    size = sizes("avr-size", image)
    per_step = (cycles[STEPS] - cycles[0]) / STEPS
    return {"uno_cycles": per_step, "uno_flash": size["flash"], "uno_memory": size["fixed"] + int(stack),
            "uno_number": float(number)}  # fmt: skip


def on_stm32(controller: StepControl, folder: Path, real: str) -> dict[str, Any]:
    """Cycles of a step with and without the flash's cache, flash and fixed memory."""
    image, log, counts = folder / "arm.elf", folder / "trace", {}
    files = build(controller, folder, real, ON_ARM)
    for count in (0, STEPS):
        counted = [f"-DCOUNT={count}" if f.startswith("-DCOUNT") else f for f in files]
        libraries = ("-lm", "-lc", "-lnosys", "-lgcc")
        script = FIRMWARE / "stm32f405/memory.ld"
        run(*ARM, "-nostartfiles", "-T", script, *counted, "-o", image, *libraries)
        run("qemu-system-arm", "-M", "netduinoplus2", "-kernel", image, *QUIET, "-D", log)
        counts[count] = cycles(program(image), log)
        log.unlink()
    size = sizes("arm-none-eabi-size", image)
    fast, slow = (np.array(counts[STEPS]) - counts[0]) / STEPS
    return {f"stm32_{real}": float(fast), f"stm32_{real}_no_cache": float(slow), f"stm32_{real}_flash": size["flash"]}


def cycles(instructions: dict[int, Any], log: Path) -> tuple[float, float]:
    """Cycles of a trace, with and without the flash's cache."""
    total, waits, before, at = 0, 0, None, 0
    for here in addresses(log):
        now = instructions.get(here)
        if before is not None:
            jumps = here != at + before.size
            kind = before.mnemonic.partition(".")[0]
            total += SLOW.get(kind, cycles_of(before.mnemonic, before.operands)) + REFILL * jumps
            waits += jumps + (here // 16 != at // 16 and not jumps) + ("[pc" in before.operands)
        before, at = now, here
    return total, total + 5 * waits


def measure(folder: Path) -> dict[str, dict[str, Any]]:
    """All figures by controller."""
    rows: dict[str, dict[str, Any]] = {}
    lacking = {of: [t for t in tools if not (shutil.which(t) or Path(t).is_dir())] for of, tools in TOOLS.items()}
    for of, tools in lacking.items():
        if tools:
            print(f"{of}: not measured for want of {', '.join(tools)}")
    for name in CONTROLLERS:
        row = rows[name] = in_python(name)
        controller = CONTROLLERS[name](control_task("B1"))
        if not isinstance(controller, StepControl):
            row["uno"] = ON_NO_BOARD[name]
            continue
        if not lacking["gcc"]:
            row |= on_host(controller, folder)
        if not lacking["Uno"]:
            row |= on_uno(controller, folder)
        if not lacking["STM32F405"]:
            for real in ("float32", "float64"):
                row |= on_stm32(controller, folder, real)
        print(name, json.dumps(row), flush=True)
    return rows


def on_which_they_stand() -> dict[str, float]:
    """Medians of the times of what controllers use [s], the gradient's over that of its rollout."""
    task = control_task("B1")
    model, law = task.model, task.model.units["muscle"].law
    inverse, strokes = Inverse(task), 12e-3 + 4e-3 * np.sin(0.03 * np.arange(2000))
    spans = task.zero - strokes
    tensions = np.asarray(law.tension(spans, 3e5))
    asked = list(zip(tensions[:100].tolist(), spans[:100].tolist(), strict=True))
    model.reset()
    rollout = model.rollout(
        lambda gains, seen: {"muscle": gains[0] + gains[1] * (seen.position - 0.24)},
        steps=200,
        cost=lambda seen, _: (seen.position - 0.24) ** 2,
    )
    gains = np.array([2.5e5, 3e7])
    paths = ["load.mass", "muscle.law.rest_diameter"]
    inverse.reset(strokes[0])
    taken = in_turns(
        {
            "inverse": lambda: [inverse.advance(one) for one in strokes],
            "pressures_for": lambda: law.pressures_for(tensions, spans),
            "pressure_for": lambda: [law.pressure_for(*one) for one in asked],
            "linearise": lambda: model.linearise("muscle", ("position",), amplitude=1e4),
            "rollout": lambda: rollout(gains),
            "gradient": lambda: rollout.value_and_grad(gains),
            "machine": lambda: rollout.machine_gradient(gains, paths),
        },
        21,
        wall=True,
    )
    return {
        "a sample of the memory inverse alone, s": taken.median("inverse") / len(strokes),
        "a pressure of `pressures_for`, of 2,000, s": taken.median("pressures_for") / len(spans),
        "a call of `pressure_for`, s": taken.median("pressure_for") / len(asked),
        "a call of `linearise`, s": taken.median("linearise"),
        "a rollout of 200 samples, s": taken.median("rollout"),
        "its gradient by 2 gains, over it": taken.ratio("gradient", "rollout"),
        "its gradient by 2 gains and 2 numbers of the machine, over it": taken.ratio("machine", "rollout"),
    }


def page(rows: dict[str, dict[str, Any]]) -> str:
    """The table of the documentation."""
    heads = "controller", "Python, us (99 of 100 within)", "C, us", "Uno, ms", "its flash, memory, bytes"
    heads += "STM32F405 in float32, ms", "in float64, ms", "its flash"
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for name, r in rows.items():
        cells = [f"`{name}`", f"{1e6 * r['python']:,.1f} ({1e6 * r['python_p99']:,.0f})"]
        cells.append(f"{1e6 * r['host']:.2f}" if "host" in r else "-")
        if "uno_cycles" in r:
            cells += [f"{r['uno_cycles'] / 16e3:.1f}", f"{r['uno_flash']:,}, {r['uno_memory']:,}"]
        else:
            cells += [r.get("uno", "-"), "-"]
        for real in ("float32", "float64"):
            key = f"stm32_{real}"
            cells.append(f"{r[key] / 168e3:.3f} ({r[f'{key}_no_cache'] / 168e3:.3f})" if key in r else "-")
        cells.append(f"{r['stm32_float64_flash']:,}" if "stm32_float64_flash" in r else "-")
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, help="File for all figures")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        rows = measure(Path(folder))
    print(page(rows))
    used = on_which_they_stand()
    print(*(f"{what}: {number:.3g}" for what, number in used.items()), sep="\n")
    if given.json:
        given.json.write_text(json.dumps(rows | {"used": used}, indent=1) + "\n")


if __name__ == "__main__":
    main()
