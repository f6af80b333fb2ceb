"""Short versions of the shipped protocols on the paper's rig, which share compilations."""

import functools

from mckibben.assembly.build import rig_cord, unit_from_specimen
from mckibben.bench.prepare import prepare
from mckibben.bench.rig_file import rig
from mckibben.bench.run import run
from mckibben.experiments.read import parse_protocol, protocol

ADIABATIC = {f"plumbing.{name}.heat": "adiabatic" for name in ("direct", "accumulators", "10 in3", "3 in3")}


@functools.cache
def paper():
    """The paper's machine with the larger of its two valves, with which the tension of an adiabatic muscle settles."""
    return rig("paper-isothermal", ADIABATIC)


@functools.cache
def nylon(rubs=True):
    return unit_from_specimen("nylon", rubs=rubs, tendon=rig_cord())


def bench(name, *, on=None, unit=None, **values):
    options = {k: values.pop(k) for k in ("plumbing", "seed", "step", "faults", "accept_saturation") if k in values}
    wanted = name if not isinstance(name, str) else protocol(name, **values)
    return prepare(wanted, muscle=unit or nylon(), rig=on or paper(), **options)


def written(text, **options):
    head = 'schema = 1\nname = "t"\ntitle = "T"\n'
    return bench(parse_protocol(head + text, where="t.toml"), **options)


SHORT = {
    "isobaric-map": {"pressure": "3 bar", "speed": "0.5 L0/s"},
    "isokinetic": {"pressure": "4 bar", "speed": ["1 L0/s", "4 L0/s"], "rest": "0.1 s"},
    "isometric-step": {"cycles": 1, "range": "full"},
    "isotonic-triangle": {"load": "50 N", "frequency": "5 Hz", "cycles": 2},
    "lubricant-test": {"lubricant": "WD-40", "cycles": 1, "precondition": 1},
    "pneumatic-step": {"hold": "0.3 s"},
    "preconditioning": {"cycles": 1},
    "quasi-static": {"pressure": "5 bar", "cycles": 1, "precondition": 1},
    "quick-release": {"load": "20 N", "after": "0.3 s"},
    "sinusoids": {"frequency": "10 Hz", "cycles": 2, "precondition": 1},
    "work-loop": {"cycles": 1},
}


def closes(recording):
    """What the project promises: 1e-6 of what went through; mass is a sum of the same flows twice, so rounding."""
    balance = recording.meta["balance"]
    assert balance["mass"] < 1e-12, balance
    for name in ("gas", "muscle", "mechanics", "energy"):
        assert balance[name] < 1e-6, balance


@functools.cache
def triangle():
    """5 Hz, 50 N: gas, friction, motor and both controllers at work; 0.4 s are recorded."""
    return run(bench("isotonic-triangle", **SHORT["isotonic-triangle"]))
