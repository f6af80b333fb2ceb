"""The dry run finds what a rig cannot do before anything moves, by step, and says what would fit."""

import dataclasses

import numpy as np
import pytest

from mckibben.errors import InputError
from mckibben.experiments.commands import PARTS
from mckibben.experiments.dry_run import Limits, _rests, check, check_lengths, dry_run
from mckibben.experiments.read import parse_protocol, protocol, protocol_names

EVERYTHING = frozenset((*PARTS, "pressure sensor", "span sensor", "tension sensor"))

L0 = 0.14


def nylon(span, pressure):
    """Eq. 13 of the paper, linear model of the nylon muscle [N]."""
    return np.maximum(0.466e-2 * (np.asarray(pressure) - 6200.0) * (np.asarray(span) - 0.0991) - 16.0, 0.0)


# The paper's machine with the nylon muscle: 10 bar valve, 100 N cell; 4 cm pulley; 1 kHz, at most 5 kHz.
RIG = Limits(
    pressure=(0.0, 10e5),
    pressure_rate=100e5,
    burst_pressure=6e5,
    tension=100.0,
    span=(0.09, 0.156),
    speed=2.0,
    acceleration=1500.0,
    sample_rates=(1.0, 5000.0),
    has=EVERYTHING,
)


def made(steps, **settings):
    return parse_protocol(
        'schema = 1\nname = "x"\n' + "".join(f"{k} = {v!r}\n" for k, v in settings.items()) + steps, where="p.toml"
    )


def found(p, rig=RIG, estimate=nylon):
    return dry_run(p, rig, rest_length=L0, muscle_estimate=estimate)


@pytest.mark.parametrize("name", protocol_names())
def test_shipped_protocols_pass_on_the_papers_machine(name):
    assert [f.sentence for f in found(protocol(name))] == []


def test_bridgestone_forces_are_over_the_papers_cell():
    # 260 N at 1.02 L0 and 5 bar (Table 1), stiffness 1090 N/L0; L0 = 14.7 cm
    def bridgestone(span, pressure):
        share = np.asarray(pressure) / 5e5
        return np.maximum(share * (260.0 + 1090.0 * (np.asarray(span) / 0.147 - 1.02)), 0.0)

    p = protocol("quasi-static", range="bridgestone")
    findings = dry_run(p, RIG, rest_length=0.147, muscle_estimate=bridgestone)
    assert {f.field for f in findings} == {"tension"}
    # more than 100 N from 2 bar on, in preconditioning and in the loops; to 2 bar it is 104 N
    assert {f.case for f in findings} == {f"pressure {n} bar" for n in (2, 3, 4, 5)}
    assert "the load cell reads up to 100 N. Up to 1.92 bar fits: lower pressure" in findings[0].sentence


