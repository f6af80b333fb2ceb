"""The benchmarks' C kernels integrate the systems that they are a yardstick for; the page says what was measured."""

import importlib
import json
import platform
import re
import sys
from pathlib import Path

import jax
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
SAMPLES = 20  # of 10 steps
LANES = 16


@pytest.fixture(scope="module")
def suite():
    """The benchmarks' modules by name, which are scripts and no package."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "benchmarks"))
        yield importlib.import_module
        for name in [
            n for n, m in sys.modules.items() if str(getattr(m, "__file__", "")).startswith(str(ROOT / "benchmarks"))
        ]:
            del sys.modules[name]


@pytest.fixture(scope="module")
def kernels(suite):
    found = suite("compiled_c")
    if found.compiler() is None:
        pytest.skip("no C compiler: the hand-written kernels cannot be built")
    return found


@pytest.fixture(scope="module", params=["tube", "valve", "s1"])
def both(request, suite, kernels):
    """A batch, and what the library makes of it, (samples + 1, lanes) each."""
    cases = suite("cases")
    batch = cases.batch(getattr(cases, request.param)(), LANES, SAMPLES)
    return batch, [np.asarray(x).T for x in jax.jit(batch.mapped())(*batch.arguments())]


def test_the_lanes_of_every_case_stand_in_the_system_that_a_kernel_is_made_of(both, suite):
    """A number of each lane is none of each element in parallel, which the modules that know of elements would refuse."""
    batch, _ = both
    system = suite("engines").trees(batch, lambda x: x)[0]
    lane = suite("engines").trees(batch, lambda x: x[..., 1])[0]
    different = 0
    for all_of_them, one in zip(jax.tree.leaves(system), jax.tree.leaves(lane), strict=True):
        if np.shape(all_of_them)[-1:] == (LANES,):
            different += 1
            assert np.array_equal(np.asarray(all_of_them)[..., 1], one)
    assert different >= len(batch.changes)


def off(found, exact):
    """Largest deviation of each output over its largest value."""
    return max(float(np.abs(a - b).max() / np.abs(b).max()) for a, b in zip(found, exact, strict=True))


def run(kernels, suite, batch, **options):
    cases = suite("cases")
    kernel = kernels.Kernel(batch.case.name, **options)
    return kernel.prepared(batch, cases.INNER, cases.PERIOD)()


def test_the_kernel_integrates_the_library_s_system(both, kernels, suite):
    batch, exact = both
    # both round every operation differently; 200 steps of some 1,000 operations leave a few units in the last place
    assert off(run(kernels, suite, batch), exact) < 1e-12
    assert all(np.ptp(x) > 1e-3 * np.abs(x).max() for x in exact), "nothing moved"


def test_one_muscle_alone_is_the_same_muscle(both, kernels, suite):
    batch, exact = both
    # the same formulas, with divisions instead of shared reciprocals
    assert off(run(kernels, suite, batch.first(1), single=True), [x[:, :1] for x in exact]) < 1e-12


def test_lanes_that_fill_no_vector_are_not_lost(both, kernels, suite):
    batch, exact = both
    # 5 is no multiple of any vector's lanes
    assert off(run(kernels, suite, batch.first(5)), [x[:, :5] for x in exact]) < 1e-12


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="names x86's instruction sets")
@pytest.mark.parametrize("march", ["x86-64", "x86-64-v3"])
def test_other_vectors_give_the_same(both, kernels, suite, march):
    if march == "x86-64-v3" and "avx2" not in Path("/proc/cpuinfo").read_text():
        pytest.skip("this processor has no AVX2")
    batch, exact = both
    assert off(run(kernels, suite, batch, options=(f"-march={march}",)), exact) < 1e-12


def test_single_precision_is_the_same_system(both, kernels, suite):
    batch, exact = both
    # 6e-8 per rounding; over 200 steps the sums of the state lose some hundred of them, relative to what moves
    found = run(kernels, suite, batch, dtype=np.float32)
    assert max(float(np.abs(a - b).max() / np.ptp(b)) for a, b in zip(found, exact, strict=True)) < 1e-3


def test_every_parameter_of_a_kernel_stands_in_its_system(both, kernels):
    batch, _ = both
    names = kernels.Kernel(batch.case.name, single=True).parameter_names
    assert batch.parameters(names).shape == (len(names), LANES)
    assert set(names) == set(batch.case.paths) | set(batch.case.constants)


def test_operations_are_counted_from_the_kernel_s_text(both, kernels, suite):
    batch, _ = both
    count = kernels.operations(batch.case.name, batch, suite("cases").STEP)
    # the step has at least five rates of some operations per state, and no loop
    assert 20 * len(batch.case.slots(*batch.case.start)) < count < 2000


def test_plain_python_is_the_same_muscle(suite, kernels):
    """What SciPy is given: its rates against differences of the kernel over a step of 1 us, without what friction splits."""
    cases, plain = suite("cases"), suite("plain_muscle")
    batch = cases.batch(cases.tube(), 1, 2)
    names = [*batch.case.paths, *batch.case.constants]
    numbers = dict(zip(names, batch.parameters(names)[:, 0], strict=True))
    supply = float(batch.commands[0, 0, 0])
    start = batch.state()[:, 0]
    start[1], start[4] = 0.05, 2e-4  # lengthens while it is filled
    run = kernels.Kernel("muscle", single=True).prepared(batch, 1, 1e-6)
    run.start[:, 0] = start
    run()
    rates = np.array(plain.rate_of(numbers, lambda t: supply)(0.0, start))
    # two samples of 1 us were taken; the second-order term of 2 us on modes of 1e3 1/s is a few 1e-3
    np.testing.assert_allclose((run.state[:, 0] - start) / 2e-6, rates, rtol=5e-3, atol=1e-9)


@pytest.mark.slow
def test_s1_reaches_the_printed_end(suite):
    yardstick = suite("yardstick")
    # the table prints 432507.497 Pa and 0.07225138 m; Radau at 1e-10 agrees to what is printed
    contraction, _, pressure = yardstick.reference(np.linspace(0.0, 10.0, 3))[:, -1]
    assert pressure == pytest.approx(432507.497, abs=2e-3)
    assert contraction == pytest.approx(0.07225138, abs=1e-8)


def test_the_page_says_what_was_measured_and_what_was_not(suite, tmp_path):
    script, page = suite("suite"), suite("page")
    rows = [
        {"group": "batch", "case": "muscle", "engine": "C", "lanes": n, "dtype": "float64", "rate": 1e8, "error": 1e-6}
        for n in (1, 1024)
    ]
    rows += [
        {
            "group": "batch",
            "case": "muscle",
            "engine": "native",
            "lanes": 1024,
            "dtype": "float64",
            "rate": 8e7,
            "vs_c": 0.8,
        }
    ]
    rows += [{"group": "peers", "program": "MuJoCo 4", "case": "slide", "rate": 1e6, "real_time": 10.0, "error": 1e-3}]
    found = {"batches": {"rows": rows}}
    result = {
        "started": "now", "quick": True, "machine": script.machine(), "rows": rows, "linear": {},
        "ratios": script.ratios(found), "left_out": {"OpenSim": "could not install"}, "notes": [],
        "wanted": {n: {"sign": s, "value": v, "meaning": m} for n, (s, v, m) in script.WANTED.items()},
    }  # fmt: skip
    assert result["ratios"] == {"batch1024_f64_vs_c": 0.8, "batch1024_f64_vs_mujoco": 80.0}
    page.write(json.loads(json.dumps(result)), tmp_path)
    text = (tmp_path / "results.md").read_text()
    assert re.search(r"native kernel relative to the C kernel, 1,024.*\| 0\.8 \| >= 0\.75 \| yes", text)
    assert "not measured" in text
    assert "OpenSim: could not install" in text
    assert (tmp_path / "batches.svg").stat().st_size > 1000


def test_no_two_scripts_of_the_benchmarks_have_one_name():
    """Both folders are searched for modules: of two of one name, the other one was imported, and no peer was measured."""
    stems = [p.stem for folder in ("", "peers", "kernels") for p in (ROOT / "benchmarks" / folder).glob("*.py")]
    assert sorted(stems) == sorted(set(stems))


def test_a_peer_that_cannot_be_measured_is_an_error(suite, tmp_path, monkeypatch, capsys):
    script, peers = suite("suite"), suite("measure_peers")
    programs = suite("peer_programs")

    def fails(name, *_):
        raise programs.LeftOutError(f"could not install {name}: no such distribution")

    monkeypatch.setattr(programs, "run", fails)
    found = peers.measure(True, "")
    assert {row["program"]: row["case"] for row in found["rows"]} == dict.fromkeys(programs.PEERS, "error")
    monkeypatch.setattr(sys, "argv", ["suite.py", "--only", "peers", "--out", str(tmp_path)])
    monkeypatch.setattr(script, "pin", lambda: None)
    assert script.main() == 1
    said, text = capsys.readouterr().out, (tmp_path / "results.md").read_text()
    for name in programs.PEERS:
        assert f"error: {name}: could not install {name}" in said
        assert re.search(rf"\| {name} \| error \| could not install {name}", text)
