"""PTX: what can be known of it without a GPU, and the whole way to one with a processor in its place.

The text that becomes PTX is compiled for the processor, entry and index arithmetic included, and called thread by thread by
a library that has the functions of NVIDIA's driver. Where there is a GPU, the last test runs on it.
"""

import ctypes
import re
import shutil
import subprocess
from collections import Counter
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import lanewise
from c_programs import COMPILER, same_bits
from lanewise import ArgumentError, DriverError, LanewiseError, Program, UnavailableError, _gpu, _kernel, lower, to_gpu
from lanewise._analysis import most_held, order_for_registers
from lanewise._gpu import OWN, compile_ptx, gpu_assembly
from lanewise._graph import Node
from lowered_examples import CASES, arguments_of, orbit_program, orbit_values, program

ASSEMBLER = shutil.which("ptxas") or next(map(str, Path(np.__file__).parents[1].glob("nvidia/*/bin/ptxas")), None)
compiled = pytest.mark.skipif(COMPILER is None, reason="no C compiler")
MODES = [("default", "float64"), ("strict", "float64"), ("default", "float32")]


def everything(made: Program) -> frozenset[int]:
    return frozenset(k for k, leaf in enumerate(made.arguments) if leaf.kind == "real")


def orbit_ptx(mode: str, real: str) -> str:
    made = orbit_program()
    return compile_ptx(gpu_assembly(made, everything(made), mode=mode, real=real)[0])


def operations(text: str) -> Counter[str]:
    return Counter(re.findall(r"^\s+(?:@!?%\w+ )?([a-z][\w.]*)", text, re.M))


@pytest.mark.parametrize("real", ["float64", "float32"])
def test_the_state_stays_in_registers_and_all_is_rounded(real: str) -> None:
    found = operations(orbit_ptx("default", real))
    size = "f64" if real == "float64" else "f32"
    assert found[f"fma.rn.{size}"] > 100
    # the assembler may join a product and a sum that say nothing of rounding
    loose = [
        op for op in found if re.fullmatch(r"(add|sub|mul|fma|div|rcp|sqrt)\.f(32|64)|.*\.(ftz|approx|full)\..*", op)
    ]
    assert not loose
    assert not any(".local" in op or op.startswith(("ld.b", "st.b")) for op in found)  # no memory but the caller's
    if real == "float32":
        assert not any("f64" in op for op in found)


def test_nothing_of_this_processor_is_left_in_it() -> None:
    made = orbit_program()
    text, _ = gpu_assembly(made, everything(made))
    assert "target-cpu" not in text
    assert ".target sm_80" in compile_ptx(text)
    assert ".target sm_75" in compile_ptx(text, (7, 5))
    assert ".target sm_80" in compile_ptx(text, (9, 0))  # what runs on all later ones


def test_fast_float32_divides_as_the_gpu_does() -> None:
    found = operations(orbit_ptx("fast", "float32"))
    assert found["div.approx.f32"] + found["rcp.approx.f32"] > 5
    assert not any("f64" in op for op in found)


def test_the_loops_stay_loops() -> None:
    # a run of ten times the samples has the same text but for numbers
    lengths = []
    for samples in (20, 200):
        made, _ = lower(*_running(samples))
        lengths.append(len(operations(compile_ptx(gpu_assembly(made, everything(made))[0]))))
        count = sum(operations(compile_ptx(gpu_assembly(made, everything(made))[0])).values())
        assert count < 400
    assert lengths[0] == lengths[1]


def test_what_all_lanes_share_is_read_as_an_argument() -> None:
    made = orbit_program()
    differs = frozenset({len(made.arguments) - 1})  # commands; all parameters are shared
    whole, parted = (gpu_assembly(made, differs, parted=parted) for parted in (False, True))
    assert whole[1]["uniforms"] == 0 < parted[1]["uniforms"] <= _gpu.UNIFORMS
    texts = [compile_ptx(text) for text, _ in (whole, parted)]
    entries = [re.findall(r"\.entry (\w+)", text) for text in texts]
    assert entries == [["lanes"], ["uniforms_of_all", "lanes"]]
    lanes = texts[1][texts[1].index(".entry lanes") :]
    # shared parameters are not loaded in each lane any more, and no table of pointers is left in a thread's own memory
    assert operations(lanes)["ld.global.b64"] < operations(texts[0])["ld.global.b64"]
    assert ".local" not in texts[1]


