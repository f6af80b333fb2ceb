"""What cannot be lowered is named with the place where it is written; what is called wrongly is refused."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import lanewise
from lanewise import ArgumentError, LoweringError, Program, lower


def searching(x):
    return jax.lax.while_loop(lambda c: c * c < 2.0, lambda c: c + 0.1, x)


def narrow(x):
    return x.astype(jnp.float32) * 2


def remainder(x):
    return jnp.fmod(x, 0.3)


@pytest.mark.parametrize(
    ("function", "name", "why"),
    [
        (searching, "while", "counts up to a limit"),
        (narrow, "convert_element_type", "float32"),
        (remainder, "rem", "remainder"),
    ],
)
def test_an_operation_without_a_kernel_is_named_with_its_place(function, name, why):
    with pytest.raises(LoweringError) as caught:
        lower(function, 1.0)
    text = str(caught.value)
    assert name in text and why in text
    assert "test_lowering_refusals.py" in text and function.__name__ in text
    assert "\n" not in text


def test_a_refused_operation_that_nothing_needs_is_no_refusal():
    program, _ = lower(lambda x: (remainder(x), 2.0 * x)[1], 1.0)
    assert program.call([3.0]) == [6.0]


def test_auto_takes_xla_where_there_is_no_kernel_and_says_why():
    run = lanewise.compile(searching, 1.0)
    assert run.engine == "xla" and "while" in run.reason
    assert float(run(1.0)) == pytest.approx(1.5)
    with pytest.raises(LoweringError):
        _ = run.program


def test_calls_that_do_not_fit_are_refused():
    run = lanewise.compile(lambda x, y: x + y.sum(), 1.0, np.zeros(3), engine="native")
    assert run(np.arange(4.0), np.ones(3), lanes=4).tolist() == [3.0, 4.0, 5.0, 6.0]
    for arguments, lanes, field in [
        ((1.0, np.zeros(4)), None, "[1]"), ((np.zeros(5), np.zeros(3)), 4, "[0]"), ((1.0,), None, "arguments"),
        ((1.0, np.zeros(3)), 0, "lanes"),
    ]:  # fmt: skip
        with pytest.raises(ArgumentError) as caught:
            run(*arguments, lanes=lanes)
        assert caught.value.argument == field
    for options, field in (({"mode": "quick"}, "mode"), ({"real": "float16"}, "real")):
        with pytest.raises(ArgumentError) as caught:
            run(1.0, np.zeros(3), **options)
        assert caught.value.argument == field
    with pytest.raises(ArgumentError):
        lanewise.compile(searching, 1.0, engine="fastest")


def test_trips_that_differ_from_lane_to_lane_are_refused():
    program, _ = lower(lambda n: jax.lax.fori_loop(0, n, lambda i, c: c * 2.0, 1.0), 3)
    with pytest.raises(LoweringError, match="lane"):
        program.call([np.array([1, 2])], lanes=2)


def test_programs_by_name_refuse_what_is_missing_or_unknown():
    program, _ = lower(lambda t: {"sum": t["a"] + t["b"]}, {"a": 1.0, "b": 2.0})
    assert program.run({"[0]['a']": 1.0, "[0]['b']": 4.0}) == {"['sum']": 5.0}
    for arguments in ({"[0]['a']": 1.0}, {"[0]['a']": 1.0, "[0]['b']": 4.0, "c": 1.0}):
        with pytest.raises(ArgumentError):
            program.run(arguments)


@pytest.mark.parametrize(
    "content",
    [None, b"", b"no program", b"x\x9c\xab\x56\x2a\x4e\xce\x48\xcd\x4d\x54\xb2\x32\xac\x05\x00\x1f\x3c\x04\x6d"],
)
def test_files_that_are_no_programs_are_refused(tmp_path, content):
    file = tmp_path / "x.kernel"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(ArgumentError, match="x.kernel"):
        Program.load(file)
