"""The state behind the screen, without a browser: controls, undo, names of files, the stream, who is let in."""

import asyncio
import contextlib
import json
import os
import socket
import sys
import threading
import time

import numpy as np
import pytest

from loops import completed
from mckibben.bench.protocol_run import RunState
from mckibben.bench.rig_file import rig
from mckibben.bench.software.interlocks import EmergencyStop
from mckibben.errors import InputError
from mckibben.experiments.read import protocol_names, shipped
from mckibben.muscles import braid
from mckibben.quantities import Quantity
from mckibben.recordings import Channel, Note, Recording, read_recording
from mckibben.web import shelf as shelf_module
from mckibben.web.bench.chosen import braid_table
from mckibben.web.bench.machine import Bench as MachineOfServer
from mckibben.web.bench.machine import RunController
from mckibben.web.bench.protocol import changed, dry_run, faces
from mckibben.web.charts import Axis, Chart, ChartLine, thinned
from mckibben.web.forms import accept, refusal, shown
from mckibben.web.guard import CROWDED, SOCKETS, SOCKETS_EACH, Guard
from mckibben.web.live import KEPT as KEPT_PAGES
from mckibben.web.live import PageConnection, PageRegistry
from mckibben.web.pages.circuit import state as circuit_state
from mckibben.web.pages.circuit.document import starts
from mckibben.web.pages.circuit.state import CircuitState, follow
from mckibben.web.pages.fit import jobs as fit_jobs
from mckibben.web.pages.fit.jobs import FitJob, FitRequest
from mckibben.web.pages.recordings import jobs as recording_jobs
from mckibben.web.server import leading_to
from mckibben.web.shelf import Shelf, plain
from mckibben.web.stream import CHANNELS, HEAD, Stream, places
from mckibben.web.workspace import AFTER, HOLD, LASTS, Control, Toasts, Workspace


def unpacked(frame):
    """A frame as a page decodes it: epoch, number of its first sample and channels (n,)."""
    _, epoch, first, n, m = HEAD.unpack_from(frame)
    values = np.frombuffer(frame, "<f4", n * m, HEAD.size).reshape(m, n)
    return epoch, first, dict(zip(CHANNELS, values, strict=False))


class Clock:
    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


class Bench:
    """The machine of a workspace, as far as it is asked here."""

    def __init__(self, workspace):
        self.stream, self.done = Stream(), []

    def status(self):
        return {"shape": "idle"}

    def describe(self):
        return {}

    def log(self, after):
        return []

    def actions(self):
        def fails(number):
            raise InputError("number", number, "must be 1")

        return {"start": lambda: "started", "fails": fails}

    def emergency_stop(self, reason):
        self.done.append(reason)

    def control_lost(self):
        self.done.append("lost")

    def control_back(self):
        self.done.append("back")

    def close(self):
        self.done.append("closed")


@pytest.fixture
def workspace(tmp_path):
    clock = Clock()
    found = Workspace(tmp_path / "recordings", Bench, clock)
    found.clock = clock
    return found


def test_the_first_page_is_in_control_and_a_reload_keeps_it(workspace):
    workspace.control.join("a")
    workspace.control.join("b")
    assert workspace.control.holds("a") and workspace.control.watching == 1
    workspace.control.leave("a")
    assert workspace.machine.done[-1] == "lost" and not workspace.control.present
    workspace.clock.now += HOLD - 0.1
    workspace.control.join("a")
    assert workspace.control.holds("a") and workspace.machine.done[-1] == "back"


def test_after_the_time_of_holding_the_only_page_left_is_in_control_and_of_several_the_one_that_asks(workspace):
    for name in "abc":
        workspace.control.join(name)
    workspace.control.leave("a")
    workspace.clock.now += HOLD + 0.1
    workspace.tick()
    assert not workspace.control.holds("b") and not workspace.control.holds("c")
    assert workspace.control.ask("c") and workspace.control.holds("c")
    workspace.control.leave("c")
    workspace.clock.now += HOLD + 0.1
    workspace.tick()
    assert not workspace.control.holds("b")  # what was held by hand is vented first
    workspace.clock.now += AFTER
    workspace.tick()
    assert workspace.control.holds("b")


def test_controls_are_handed_over_only_by_who_has_them(workspace):
    workspace.control.join("a")
    workspace.control.join("b")
    assert not workspace.control.ask("b") and workspace.control.wanted == "b"
    assert not workspace.control.give("b")
    workspace.control.keep("a")
    assert workspace.control.wanted is None
    workspace.control.ask("b")
    assert workspace.control.give("a") and workspace.control.holds("b")


