"""The test machine of the screen: states, runs, stops, and set-points by hand, for whoever is in control."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from ...bench.session.status import LOST
from ...errors import InputError
from ..shelf import plain
from ..stream import Stream
from .by_hand import ByHand, Real
from .chosen import Chosen
from .console import PageConsole
from .dry import Dry
from .going import Going, RealMachine
from .kept import kept
from .log import Log
from .pace import NAMES, Pace
from .refusing import Refusing
from .states import ended, short, status_of

if TYPE_CHECKING:
    from ...bench.rig import Rig
    from ..laboratory import Laboratory

LAST = 10.0  # time for which the end of a server waits for a run to vent [s]


class Bench(Refusing):
    """One machine, simulated or real.

    Args:
        lab: its laboratory, for the shelves and for news.
        muscle: on it at first; a specimen's id.
        rig: at first, or its name. That of a real machine stays.
        real: the machine; None: a simulated one.
    """

    def __init__(
        self, lab: Laboratory, *, muscle: str = "nylon", rig: Rig | str = "paper", real: Real | None = None
    ) -> None:
        self.lab, self.stream, self.pace, self.messages = lab, Stream(), Pace(), Log()
        self._lock, self.real = threading.RLock(), real
        words = "" if real is None else real.words
        self.chosen = Chosen(lab.protocols, lab.changed, muscle=muscle, rig=rig, machine=words)
        self.chosen.told = self._dried
        self.going: Going | None = None
        self.hand: ByHand | None = None
        self.why, self.small = "", ""  # of a stop that stays until it is reset
        self.when: float | None = None  # of that stop
        self.vented = False
        self.ended: dict[str, Any] = {}  # of the last run
        self._heard = 0
        self._closing: list[threading.Thread] = []
        self.console = PageConsole(self)

    def begin(self) -> None:
        """Make the first dry run and the machine by hand ready, in threads of their own."""
        self.chosen.begin()
        self._open()

    # ---- what pages see

    def status(self) -> dict[str, Any]:
        """State, why and times."""
        self._listen()
        return status_of(self)

    def describe(self) -> dict[str, Any]:
        """What changes seldom."""
        return self.chosen.parts

    def log(self, after: int) -> list[dict[str, Any]]:
        """Messages later than that of a number."""
        return self.messages.after(after)

    def actions(self) -> Mapping[str, Callable[..., Any]]:
        """What can be done with it."""
        chosen = self.chosen
        return {
            "muscle": lambda name: self._set_up(chosen.muscle, name),
            "rig": self._choose_rig,
            "protocol": lambda name: self._change(chosen.load, name),
            "value": lambda name, words: self._change(chosen.value, name, words),
            "text": lambda text: self._change(chosen.text, text), "save": lambda name: chosen.save(str(name)),
            "dry_run": lambda: self._change(chosen.again), "cure": lambda: self._change(chosen.cure),
            "start": self.start, "pause": self.pause, "resume": self.resume, "step": self.step, "stop": self.stop,
            "reset": self.reset, "pace": self.choose_pace, "set": self.set, "vent": self.vent, "note": self.note,
            "say": self.console.answer, "complete": self.console.complete,
        }  # fmt: skip

    # ---- the choice

    def _change(self, do: Callable[..., str], *given: Any) -> str:
        self._still("the protocol")
        return do(*given)

    def _set_up(self, do: Callable[..., str], name: str) -> str:
        self._still("muscle and rig")
        if self.hand is not None and self.hand.moving:
            raise InputError("set-up", "refused", "the machine moves by hand; vent first")
        said = do(str(name))
        self.messages.say(f"{self.chosen.words()}.")
        self._open()
        return said

    def _choose_rig(self, name: str) -> str:
        self._simulated("rig", "it is what the real machine is; another one begins with mckibben serve --rig")
        return self._set_up(self.chosen.choose_rig, name)

    def _dried(self, dry: Dry) -> None:
        self.messages.say(dry.sentence, "done" if dry.passed else "stop")

    def _open(self) -> None:
        """Make the machine ready to be operated by hand, beside what else is done."""
        old, chosen = self.hand, self.chosen
        if old is not None:
            self._closing = [*(t for t in self._closing if t.is_alive()), old.closing()]
        news, own, real = self.lab.changed, self.stream, self.real
        self.hand = ByHand(chosen.rig, chosen.spec, self.pace, own, news, real=real, after=self._closing)
        self._heard = 0
        if real is not None:
            self.messages.say(real.caution, "caution")

    # ---- runs

    def start(self) -> str:
        """Begin the protocol, on a machine that is set up anew where it begins; a real one is brought there."""
        self._may("start")
        passed, hand = self.chosen.passed(), self.hand
        on = None if self.real is None or hand is None else RealMachine.of(hand, passed.protocol, self.lab.recordings)
        with self._lock:
            self._may("start")
            bench = passed if on is None else on.bench
            if on is None and hand is not None:
                hand.set_aside()
            self.ended = {}
            self.pace.begin()
            file = self.lab.recordings.numbered(plain(bench.protocol.name), ".nc")
            self.going = Going(
                bench, self.pace, self.stream, self.messages, self.lab.changed, self._over, file=file, on=on
            )
            self.messages.say("Started. Protocol, muscle and rig are saved with the recording.", "done", 0.0)
            for caution in bench.cautions:
                self.messages.say(caution, "caution", 0.0)
            self.going.start()
        return f"running {bench.protocol.name}"

    def _over(self, going: Going) -> None:
        """After the last sample of a run, from its thread."""
        with self._lock:
            why = going.over()
            if why and not self.why:
                self._trip(why, short(why), going.when)
        said = kept(going, self.lab.recordings, self.messages, why)
        with self._lock:
            self.ended = ended(going, said, why)
            self.going = None
            self.pace.halt(False)
            if self.hand is not None:
                self.hand.hold(False)
        self.lab.changed()

    def pause(self) -> str:
        """Let the time of the simulated machine stand still."""
        self._simulated("pause")
        going = self._goes("pause")
        self.pace.halt()
        said = "Paused by you. Simulated time stands still; pressure and length are held."
        self.messages.say(said, "caution", going.time)
        return f"paused at {going.time:.3f} s, holding"

    def resume(self) -> str:
        """Go on; or say that what a person was asked to do is done."""
        going = self._goes("resume")
        going.answer()
        self.pace.halt(False)
        return "running"

    def step(self, samples: int = 1) -> str:
        """Some samples where it stands still."""
        self._goes("step")
        if not self.pace.halted:
            raise InputError("step", "refused", "allowed is while the run is paused")
        self.pace.step(max(1, min(1000, int(samples))))
        return ""

    def stop(self) -> str:
        """End the run and vent; no trip, so that nothing has to be reset."""
        going = self.going
        if going is None:
            return self.vent()
        going.stop("stopped by hand", trip=False)
        return "stopped"

    def choose_pace(self, name: str) -> str:
        """How the time of the machine goes."""
        self._simulated("pace", "a real machine has its own time")
        self.pace.choose(str(name))
        return NAMES[self.pace.name]

    # ---- by hand

    def set(self, **wanted: Any) -> str:
        """Set-points: ``pressure``, and one of ``length``, ``velocity`` and ``tension``; in words or SI."""
        hand = self._by_hand("set", wanted)
        if not hand.moving:
            self.ended = {}
        given = {("span" if n == "length" else n): v if isinstance(v, str) else float(v) for n, v in wanted.items()}
        hand.asked().set(**given)
        return ""

    def vent(self) -> str:
        """Let the pressure down."""
        self._by_hand("vent", {"pressure": 0.0}).asked().vent()
        return "venting"

    def note(self, text: str) -> str:
        """A note of a person among the messages."""
        going = self.going
        self.messages.say(f"Note: {str(text)[:400]}", "note", None if going is None else going.time)
        return "noted"

    def _listen(self) -> None:
        """Take over what the session said."""
        hand = self.hand
        session = None if hand is None else hand.session
        if hand is not None and hand.failed and self.real is not None and not self.why:
            self._trip(hand.failed, "not connected", 0.0)
        if session is None or hand is None:
            return
        for message in session.messages(self._heard):
            self._heard = message.number
            kind = "stop" if message.kind == "stop" else "note"
            if kind == "stop" and session.why and not self.why and self.going is None:
                self._trip(message.text, short(message.text), message.time)
            elif message.kind == "done" or (kind == "stop" and session.why and (self.why or self.going is not None)):
                continue  # the recording says so, or the stop of the machine
            else:
                self.messages.say(message.text, kind, message.time)
        if session.gone == LOST and not self.why and self.going is None:  # its process cannot say so any more
            self._trip(session.why, short(session.why), hand.time)

    # ---- stops

    def emergency_stop(self, reason: str) -> None:
        """Vent at once, whatever goes on; until it is reset."""
        with self._lock:
            going, hand = self.going, self.hand
            self.vented = True
            time = going.time if going is not None else hand.time if hand is not None else 0.0
            if not self.why:
                done = "the valve vents, and the motor only brakes"
                self._trip(f"emergency stop at {time:.3f} s: {reason}; {done}", "emergency stop", time)
        if going is not None:
            going.stop(reason, trip=True)
        elif hand is not None and hand.session is not None:
            hand.session.emergency_stop(reason)
        self.lab.changed()

    def _trip(self, why: str, small: str, time: float) -> None:
        self.why, self.small, self.when = why, small, time
        self.messages.say(why[:1].upper() + why[1:], "stop", time)

    def reset(self) -> str:
        """After a stop: idle again, vented."""
        with self._lock:
            if self.going is not None:
                raise InputError("reset", "refused", "the run is being stopped; wait until it has vented")
            if not self.why:
                raise InputError("reset", "idle", "allowed is after a stop")
            session = None if self.hand is None else self.hand.session
            if self.real is not None and (session is None or session.gone):
                self._open()  # the line is lost, or there was none: another try
            elif session is not None and session.why:
                session.reset()
            self.why, self.small, self.when, self.vented = "", "", None, False
            self.messages.say("Reset.", "note")
        return "reset"

    def shown(self, epoch: int, samples: int) -> None:
        """The page in control has drawn so many samples of an epoch."""
        if self.going is not None and epoch == self.stream.epoch:
            self.pace.shown(samples * self.stream.period)

    def control_lost(self) -> None:
        """Nobody is in control: a run goes on, what is held by hand is held for 5 s."""
        self.pace.shown(None)
        if self.hand is not None:
            self.hand.alone(True)

    def control_back(self) -> None:
        """Somebody is again."""
        self.pace.shown(None)
        if self.hand is not None:
            self.hand.alone(False)

    def close(self) -> None:
        """Vent, and let go of all threads."""
        if self.going is not None:
            self.going.stop("the server was closed", trip=False)
            self.going.join(LAST)
        self.chosen.close()
        if self.hand is not None:
            self.hand.close()
        for closing in self._closing:
            closing.join(LAST)