def test_nodes_are_ordered_to_hold_fewer_values() -> None:
    made = orbit_program()
    graph, plan = made.prepared("default", "float64")
    held = {node for node in plan.live.nodes if node.kind == "real" and node.op != "const"}
    ordered = order_for_registers(plan, held)
    assert most_held(ordered, held) <= most_held(plan, held)
    for loop, body in plan.bodies.items():
        place = {entry: k for k, entry in enumerate(ordered.bodies[loop])}
        assert sorted(map(id, body)) == sorted(map(id, ordered.bodies[loop]))  # the same entries, each once
        for entry, k in place.items():
            needs = entry.args if isinstance(entry, Node) else ()
            assert all(place[a] < k for a in needs if a in place)  # after what it needs


def test_few_lanes_are_spread_over_all_multiprocessors() -> None:
    kernel = object.__new__(_gpu.GpuKernel)
    kernel.device, kernel.registers = _gpu.Device(0, "", (9, 0), 132), 128
    assert [kernel.block_of(n) for n in (1, 4096, 16384, 10**6)] == [32, 32, 128, 512]
    kernel.registers = 0
    assert kernel.block_of(10**6) == 64


def _running(samples: int) -> tuple[Any, ...]:
    function, (x, _) = CASES["loops"]
    return function, x, np.linspace(-1.0, 2.0, samples)


@pytest.mark.slow
@pytest.mark.skipif(ASSEMBLER is None, reason="no ptxas")
@pytest.mark.parametrize("chip", ["sm_80", "sm_90"])
def test_the_assembler_takes_it(chip: str, tmp_path: Path) -> None:
    texts = {
        f"orbit-{mode}-{real}": orbit_ptx(mode, real)
        for mode, real in [*MODES, ("fast", "float64"), ("fast", "float32")]
    }
    texts |= {
        name: compile_ptx(gpu_assembly(program(name), everything(program(name)))[0])
        for name in CASES
        if name != "counted"
    }
    for name, text in texts.items():
        file = tmp_path / f"{name}.ptx"
        file.write_text(text, encoding="utf-8")
        command = [str(ASSEMBLER), "-v", "-arch", chip, str(file), "-o", str(tmp_path / "out.cubin")]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        if name.startswith("orbit"):
            assert "0 bytes spill stores, 0 bytes spill loads" in done.stdout + done.stderr, name


class Fake:
    """The driver that is none; kernels are what `gpu.ptx` was asked to write, compiled for the processor."""

    def __init__(self, library: Path) -> None:
        self.library = ctypes.CDLL(str(library))
        self.keep: list[Any] = []

    def number(self, name: str, kind: Any = ctypes.c_int64) -> Any:
        return kind.in_dll(self.library, f"fake_{name}")

    def take(self, text: str) -> None:
        """Make a kernel from the LLVM assembly of a GPU's."""
        head = "@place = global [3 x i32] zeroinitializer\n"
        for k, name in enumerate(("tid.x", "ctaid.x", "ntid.x")):
            read = f"%p = getelementptr [3 x i32], ptr @place, i64 0, i64 {k}\n %v = load i32, ptr %p\n ret i32 %v\n"
            sreg = f"@llvm.nvvm.read.ptx.sreg.{name}()"
            text = text.replace(f"declare i32 {sreg}", f"define i32 @own{k}() {{\n {read}}}").replace(
                sreg, f"@own{k}()"
            )
        by_value = "byval(" in text
        text = re.sub(r"^target triple.*$|byval\(\[\d+ x i8\]\) align 8 ", "", text, flags=re.M)
        text = text.replace("define ptx_kernel", "define")
        binding = _kernel.llvm()
        engine = binding.create_mcjit_compiler(binding.parse_assembly(head + text), _kernel.target_machine())
        engine.finalize_object()
        place = (ctypes.c_int32 * 3).from_address(engine.get_global_value_address("place"))
        self.keep.append(engine)
        for entry, variable, integers in (("lanes", "kernel", 4), ("uniforms_of_all", "first", 3)):
            if f"@{entry}(" in text:
                self.launcher(variable, engine.get_function_address(entry), integers, place, by_value)

    def launcher(self, variable: str, address: int, integers: int, place: Any, by_value: bool) -> None:
        """Set what a launch of an entry calls: it for each thread, with its integers and the address of bytes by value."""
        one = ctypes.CFUNCTYPE(None, *(ctypes.c_uint64,) * 5)(address)

        @ctypes.CFUNCTYPE(None, ctypes.POINTER(ctypes.c_void_p), ctypes.c_uint, ctypes.c_uint)
        def launched(parameters: Any, blocks: int, threads: int) -> None:
            given = [ctypes.c_uint64.from_address(parameters[k]).value for k in range(integers)]
            given.append(parameters[4] if variable == "kernel" and by_value else 0)
            for block in range(blocks):
                for thread in range(threads):
                    place[0], place[1], place[2] = thread, block, threads
                    one(*given, *(0,) * (5 - len(given)))

        where = ctypes.c_void_p.in_dll(self.library, f"fake_{variable}")
        where.value = ctypes.cast(launched, ctypes.c_void_p).value
        self.keep += [one, launched]


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("driver") / "driver.so"
    source = Path(__file__).with_name("fake_driver.c")
    subprocess.run([str(COMPILER), "-O1", "-shared", "-fPIC", str(source), "-o", str(made)], check=True)
    return made