def test_whoever_watches_may_stop_and_nothing_else(workspace):
    workspace.control.join("a")
    assert workspace.act("b", "emergency_stop", {"reason": "x" * 500})["ok"] and len(workspace.machine.done[-1]) == 80
    refused = workspace.act("b", "start")
    assert not refused["ok"] and "another page is in control" in refused["said"]
    assert workspace.act("a", "start") == {"ok": True, "said": "started"}
    wrong = workspace.act("a", "fails", {"number": 2})
    assert wrong["said"] == "number must be 1, got 2" and wrong["field"] == "number"
    assert not workspace.act("a", "fails", {"other": 2})["ok"] and not workspace.act("a", "close")["ok"]


def test_what_is_deleted_comes_back_within_20_s_and_is_gone_afterwards(workspace):
    workspace.recordings.store("one.nc", b"1")
    workspace.recordings.store("two.nc", b"2")
    workspace.delete("one.nc")
    assert workspace.recordings.names() == ["two.nc"]
    workspace.clock.now += LASTS - 0.1
    workspace.tick()
    assert workspace.act("x", "undo")["ok"] and set(workspace.recordings.names()) == {"one.nc", "two.nc"}
    assert workspace.recordings.found("one.nc").read_bytes() == b"1"
    workspace.delete("two.nc")
    workspace.clock.now += LASTS
    workspace.tick()
    assert not workspace.act("x", "undo")["ok"]
    assert [p.name for p in workspace.recordings.folder.rglob("*") if p.is_file()] == ["one.nc"]


def test_a_toast_waits_while_somebody_points_at_it():
    clock, undone = Clock(), []
    toasts = Toasts(clock)
    number = toasts.tell("Deleted x.", undo=lambda: undone.append(1))
    clock.now += 15.0
    toasts.wait(number, True)
    clock.now += 100.0
    toasts.tick()
    assert toasts.plain()[0]["left"] == pytest.approx(LASTS - 15.0)
    toasts.wait(number, False)
    assert toasts.undo() == "Deleted x." and undone == [1]


BAD = ["../x.nc", "a/b.nc", "/etc/passwd", "..", ".nc", ".hidden.nc", "x.exe", "x.nc\n", "a\0.nc", "x..nc", "",
       "x" * 200 + ".nc", "\u6d4b" * 80 + ".nc", "\u202ecn.nc", "con\\x.nc", "x.nc.", "C:x.nc", "~x.nc"]  # fmt: skip


def test_two_ways_back_that_are_asked_for_at_once_lead_back_two_changes(tmp_path, monkeypatch):
    bench = Workspace(tmp_path, MachineOfServer).machine
    monkeypatch.setattr(bench.chosen, "_make", lambda *_: None)  # dry runs, which are not asked for here
    opens, may_go_on = threading.Event(), threading.Event()
    monkeypatch.setattr(bench, "_open_again", lambda: None)
    for name in ("fiberglass", "bridgestone"):
        bench.actions()["muscle"](name)
    monkeypatch.setattr(bench, "_open_again", lambda: (opens.set(), may_go_on.wait(0.5)))
    first, second = threading.Thread(target=bench.undo), threading.Thread(target=bench.undo)
    first.start()
    assert opens.wait(10.0)  # the muscle of before is chosen, and its machine not yet open
    second.start()
    first.join(), second.join()
    assert bench.chosen.spec.id == "nylon"
    bench.close()


def both_at_once(first, second, begun):
    """Begin a second action while the first one is under way, and wait for both; `begun` is set within the first."""
    threads = [threading.Thread(target=one) for one in (first, second)]
    threads[0].start()
    assert begun.wait(10.0)
    threads[1].start()
    for thread in threads:
        thread.join(20.0)
        assert not thread.is_alive()


def test_a_start_waits_for_a_change_that_is_being_made_and_is_of_what_it_chose(tmp_path, monkeypatch):
    bench = Workspace(tmp_path, MachineOfServer).machine
    begun, seen = threading.Event(), []
    monkeypatch.setattr(bench.chosen, "_make", lambda *_: None)  # dry runs, which are not asked for here
    monkeypatch.setattr(bench, "_open_again", lambda: (begun.set(), time.sleep(0.3), seen.append("machine")))

    def passed():
        seen.append(bench.chosen.spec.id)
        raise InputError("start", None, "must wait for the dry run")

    monkeypatch.setattr(bench.chosen, "passed", passed)

    def start():
        with pytest.raises(InputError, match="wait for the dry run"):
            bench.start()

    both_at_once(lambda: bench.actions()["muscle"]("bridgestone"), start, begun)
    assert seen == ["machine", "bridgestone"]  # not between the choice of a muscle and that of its machine
    bench.close()


