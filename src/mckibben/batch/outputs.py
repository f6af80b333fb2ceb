"""What is kept of every variant: one number per lane made of a channel, an account of the engine, or whole channels.

Channels are those that a recording of `mckibben run` has, and only samples that it would keep count. In the sweep file:

    [outputs.peak]
    channel = "tension"
    reduce = "max"
    step = "steps"            # only while the step with this label is under way; all recorded samples where left out

| reduce | result |
|---|---|
| first, final, min, max, mean, rms | of the samples [unit of the channel] |
| integral | over time, straight between the samples [unit s] |
| area | over the channel named by `over`: the work of a loop with its sign [product of both units] |
| time_to | from the first sample until a `share` of the way from the first to the last value is passed [s] |
| drift | change over the last fifth of the samples, over the way from the first to the last value [1] |
| samples | the samples themselves, the output ``time`` with them |
| account | engine's own integral over the run, such as ``delivered`` [J] |
| balance | closure of mass, gas, muscle, mechanics, energy or exergy, as a recording's meta has it [1] |
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from ..errors import InputError, suggest
from ..schema import FileTable

RUNNING = ("first", "final", "min", "max", "mean", "rms", "integral", "area")  # made while it goes
LATER = ("time_to", "drift", "samples")  # made of kept samples
BALANCES = ("mass", "gas", "muscle", "mechanics", "energy", "exergy")
KINDS = (*RUNNING, *LATER, "account", "balance")
TIME = "time"


class Output(NamedTuple):
    """One result of every variant.

    Attributes:
        name: of the array in the store.
        reduce: one of `KINDS`.
        channel: that it is made of; the integral's or balance's name for these.
        over: second channel of an area.
        share: of the way, for ``time_to``.
        step: label of the step under way; empty for all.
    """

    name: str
    reduce: str
    channel: str
    over: str = ""
    share: float = 0.9
    step: str = ""

    @property
    def sampled(self) -> bool:
        """Whether it is made of samples, and not of the engine's integrals."""
        return self.reduce not in ("account", "balance")


USUAL = tuple(
    Output(f"{channel}.{reduce}", reduce, channel)
    for channel in ("pressure", "tension", "span")
    for reduce in ("final", "mean", "min", "max")
)


def read_outputs(top: FileTable) -> tuple[Output, ...]:
    """The outputs of a sweep file, the usual ones where it names none.

    Raises:
        InputError: names the dotted path and what is allowed.
    """
    table = top.table("outputs")
    if not table.values:
        return USUAL
    return tuple(_one(name, FileTable.of(value, table.field(name), top.where)) for name, value in table.values.items())


def _one(name: str, entry: FileTable) -> Output:
    if name == TIME or not name.strip() or "/" in name:
        raise InputError(entry.path, name, "must be another name: time and names with / are taken", where=entry.where)
    entry.only(("channel", "reduce", "over", "share", "step", "account", "balance"))
    for key in ("account", "balance"):
        if key in entry.values:
            entry.only((key,), f"with {key} goes nothing else:")
            among = BALANCES if key == "balance" else None
            return Output(name, key, entry.word(key, among=among))
    reduce = entry.word("reduce", among=(*RUNNING, *LATER))
    share = entry.number("share", "1", 0.9)
    if not 0.0 < share < 1.0:
        raise entry.fail("share", entry.values["share"], "must be more than 0 and less than 1")
    if (reduce == "area") != ("over" in entry.values):
        raise entry.fail("over", entry.values.get("over", "missing"), "an area needs it, and nothing else has it")
    return Output(name, reduce, entry.word("channel"), entry.text("over"), share, entry.text("step"))


def check_channels(outputs: Iterable[Output], known: Iterable[str], accounts: Iterable[str], where: str) -> None:
    """Refuse outputs of channels or integrals that the machine does not have."""
    channels, integrals = list(known), list(accounts)
    for one in outputs:
        allowed = channels if one.sampled else integrals if one.reduce == "account" else list(BALANCES)
        for name in filter(None, (one.channel, one.over)):
            if name not in allowed:
                said = f"{suggest(name, allowed)}known are {', '.join(allowed)}"
                key = one.reduce if not one.sampled else "over" if name == one.over else "channel"
                raise InputError(f"outputs.{one.name}.{key}", name, said, where=where)


def wanted(outputs: Iterable[Output]) -> tuple[str, ...]:
    """The channels that all of them need, each once."""
    return tuple(dict.fromkeys(c for o in outputs if o.sampled for c in (o.channel, o.over) if c))


def document(outputs: Iterable[Output]) -> dict[str, Mapping[str, Any]]:
    """As a store keeps it."""
    return {o.name: {k: v for k, v in o._asdict().items() if k != "name" and v not in ("",)} for o in outputs}