@pytest.fixture
def fake(library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Fake:
    copy = tmp_path / "driver.so"  # its own, for a library that was changed by another test stays loaded
    shutil.copy(library, copy)
    monkeypatch.setenv(_gpu.VARIABLE, str(copy))
    monkeypatch.setenv("LANEWISE_CACHE", "off")
    made = Fake(copy)

    def watched(text: str, capability: tuple[int, int]) -> str:
        made.take(text)
        return compile_ptx(text, capability)

    monkeypatch.setattr(_gpu, "compile_ptx", watched)
    return made


def spread(values: Any, made: Program, lanes: int, *, most: int = 100) -> list[Any]:
    """Arguments that differ from lane to lane in their real numbers, the first `most` of them."""
    found = []
    for k, (leaf, value) in enumerate(zip(made.arguments, values, strict=True)):
        change = 1.0 + 1e-3 * np.modf((k + 1) * 0.618 * np.arange(1, lanes + 1))[0]
        found.append(np.multiply.outer(value, change) if leaf.kind == "real" and k < most else np.asarray(value))
    return found


@compiled
@pytest.mark.parametrize(("mode", "real"), MODES)
@pytest.mark.parametrize("name", CASES)
def test_threads_do_what_lanes_do(name: str, mode: str, real: str, fake: Fake) -> None:
    # No tolerance: it is the same text, for one lane instead of many side by side.
    made = program(name)
    lanes = 70  # more than a block, and no multiple of any width
    for values in list(arguments_of(name, real))[:2]:
        given = spread(values, made, lanes)
        ours = to_gpu(made).call(given, lanes=lanes, mode=mode, real=real)
        assert same_bits(ours, made.call(given, lanes=lanes, mode=mode, real=real))


@compiled
@pytest.mark.parametrize(
    ("lanes", "most", "launches"), [(1, None, 1), (64, None, 1), (65, None, 1), (150, 64, 3), (150, 70, 3)]
)
def test_an_orbit_in_chunks(lanes: int, most: int | None, launches: int, fake: Fake) -> None:
    made = orbit_program()
    given = spread(
        orbit_values(), made, lanes, most=len(made.arguments) - 5
    )  # the last ones, commands among them, are shared
    there = to_gpu(made, most=most)
    assert same_bits(there.call(given, lanes=lanes), made.call(given, lanes=lanes))
    assert fake.number("launches").value == launches
    assert fake.number("held").value == 0  # all memory was given back
    assert fake.number("events").value == 0
    (kernel,) = there._kernels.values()
    # the driver's clock, 2 ms for each launch, and for that of what all lanes share
    assert kernel.seconds == pytest.approx(2e-3 * (launches + 1))


@compiled
def test_fast_takes_reciprocals_together(fake: Fake) -> None:
    made = orbit_program()
    given = spread(orbit_values(), made, 20)
    for ours, exact in zip(to_gpu(made).call(given, lanes=20, mode="fast"), made.call(given, lanes=20), strict=True):
        np.testing.assert_allclose(ours, exact, rtol=1e-12)  # rounding, over 160 steps
    texts = [gpu_assembly(made, everything(made), mode=mode)[0] for mode in ("fast", "default")]
    assert ["fpclass" in text for text in texts] == [True, False]  # the look at whether a product is a normal number


@compiled
def test_chunks_fit_the_memory(fake: Fake) -> None:
    made = orbit_program()
    given = spread(orbit_values(), made, 300)
    each = sum(8 * np.prod(leaf.shape, dtype=int) for leaf in (*made.arguments, *made.results))  # at most
    fake.number("free", ctypes.c_size_t).value = 150 * each
    assert same_bits(to_gpu(made).call(given, lanes=300), made.call(given, lanes=300))
    assert fake.number("launches").value > 1
    assert fake.number("most").value <= 150 * each


@compiled
def test_scratch_memory_that_a_thread_has_and_that_it_is_given(fake: Fake) -> None:
    def back_and_forth(x: Any, rows: Any) -> Any:
        _, first = jax.lax.scan(lambda c, r: (0.5 * c + r, jnp.sin(c)), x, rows)
        return jax.lax.scan(lambda c, r: (0.9 * c + r, None), 0.0, first[::-1])[0]

    sizes = []
    for rows in (50, 400):
        made, _ = lower(back_and_forth, 0.3, np.linspace(0.0, 1.0, rows))
        given = [0.3 + np.arange(40) / 40.0, np.linspace(0.0, 1.0, rows)]
        assert same_bits(to_gpu(made).call(given, lanes=40), made.call(given, lanes=40))
        sizes.append(gpu_assembly(made, frozenset({0}))[1]["scratch"])
    assert sizes[0] == 0
    assert sizes[1] > OWN  # or this test tries one way only


@compiled
def test_a_run_without_lanes_is_the_processors(fake: Fake) -> None:
    made, values = orbit_program(), orbit_values()
    assert same_bits(to_gpu(made).call(values), made.call(values))
    assert fake.number("launches").value == 0


@compiled
def test_the_engine_gpu_is_the_native_one_elsewhere(fake: Fake) -> None:
    function, examples = CASES["arithmetic"]
    by_gpu, native = (lanewise.compile(function, *examples, engine=engine) for engine in ("gpu", "native"))
    leaves, structure = jax.tree.flatten(examples)
    many = jax.tree.unflatten(structure, [np.multiply.outer(leaf, np.linspace(1.0, 2.0, 70)) for leaf in leaves])
    found, wanted = (jax.tree.leaves(run(*many, lanes=70)) for run in (by_gpu, native))
    assert same_bits(found, wanted)
    assert by_gpu.engine == "gpu" and fake.number("launches").value == 1


def test_no_driver_is_said_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(_gpu.VARIABLE, str(tmp_path / "none.so"))
    with pytest.raises(UnavailableError, match=r"^No GPU: no NVIDIA driver was found \(.*none\.so\)\.$"):
        to_gpu(program("loops"))
    with pytest.raises(UnavailableError, match="no NVIDIA driver"):
        lanewise.compile(*CASES["arithmetic"][:1], *CASES["arithmetic"][1], engine="gpu")


@compiled
@pytest.mark.parametrize(
    ("name", "value", "kind", "message"),
    [
        ("devices", 0, UnavailableError, r"^No GPU: the driver is there, but it finds no device\.$"),
        (
            "capability",
            52,
            UnavailableError,
            r"^No GPU: Processor in disguise has compute capability 5\.2; 6\.0 is needed\.$",
        ),
        ("fails", 1, DriverError, r"^The GPU's driver refused cuMemAlloc_v2: out of memory\.$"),
        ("bad_text", 1, DriverError, r"refused cuModuleLoadDataEx: something else\. line 7: no such instruction$"),
        (
            "free",
            64,
            ArgumentError,
            r"^5 lanes do not fit: the GPU has 57 bytes of memory left, and 64 lanes need \d+$",
        ),
    ],
)
def test_what_fails_is_said(name: str, value: int, kind: Any, message: str, fake: Fake) -> None:
    fake.number(name, ctypes.c_size_t if name == "free" else ctypes.c_int).value = value
    made = program("loops")
    with pytest.raises(kind, match=message):
        to_gpu(made).call(spread(CASES["loops"][1], made, 5), lanes=5)


@compiled
def test_an_unknown_device_is_refused(fake: Fake) -> None:
    with pytest.raises(ArgumentError, match="Unknown device 1. Known are 0 to 0: Processor in disguise"):
        to_gpu(program("loops"), device=1)


def _has_gpu() -> bool:
    try:
        return bool(_gpu.devices())
    except LanewiseError:
        return False


@pytest.mark.skipif(not _has_gpu(), reason="no GPU")
@pytest.mark.parametrize(("real", "tolerance"), [("float64", 1e-9), ("float32", 1e-3)])
def test_a_gpu_agrees_with_the_processor(real: str, tolerance: float) -> None:
    made = orbit_program()
    given = spread(orbit_values(), made, 1000)
    ours = to_gpu(made, most=300).call(given, lanes=1000, real=real)
    for a, b in zip(ours, made.call(given, lanes=1000, real=real), strict=True):
        np.testing.assert_allclose(a, b, rtol=tolerance)  # what is promised; the same bits are meant