def test_two_undos_that_are_asked_for_at_once_undo_the_two_newest_actions(workspace):
    """Of the bench and of all pages: which is the newest is known when the one before is undone."""
    undone, begun, machine = [], threading.Event(), workspace.machine
    workspace.control.join("a")
    workspace.toasts.tell("Deleted x.", undo=lambda: undone.append("toast"))

    def undo():
        begun.set()
        time.sleep(0.3)
        undone.append("bench")
        type(machine).changed_at = -1.0
        return "muscle"

    machine.undo = undo
    type(machine).changed_at = workspace.clock.now + 1.0
    both_at_once(*[lambda: workspace.act("a", "undo", {"bench": True})] * 2, begun)
    assert undone == ["bench", "toast"]


def test_two_files_that_are_stored_at_once_under_one_name_are_both_kept(tmp_path, monkeypatch):
    shelf, begun, write_whole = Shelf(tmp_path / "shelf", (".nc",)), threading.Event(), shelf_module.write_whole

    def slow(path, write):
        begun.set()
        time.sleep(0.3)
        return write_whole(path, write)

    monkeypatch.setattr(shelf_module, "write_whole", slow)
    both_at_once(lambda: shelf.store("a.nc", b"one"), lambda: shelf.store("a.nc", b"other"), begun)
    assert {p.name: p.read_bytes() for p in shelf.folder.iterdir()} == {"a.nc": b"one", "a-2.nc": b"other"}


def test_two_notes_that_are_added_at_once_stay_and_undo_takes_its_own(tmp_path, monkeypatch):
    shelf, begun, write = Shelf(tmp_path / "shelf", (".nc",)), threading.Event(), recording_jobs.write
    record = Recording(np.arange(100.0), {"tension": Channel(np.arange(100.0), "N")})
    record.save(shelf.ready() / "a.nc")

    def slow(*given):
        begun.set()
        time.sleep(0.3)
        return write(*given)

    monkeypatch.setattr(recording_jobs, "write", slow)

    def note(time, words):
        return lambda: recording_jobs.rewritten(shelf, "a.nc", lambda record: record.with_note(time, words))

    both_at_once(note(1.0, "one"), note(2.0, "other"), begun)
    recording_jobs.rewritten(shelf, "a.nc", lambda record: record.without_note(Note(1.0, "one")))
    assert read_recording(shelf.path("a.nc")).notes == [Note(2.0, "other")]
    shelf.delete("a.nc")
    with pytest.raises(InputError, match="not found"):  # an answer, as of an undo that comes too late
        note(3.0, "late")()


def test_a_law_that_is_fitted_while_another_table_comes_is_not_of_that_table(tmp_path, monkeypatch):
    """Whether the work was stopped is asked and the law taken in one step, so that no table comes between the two."""
    begun, take, work = threading.Event(), FitJob._take, FitJob(None)

    def slow(job, law, result):
        if result is not None:
            begun.set()
            time.sleep(0.3)
        take(job, law, result)

    monkeypatch.setattr(FitJob, "_take", slow)
    monkeypatch.setattr(fit_jobs, "file_of", lambda _, asked: tmp_path / asked.name)
    monkeypatch.setattr(fit_jobs, "fit", lambda law, points, **_: points)
    for name in ("a.csv", "b.csv"):
        (tmp_path / name).touch()
    work.start(FitRequest("table", "a.csv"), object(), ["ideal"])
    assert begun.wait(60.0)
    work.start(FitRequest("table", "b.csv"), object(), [])
    time.sleep(0.5)  # longer than the law of the table before takes to be taken
    assert not work.fits and not work.running


def test_a_response_that_comes_late_says_nothing_of_a_circuit_that_came_meanwhile(monkeypatch):
    """What a thread computes goes through the page's own loop, which knows whether it is still of this circuit."""
    first, other = (starts()[name] for name in ("Filling a tank through a tube", "Valve, tube and muscle"))
    desk, said, respond = CircuitState(first), [], circuit_state.respond

    def late(plan, method):
        done = respond(plan, method)
        desk.take(other)
        return done

    monkeypatch.setattr(circuit_state, "respond", late)
    asyncio.run(follow(desk, said.append, said.append, lambda *given: said.append(given), said.append))
    assert said == [] and desk.method is None and desk.document == other