HOLD = '[[steps]]\nlabel = "fill"\npressure = { to = "3 bar", in = "1 s" }\n[[steps]]\nlabel = "move"\n'
BAD = {
    # what is wrong: (second step, changes of the rig, step, field, words that must be said)
    "pressure above the regulator": ('pressure = "11 bar"\nfor = "1 s"', {"burst_pressure": 20e5}, 2, "pressure", "10 bar"),
    "pressure above the burst": ('pressure = "6.5 bar"\nfor = "1 s"', {}, 2, "pressure", "bursts at 6 bar"),
    "vacuum": ('pressure = { to = "-0.5 bar", in = "1 s" }', {}, 2, "pressure", "0 bar or more"),
    "force above the cell": (
        'span = { to = "1.1 L0", in = "1 s" }\npressure = {to = "5 bar", in = "1 s"}', {}, 2, "tension", "fits",
    ),
    "load above the cell": ('tension = "120 N"\nfor = "1 s"', {}, 2, "tension", "the load cell reads up to 100 N"),
    "load above the motor": ('tension = "50 N"\nfor = "1 s"', {"motor_force": 40.0}, 2, "tension", "motor pulls 40 N"),
    "load above the muscle": ('tension = "90 N"\nfor = "1 s"', {}, 2, "tension", "the muscle makes"),
    "a push": ('tension = "-3 N"\nfor = "1 s"', {}, 2, "tension", "cannot push"),
    "span beyond the frame": ('span = { to = "1.2 L0", in = "1 s" }\npressure = "0 bar"', {}, 2, "span", "15.6 cm"),
    "too short": ('span = { to = "0.5 L0", in = "1 s" }', {}, 2, "span", "9 cm or more"),
    "speed above the motor": ('span = { to = "0.8 L0", at = "20 L0/s" }', {}, 2, "speed", "up to 2 m/s"),
    "velocity above the motor": ('velocity = "-3 m/s"\nfor = "5 ms"', {}, 2, "speed", "up to 2 m/s"),
    "velocity that leaves the frame": ('velocity = "-5 mm/s"\nfor = "20 s"', {}, 2, "span", "9 cm or more"),
    "sine that is too hard": (
        'span = {kind="sine", mean="1 L0", amplitude="0.03 L0", frequency="40 Hz"}\nfor = "1 s"', {"acceleration": 50.0},
        2, "acceleration", "up to 50 m/s^2",
    ),
    "jump of the span": ('span = "0.9 L0"\nfor = "1 s"', {}, 2, "span", "jump from 14 cm to 12.6 cm"),
    "waveform that begins elsewhere": (
        'pressure = {kind="triangle", low="0 bar", high="3 bar", frequency="1 Hz"}\nfor = "2 s"', {}, 2, "pressure",
        "jumps from 3 bar to 0 bar where the waveform begins",
    ),
    "jump in a table": (
        'pressure = {kind="table", times=["0 s", "0.5 s", "0.501 s"], values=["3 bar", "3 bar", "5 bar"]}\nfor = "1 s"',
        {}, 2, "pressure", "the valve follows 100 bar/s",
    ),
    "sine that is too steep": (
        'pressure = {kind="sine", mean="3 bar", amplitude="2 bar", frequency="20 Hz"}\nfor = "1 s"', {}, 2, "pressure",
        "the valve follows",
    ),
    "square that is too quick": (
        'pressure = {kind="square", low="3 bar", high="5 bar", frequency="50 Hz"}\nfor = "1 s"', {}, 2, "pressure",
        "for 10 ms; the valve needs 20 ms",
    ),
    "waveform too fast for the clock": (
        'span = {kind="sine", mean="1 L0", amplitude="0.01 L0", frequency="700 Hz"}\nfor = "1 s"',
        {"speed": 1e9, "acceleration": 1e9}, 2, "span.sine", "need 714.286 us or less",
    ),
    "until above the cell": ('until = "tension >= 200 N"\nfor = "1 s"', {}, 2, "until", "cannot happen"),
    "until above the muscle": ('until = "tension >= 60 N"\nfor = "1 s"', {}, 2, "until", "tension can be 40 N at most"),
    "until above the pressure": ('until = "pressure >= 4 bar"\nfor = "1 s"', {}, 2, "until", "pressure is set to 3 bar"),
    "until beyond the motion": (
        'span = {to = "0.9 L0", in = "1 s"}\nuntil = "span <= 0.8 L0"\nfor = "1 s"', {}, 2, "until",
        "span can be 12.6 cm at least",
    ),
    "until that would take too long": (
        'until = "pressure settled within 0.1 bar for 2 s"\nfor = "1 s"', {}, 2, "until", "lasts 1 s at most",
    ),
    "until settled while it moves": (
        'pressure = {to = "5 bar", in = "2 s"}\nuntil = "pressure settled within 0.01 bar for 0.5 s"\nfor = "2 s"',
        {}, 2, "until", "moves on all the time",
    ),
    "until moving while it holds": ('until = "velocity <= -1 L0/s"\nfor = "1 s"', {}, 2, "until", "cannot happen"),
    "no cell": ('tension = "3 N"\nfor = "1 s"', {"has": RIG.has - {"tension sensor"}}, 2, "needs", "tension sensor"),
    "no cell for a test": (
        'until = "tension >= 3 N"\nfor = "1 s"', {"has": RIG.has - {"tension sensor"}}, 2, "needs", "tension sensor",
    ),
    "no motor": ('span = {to = "0.9 L0", in = "1 s"}', {"has": RIG.has - {"motor"}}, 2, "needs", "motor"),
    "no shut-off": ('pressure = "shut"\nfor = "1 s"', {"has": RIG.has - {"shut-off"}}, 2, "needs", "shut-off"),
    "nobody there": ('ask = "turn the tap"', {"has": RIG.has - {"person"}}, 2, "needs", "person"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_what_the_rig_cannot_do_is_named_with_its_step(case):
    step, changes, index, field, words = BAD[case]
    findings = found(made(HOLD + step), dataclasses.replace(RIG, **changes))
    hits = [f for f in findings if f.step == index and f.field == field]
    assert hits, findings
    assert any(words in f.sentence for f in hits), [f.sentence for f in hits]
    assert all(f.sentence.startswith("step 2 'move': ") for f in hits)
    assert {f.step for f in findings} == {index}, "the step before is sound"
    with pytest.raises(InputError) as caught:
        check(findings, where="p.toml")
    assert "p.toml: steps.2" in str(caught.value)
    assert "\n" not in str(caught.value)


# A rig without that limit has none of these findings; the others are due to words, tests, or what muscles cannot do.
OF_THE_RIG = [
    c for c in BAD if BAD[c][3] not in ("until", "span.sine") and c not in ("a push", "load above the muscle")
]


@pytest.mark.parametrize("case", OF_THE_RIG)
def test_a_rig_without_that_limit_takes_the_same_step(case):
    step = BAD[case][0]
    free = Limits(pressure=(-1e9, 1e9), pressure_rate=1e12, tension=1e9, span=(-1e3, 1e3), speed=1e9, has=EVERYTHING)
    assert found(made(HOLD + step), free, None) == []


def test_everything_wrong_is_found_at_once_and_counted():
    text = (
        '[[steps]]\npressure = "11 bar"\nfor = "1 s"\n[[steps]]\nspan = "0.2 L0"\nfor = "1 s"\n'
        '[[steps]]\nuntil = "pressure >= 20 bar"\nfor = "1 s"\n'
    )
    findings = found(made(text, sample_rate="9 kHz"))
    assert {0, 1, 2, 3} == {f.step for f in findings}
    with pytest.raises(InputError, match=rf"sample_rate.*first of {len(findings)} findings"):
        check(findings)


def test_a_sound_protocol_raises_nothing():
    check(found(protocol("quasi-static")))


def test_missing_sensors_of_a_shipped_protocol_are_named():
    bare = dataclasses.replace(RIG, has=frozenset({"valve", "motor"}))
    findings = found(protocol("quasi-static"), bare)
    whole = {f.value for f in findings if f.step == 0}
    assert whole == {"accumulators", "pressure sensor", "span sensor", "tension sensor"}
    assert any(f.path == "steps.2" and f.value == "pressure sensor" for f in findings)  # its until


def test_a_case_is_named_and_a_repeat_is_not_named_twice():
    findings = found(protocol("quasi-static", pressure=["1 bar", "12 bar"], repeat=3))
    # three repeats; it is named where it is set, and not again by the steps that keep it or go on from it
    assert all(f.case == "pressure 12 bar" for f in findings)
    assert len({f.sentence for f in findings}) == len(findings)
    assert {f.path for f in findings if "regulator" in f.sentence} == {"steps.1"}
    assert {f.path for f in findings if f.field == "tension"} == {"steps.3", "steps.4"}  # at 1 L0, in the loops


def test_the_pressure_that_fits_does_fit_and_a_little_more_does_not():
    first = found(protocol("quasi-static", pressure="5 bar", longest="1.1 L0"))[0]
    assert "near 15.4 cm and 5 bar; the load cell reads up to 100 N" in first.sentence
    fits = float(first.sentence.split("Up to ")[-1].split(" bar")[0])
    assert found(protocol("quasi-static", pressure=f"{fits} bar", longest="1.1 L0")) == []
    # it is rounded down to 0.01 bar
    assert found(protocol("quasi-static", pressure=f"{fits + 0.02} bar", longest="1.1 L0")) != []


def test_a_line_from_an_unknown_start_is_judged_from_the_farthest_place():
    text = (
        '[[steps]]\npressure = {to = "3 bar", in = "1 s"}\n[[steps]]\ntension = {to = "20 N", in = "1 s"}\n'
        '[[steps]]\nspan = {to = "0.75 L0", in = "DURATION"}\n'
    )
    assert found(made(text.replace("DURATION", "1 s"))) == []
    (fast,) = found(made(text.replace("DURATION", "10 ms")))
    assert (fast.step, fast.field) == (3, "speed")


def test_a_speed_from_an_unknown_start_is_refused():
    text = '[[steps]]\ntension = {to = "0 N", in = "1 s"}\n[[steps]]\nspan = {to = "0.75 L0", at = "1 L0/s"}\n'
    (finding,) = found(made(text))
    assert finding.field == "steps.2.span.at"
    assert "not known in advance" in finding.allowed


def test_a_length_that_no_span_of_the_rig_has_is_refused_by_its_parameter_whatever_it_is_for():
    text = '[[steps]]\nspan = "$a"\nfor = "$t"\n[parameters.t]\nunit = "s"\nvalue = "9 s"\n'
    text += '[parameters.a]\nunit = "m"\nvalue = VALUE\n'
    longest = RIG.span[1] / L0
    for value in ('"15.6 cm"', f'["0.9 L0", "{0.999999 * longest!r} L0"]', '"-15.6 cm"'):
        check_lengths(made(text.replace("VALUE", value)), RIG, L0)
    for value in ('"15.7 cm"', f'["0.9 L0", "{1.00001 * longest!r} L0"]', '"-15.7 cm"'):
        with pytest.raises(InputError, match=r"a is .*: a length is at most 15\.6 cm, the longest span of the rig"):
            check_lengths(made(text.replace("VALUE", value)), RIG, L0)


@pytest.mark.parametrize(
    ("step", "until", "bound"),
    [
        # the motor goes down by 0.2 L0/s, or up; at rest it is before it goes
        ('span = { to = "0.9 L0", at = "0.2 L0/s" }', "velocity <= {} L0/s", -0.2),
        ('span = { to = "1.1 L0", at = "0.2 L0/s" }', "velocity >= {} L0/s", 0.2),
        ('span = { to = "1.1 L0", at = "0.2 L0/s" }', "velocity <= {} L0/s", 0.0),
        ('velocity = "-0.3 L0/s"', "velocity <= {} L0/s", -0.3),
        ('velocity = "-0.3 L0/s"', "velocity >= {} L0/s", 0.0),
        ('pressure = { to = "4 bar", in = "0.5 s" }', "pressure >= {} bar", 4.0),
        ('pressure = { to = "4 bar", in = "0.5 s" }', "pressure <= {} bar", 3.0),  # where the step before has left it
        ('pressure = { to = "2 bar", in = "0.5 s" }', "pressure <= {} bar", 2.0),
        ('span = { to = "0.9 L0", in = "0.5 s" }', "span <= {} L0", 0.9),
        ('span = { to = "0.9 L0", in = "0.5 s" }', "span >= {} L0", 1.0),
        ('span = { to = "1.1 L0", in = "0.5 s" }', "span <= {} L0", 1.0),
        ('span = { to = "1.1 L0", in = "0.5 s" }', "span >= {} L0", 1.1),
        ('pressure = { to = "4 bar", in = "0.5 s" }', "tension >= {} N", float(nylon(L0, 4e5))),
        ('pressure = { to = "4 bar", in = "0.5 s" }', "tension <= {} N", float(nylon(L0, 3e5))),
        ('pressure = { to = "2 bar", in = "0.5 s" }', "tension <= {} N", float(nylon(L0, 2e5))),
        ('tension = { to = "30 N", in = "0.5 s" }', "tension >= {} N", 100.0),  # all that the cell reads
        ('tension = { to = "30 N", in = "0.5 s" }', "tension <= {} N", 0.0),
    ],
)
def test_a_condition_may_come_true_up_to_what_is_driven_and_not_beyond(step, until, bound):
    side = 1.0 if ">=" in until else -1.0

    def never(value):
        text = f'{HOLD}{step}\nuntil = "{until.format(repr(value))}"\nfor = "1 s"'
        return [f for f in found(made(text)) if f.field == "until"]

    assert never(bound) == []
    (finding,) = never(bound + 0.001 * side)
    assert "cannot happen" in finding.sentence


@pytest.mark.parametrize(
    ("values", "share", "rests"),
    [
        ([0.0] * 10, 1.0, True),
        ([0.0] * 6 + [5.0] * 4, 0.6, True),
        ([0.0] * 6 + [5.0] * 4, 0.7, False),
        ([0.0, 1.9] * 5, 1.0, True),  # within 1 on either side
        ([0.0, 2.1] * 5, 0.2, False),
        ([0.0, 2.1] * 5, 0.1, True),  # one sample is always at rest
        (np.repeat(np.arange(20000.0), 3), 0.9, False),  # of many samples some are looked at
        (np.r_[np.arange(30000.0), np.zeros(30001)], 0.5, True),
    ],
)
def test_a_set_point_rests_if_it_stays_in_the_band_for_the_share_of_the_step(values, share, rests):
    assert _rests(np.asarray(values), 1.0, share) is rests