def test_channels_of_a_file_of_others_are_those_that_every_question_finds():
    """By name or unit, as the questions of the command line do; of a run of ours nothing is guessed."""
    channels = {n: Channel(np.arange(3.0), u) for n, u in (("weg", "m"), ("druck", "Pa"), ("cell_3", "N"))}
    found = {"length": "weg", "pressure": "druck", "tension": "cell_3"}
    assert places(Recording(np.arange(3.0), channels, {"source": {"file": "odd.csv"}})) == found
    assert places(Recording(np.arange(3.0), channels)) == {}
    two = channels | {"cell_4": channels["cell_3"]}
    assert "tension" not in places(Recording(np.arange(3.0), two, {"source": {}}))


@pytest.mark.parametrize("name", BAD)
def test_a_name_that_could_lead_elsewhere_is_refused(tmp_path, name):
    shelf = Shelf(tmp_path / "shelf", (".nc",))
    for act in (shelf.path, shelf.found, lambda n: shelf.store(n, b"1"), shelf.delete):
        with pytest.raises(InputError, match="must be|not found|Unknown"):
            act(name)
    assert not (tmp_path / "shelf").exists()


def test_nothing_is_written_over_and_links_are_no_files(tmp_path):
    shelf = Shelf(tmp_path / "shelf", (".nc",))
    assert [shelf.store("a.nc", b"1").name, shelf.store("a.nc", b"2").name] == ["a.nc", "a-2.nc"]
    assert shelf.numbered("work-loop", ".nc") == "work-loop-0001.nc"
    shelf.store("work-loop-0041.nc", b"3")
    assert shelf.numbered("other", ".nc") == "other-0042.nc"
    (tmp_path / "secret.nc").write_bytes(b"secret")
    (shelf.folder / "link.nc").symlink_to(tmp_path / "secret.nc")
    assert "link.nc" not in shelf.names()
    with pytest.raises(InputError, match="File not found"):
        shelf.found("link.nc")
    for size in (0, 11):
        with pytest.raises(InputError, match="nothing was stored"):
            shelf.store("big.nc", b"x" * size, largest=10)


def test_a_name_may_have_letters_of_any_language(tmp_path):
    shelf = Shelf(tmp_path / "shelf", (".csv",))
    for name in ("Me\u00dfwerte L\u00e4nge.csv", "\u6d4b\u8bd5-2.csv", "\u0434\u043b\u0438\u043d\u0430.csv"):
        assert shelf.store(name, b"1").name == name
        assert shelf.found(name).read_bytes() == b"1" and name in shelf.names()
    # two codes for one letter, as other systems write it, are one name
    assert shelf.path("a\u0308.csv") == shelf.path("\u00e4.csv")


def test_any_name_of_a_protocol_becomes_a_name_of_a_file(tmp_path):
    shelf = Shelf(tmp_path / "shelf", (".nc",))
    for words in ("../../etc/passwd", "<script>", "", "...", "\u00e4\u00f6", "x" * 500, "con/aux:1"):
        assert shelf.numbered(plain(words), ".nc").endswith("-0001.nc"), words


def test_a_page_gets_every_sample_once_and_after_a_loss_what_it_missed():
    stream, got, at = Stream(1000), [], (0, 0)
    stream.begin("run", "x", 1e-3)
    chance = np.random.default_rng(1)
    for k in range(40):
        n = int(chance.integers(1, 60))
        stream.add({"pressure": np.arange(stream.count, stream.count + n, dtype=float)})
        if k % 3 == 0 or k == 39:
            data, *at = stream.frame(*at)
            assert data[:8].hex() == stream.server
            epoch, first, columns = unpacked(data)
            assert epoch == 1 and first == len(got) and np.isnan(columns["tension"]).all()
            got += columns["pressure"].tolist()
    assert got == list(range(stream.count))
    assert stream.frame(*at)[0] == b""
    stream.begin("hand", "y", 1e-3, 500)
    stream.add({name: np.arange(2500.0) for name in CHANNELS})
    epoch, first, columns = unpacked(stream.frame(1, 40)[0])  # of another epoch: all that is kept
    assert (epoch, first, len(columns["flow"])) == (2, 2000, 1000)
    assert stream.latest()["flow"] == 2499.0 and stream.newest(3)["flow"].tolist() == [2497.0, 2498.0, 2499.0]


def asked(guard, path="/", kind="http", query=b"", **heads):
    """Status and headers of an answer, or None where the request went through."""
    said, through = [], []

    async def app(scope, receive, send):
        through.append(scope)

    async def receive():
        return {"type": "http.request", "body": b""}

    async def send(message):
        said.append(message)

    guard.app = app
    pairs = [(k.replace("_", "-").encode(), v.encode()) for k, v in {"host": "127.0.0.1:8080", **heads}.items()]
    scope = {"type": kind, "path": path, "query_string": query, "headers": pairs}
    completed(guard(scope, receive, send))
    return None if through else said[0]


def test_foreign_names_and_foreign_pages_are_refused_whatever_they_know():
    guard = Guard(None, "127.0.0.1", 8080)
    cookie = f"mckibben-8080={guard.token}"
    assert asked(guard, cookie=cookie) is None and asked(guard, host="localhost:8080", cookie=cookie) is None
    assert asked(guard, origin="http://127.0.0.1:8080", cookie=cookie) is None
    for heads in (
        {"host": "evil.example"}, {"origin": "http://evil.example"}, {"origin": "null"}, {"host": ""}, {"host": "["},
        {"origin": "http://127.0.0.1:9999"}, {"origin": "http://127.0.0.1:80801"}, {"origin": "http://127.0.0.1"},
        {"origin": "http://127.0.0.1:8080.evil.example"},
    ):  # fmt: skip
        assert asked(guard, cookie=cookie, **heads)["status"] == 403, heads
        assert asked(guard, kind="websocket", cookie=cookie, **heads)["type"] == "websocket.close", heads
    assert asked(guard, cookie=cookie, content_length=str(10**12))["status"] == 413
    assert asked(guard, cookie=cookie, content_length="-1")["status"] == 413


@pytest.mark.parametrize(
    "kind, said, silent",
    [
        ("http.disconnect", "No response returned.", True),
        ("http.disconnect", "another fault", False),
        ("http.request", "No response returned.", False),
    ],
)
def test_a_browser_that_left_before_its_answer_is_no_fault_but_everything_else_is(kind, said, silent):
    async def app(scope, receive, send):
        await receive()
        raise RuntimeError(said)

    async def receive():
        return {"type": kind, "body": b""}

    heads = [(b"host", b"127.0.0.1:8080"), (b"cookie", b"mckibben-8080=x")]
    scope = {"type": "http", "path": "/", "query_string": b"", "headers": heads}
    with contextlib.nullcontext() if silent else pytest.raises(RuntimeError, match=said):
        completed(Guard(app, "127.0.0.1", 8080, "x")(scope, receive, None))


def test_nothing_but_the_whole_token_in_the_cookie_of_this_server_lets_in():
    guard = Guard(None, "127.0.0.1", 8080)
    token, name = guard.token, "mckibben-8080="
    for cookie in (
        "", name, name + token[:-1], name + token[1:], name + token + "x", name + token.swapcase(), f"x{name}{token}",
        f"mckibben-8081={token}", f"mckibben={token}", token, f"{name}\u0142", f"{name};{token}",
    ):  # fmt: skip
        heads = [(b"host", b"127.0.0.1:8080"), (b"cookie", cookie.encode("latin-1", "replace"))]
        assert not guard._known({k.decode(): v.decode("latin-1") for k, v in heads}), cookie
        assert asked(guard, cookie=cookie)["status"] == 401, cookie
        assert asked(guard, query=f"token={cookie.partition('=')[2]}".encode())["status"] == (
            303 if cookie.partition("=")[2] == token else 401
        )
    assert guard._known({"cookie": name + token})


@pytest.mark.parametrize("host", ["127.0.0.1", "0.0.0.0"])
def test_every_browser_needs_the_token_once_and_then_the_cookie(host):
    guard = Guard(None, host, 8080)
    at = "localhost:8080" if host == "127.0.0.1" else "lab:8080"
    query = f"token={guard.token}&a=1".encode()
    assert len(guard.token) > 20 and guard.token != Guard(None, host, 8080).token
    for path in ("/", "/files/x.nc", "/static/lab/lab.css", "/elements/x", "/emergency-stop"):
        assert asked(guard, path, host=at)["status"] == 401
        assert asked(guard, path, host=at, query=b"token=x")["status"] == 401
    assert asked(guard, "/live", kind="websocket", host=at, query=query)["type"] == "websocket.accept"  # to say why
    assert asked(guard, "/elements/x", kind="websocket", host=at, query=query)["type"] == "websocket.close"
    came = asked(guard, "//evil.example", host=at, query=query)
    heads = dict(came["headers"])
    assert came["status"] == 303 and heads[b"location"] == b"/evil.example?a=1"  # never to another site
    assert b"HttpOnly" in heads[b"set-cookie"] and b"SameSite=Strict" in heads[b"set-cookie"]
    # a browser that a file or another site led here would not send the cookie with what it is redirected to
    led = asked(guard, host=at, query=query, sec_fetch_site="cross-site")
    assert led["status"] == 200 and dict(led["headers"])[b"set-cookie"] == heads[b"set-cookie"]
    cookie = f"mckibben-8080={guard.token}"
    for others in ("", "a=1; ", 'b={"x": "y"}; ', "mckibben-8080=old; "):  # other servers of this address have theirs
        assert asked(guard, host=at, cookie=others + cookie) is None, others
    assert asked(guard, host=at, cookie="mckibben-8080=x")["status"] == 401


def test_the_browser_is_opened_by_a_file_that_nobody_else_may_read(tmp_path):
    """The words of the command that opens it are seen by everybody on the machine."""
    place = leading_to("http://127.0.0.1:8080/?token=abc&a=1", tmp_path)
    assert place.startswith("file://") and "token" not in place
    (file,) = tmp_path.iterdir()
    assert file.stat().st_mode & 0o777 == 0o600 and "token=abc&amp;a=1" in file.read_text()


def test_the_sockets_of_a_server_are_bounded_and_the_one_that_is_too_many_hears_why():
    guard = Guard(None, "127.0.0.1", 8080, "x")

    async def go():
        held = asyncio.Event()

        async def app(scope, receive, send):
            await held.wait()

        async def line(client, path="/live"):
            said = []

            async def receive():
                return {"type": "websocket.connect"}

            async def send(message):
                said.append(message)

            heads = [(b"host", b"127.0.0.1:8080"), (b"cookie", b"mckibben-8080=x")]
            scope = {"type": "websocket", "path": path, "query_string": b"", "headers": heads, "client": (client, 1)}
            await guard(scope, receive, send)
            return said

        guard.app = app
        kept = [asyncio.create_task(line("a")) for _ in range(SOCKETS_EACH)]
        kept += [asyncio.create_task(line("b")) for _ in range(SOCKETS - SOCKETS_EACH - 1)]
        await asyncio.sleep(0)
        for_one = await line("a")
        kept.append(asyncio.create_task(line("b")))
        await asyncio.sleep(0)
        for_all, another = await line("c"), await line("c", "/elements/x")
        held.set()
        assert not any(await asyncio.gather(*kept))
        assert await line("a") == []  # there is room again
        return for_one, for_all, another

    for_one, for_all, another = completed(go())
    for accepted, closed in (for_one, for_all):  # a browser hears a reason only on a line that was accepted
        assert accepted["type"] == "websocket.accept" and closed["code"] == CROWDED
    assert (
        f"{SOCKETS_EACH} of this address open" in for_one[1]["reason"] and f"has {SOCKETS} open" in for_all[1]["reason"]
    )
    assert [m["type"] for m in another] == ["websocket.close"]


def test_an_identity_needs_its_newest_secret_and_a_name_or_an_old_one_is_worth_nothing():
    pages = PageRegistry()
    name, first = pages.admit("")
    assert pages.admit(name)[0] != name and pages.admit("")[0] != name and first != name
    pages.confirm(name)
    same, second = pages.admit(first)  # a reload
    assert same == name and second != first
    assert pages.admit(first)[0] == name  # the page did not hear of the second before its line was lost
    assert pages.admit(second)[0] != name  # which is void now
    same, third = pages.admit(first)
    pages.confirm(name)
    assert pages.admit(first)[0] != name and pages.admit(third)[0] == name


def test_a_page_may_confirm_twice_and_one_that_is_unknown_confirms_nothing():
    pages = PageRegistry()
    name, secret = pages.admit("")
    for again in (name, name, "nobody"):
        pages.confirm(again)
    assert pages.admit(secret)[0] == name


def test_identities_are_forgotten_in_the_order_in_which_they_came_last():
    pages = PageRegistry()
    names = [pages.admit("") for _ in range(KEPT_PAGES)]
    assert pages.admit(names[0][1])[0] == names[0][0]
    pages.admit("")
    assert pages.admit(names[1][1])[0] != names[1][0] and len(pages._names) <= 2 * KEPT_PAGES


def test_what_an_earlier_server_saved_of_a_run_is_found_and_nothing_else(workspace):
    workspace.recordings.store("work-loop-0001.nc", b"1")
    workspace.recordings.store("long-0002.mcap", b"2")
    for path in workspace.recordings.folder.iterdir():
        os.utime(path, (workspace.began - 9.0, workspace.began - 9.0))
    workspace.recordings.store("new-0003.nc", b"3")  # of this server
    os.utime(workspace.recordings.found("new-0003.nc"), (workspace.began + 9.0, workspace.began + 9.0))
    assert workspace.saved_before("work-loop-0001.nc") == "work-loop-0001.nc"
    assert workspace.saved_before("long-0002.nc") == "long-0002.mcap"  # the log of a real machine
    for name in ("new-0003.nc", "work-loop-0009.nc", "", "../work-loop-0001.nc/x", "\0"):
        assert workspace.saved_before(name) is None, name


def test_a_field_speaks_as_the_command_line_does_and_keeps_the_old_value():
    roughness = Quantity("m", (0.0, 1e-3), "roughness of the wall", "", (0.0, 1e-3))
    assert accept("roughness", "0.02", roughness) == pytest.approx(2e-4)  # in cm, as beside the field
    assert accept("roughness", "20 um", roughness) == pytest.approx(2e-5)
    for words in ("\u22120.01", "abc", "", "1 N", "nan", "1e9"):
        with pytest.raises(InputError, match="^roughness must be") as refused:
            accept("roughness", words, roughness)
        said = refusal(refused.value, shown(1e-5, roughness))
        assert said.endswith("The old value, 0.001, stays in use.")


@pytest.mark.parametrize("name", protocol_names())
def test_every_protocol_has_three_faces_and_its_numbers_are_fields(name):
    found = faces(shipped(name))
    said = " ".join(p["text"] for c in found["sentence"] for p in c["pieces"])
    owned = {p["name"] for c in found["sentence"] for p in c["pieces"] if "name" in p}
    shown = {f["name"] for f in found["form"]}
    assert said and owned <= shown | {p.name for p in shipped(name).parameters}
    numbers = [p.name for p in shipped(name).parameters if p.unit not in ("word",) and p.values]
    assert len(owned) >= len(numbers) - 2, (owned, numbers)  # a count of repeats stands in brackets


def test_a_bare_number_has_the_unit_beside_it_and_a_wrong_one_is_refused():
    loop = shipped("work-loop")
    assert changed(loop, "shortening", "3").variables()["shortening"] == ("3 bar",)
    assert changed(loop, "longest", "12 cm").variables()["longest"] == ("12 cm",)
    assert changed(shipped("quasi-static"), "pressure", "1, 2").variables()["pressure"] == ("1 bar", "2 bar")
    for name, words in (("shortening", "300"), ("shortening", "x"), ("nothing", "1"), ("cycles", "")):
        with pytest.raises(InputError):
            changed(loop, name, words)


def test_the_dry_run_shows_what_is_expected_and_finds_the_value_that_fits():
    from mckibben.assembly.build import unit_from_specimen
    from mckibben.specimens import specimen

    spec = specimen("nylon")
    unit, on = unit_from_specimen(spec), rig("paper")
    passed = dry_run(shipped("work-loop"), spec, unit, on)
    assert passed.passed and passed.plain["cure"] is None
    peak = {one["name"]: one["peak"] for one in passed.plain["limits"]}
    assert peak["pressure"] == pytest.approx(4.5e5) and peak["length"] == pytest.approx(0.14)
    curves = passed.plain["curves"]
    assert {len(v) for v in curves.values()} == {len(curves["time"])} and len(curves["time"]) < 6000
    fails = dry_run(changed(shipped("work-loop"), "shortening", "8"), spec, unit, on)
    assert not fails.passed and fails.plain["cure"]["words"] == "6.9 bar"  # the regulator's end
    assert dry_run(changed(shipped("work-loop"), "shortening", "6.9"), spec, unit, on).passed


def test_a_long_line_is_thinned_without_its_extremes():
    x = np.linspace(0.0, 10.0, 100_001)
    y = np.sin(3.0 * x)
    y[54_321] = 9.0
    short = thinned(x, y)
    assert len(short[0]) <= 4000 and short[1].max() == 9.0 and short[0][0] == 0.0 and short[0][-1] == 10.0
    document = Chart("n", "s", Axis("x"), Axis("y"), [ChartLine([0.0, 1.0], [np.nan, 1.0], "<b>")]).document()
    assert document["lines"][0]["y"] == [None, 1.0]


def test_the_clock_of_control_is_that_of_the_workspace():
    clock, said = Clock(), []
    control = Control(clock, lambda: said.append("lost"), lambda: said.append("back"))
    control.join("a")
    control.join("a")  # two lines of one page, as while it reloads
    control.leave("a")
    assert control.present and said == ["back", "back"]


def test_serve_says_in_one_line_what_is_missing(monkeypatch, capsys):
    from mckibben.cli import main

    monkeypatch.setitem(sys.modules, "starlette", None)  # as where it is not installed
    with pytest.raises(SystemExit) as stop:
        main(["serve", "--no-open"])
    err = capsys.readouterr().err
    assert stop.value.code == 2 and err.count("\n") == 1 and "pip install 'mckibben[web]'" in err


@pytest.mark.parametrize("words", [("--port", "{taken}"), ("--host", "192.0.2.1"), ("--host", "no such host")])
def test_an_address_where_nobody_can_listen_is_refused_before_anything_is_made_ready(words, capsys):
    from mckibben.cli import main

    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        given = [w.format(taken=taken.getsockname()[1]) for w in words]
        with pytest.raises(SystemExit) as stop:
            main(["serve", "--no-open", *given])
    err = capsys.readouterr().err
    assert stop.value.code == 2 and err.count("\n") == 1 and "nobody can listen on" in err


def test_what_a_page_draws_after_it_wanted_a_stop_lets_the_machine_go_no_further():
    """Frames that were on their way arrive after the key was pressed; until the stop is done they count for nothing."""
    told, may_stop = [], threading.Event()
    stop = {"id": 1, "act": "emergency_stop", "words": {"reason": "Esc"}}
    words = [{"epoch": 1, "shown": 10}, stop, {"epoch": 1, "shown": 90}, may_stop, {"epoch": 1, "shown": 95}]

    class Socket:
        answered = asyncio.Event()

        async def receive_text(self):
            one = words.pop(0) if words else await asyncio.Future()
            if one is may_stop:
                assert told == [10]
                may_stop.set()
                await self.answered.wait()
                one = words.pop(0)
            return json.dumps(one)

        async def send_text(self, text):
            if json.loads(text)["type"] == "answer":
                self.answered.set()

    class Stopping:
        def act(self, page, action, given):
            assert may_stop.wait(10.0)
            return {"ok": True, "said": "vented"}

        def note_drawn(self, page, epoch, samples):
            told.append(samples)

    async def go():
        line = PageConnection(Socket(), Stopping(), "a page")
        heard = asyncio.create_task(line._hear())
        while len(told) < 2:
            await asyncio.sleep(0.01)
        heard.cancel()

    completed(asyncio.wait_for(go(), 20.0))
    assert told == [10, 95]


ESC, STOP, END = ("Esc was pressed", True), ("stopped by hand", False), ("the server was closed", False)


@pytest.mark.parametrize(
    ("asked", "stopping"),
    [
        ([STOP], "stopped by hand"),
        ([STOP, END], "stopped by hand"),
        ([ESC, STOP], ""),  # while the run vents
        ([STOP, ESC], ""),
        ([None, STOP], ""),  # an interlock has stopped the run already
        ([None, ESC], ""),
    ],
)
def test_an_ordinary_stop_of_a_page_hides_no_emergency_and_no_interlock(asked, stopping):
    bench = type("Bench", (), {"clock": Clock()})()
    bench.clock.viewed = bench.clock.halt = lambda *_: None
    run = object.__new__(RunController)
    run.bench, run.button, run._answered, run.stopping = bench, EmergencyStop(), threading.Event(), ""
    run.state = RunState()
    for one in asked:
        if one is None:
            run.state = RunState(result="stopped", message="over pressure", events=[{"code": "over_pressure"}])
        else:
            run.stop(one[0], trip=one[1])
    run.state.result, run.state.message = "stopped", "as it ended"
    assert run.stopping == stopping and run.tripped == ("" if stopping else "as it ended")


def test_the_drawn_muscle_has_the_braids_angle_and_diameter():
    thread, turns = 0.16, 1.7
    found = braid_table(thread, turns)
    length = thread * np.cos(
        np.radians(np.linspace(2.05, 88.9, 3001))
    )  # between the rows, where a straight line is off most
    exact = np.asarray(braid.diameter(length, thread_length=thread, turns=turns))
    # 2e-4: what the distance of the rows was chosen for; a page shows three digits
    np.testing.assert_allclose(np.interp(length, found["length"], found["diameter"]), exact, rtol=2e-4)
    angle = np.degrees(np.asarray(braid.angle(length, thread_length=thread)))
    shown = np.degrees(np.interp(length, found["length"], found["angle"]))
    assert np.abs(shown - angle).max() < 0.05  # the page shows tenths of a degree
