"""What a page's line takes from it and tells it, and what a server takes at all, without a browser."""

import asyncio
import json
import logging
import sys
import threading
from types import SimpleNamespace

import pytest

from loops import completed
from mckibben.errors import InputError
from mckibben.web import guard, live
from mckibben.web.live import AT_ONCE, LONGEST, REPLACED, SILENT, Lines, PageConnection, _read, _whole


@pytest.fixture
def page():
    """A page's line to a workspace that notes what is asked of it; what it is told is in `page.sent`."""
    workspace = SimpleNamespace(
        server="this", asked=[], drawn=[], gates=[], version=0, control=SimpleNamespace(join=str, leave=str),
        note_drawn=lambda *of: workspace.drawn.append(of),
    )  # fmt: skip

    def act(page, action, words):
        workspace.asked.append((page, action, words))
        return {"ok": True, "said": action}

    workspace.act, sent = act, []

    class Socket:
        async def send_text(self, text):
            sent.append(json.loads(text))

    line = PageConnection(Socket(), workspace, "a page", lambda: sent.append("confirmed"))
    line.sent = sent
    return line


def hear(line, *messages, answers=0):
    """Let the line hear messages; return once it has given so many answers."""

    async def go():
        queue = asyncio.Queue()
        line.socket.receive_text = queue.get
        for one in messages:
            queue.put_nowait(one if isinstance(one, str) else json.dumps(one))
        heard = asyncio.create_task(line._hear())
        while queue.qsize() or sum(isinstance(s, dict) for s in line.sent) < answers:
            await asyncio.sleep(0.001)
        await asyncio.sleep(0.01)
        heard.cancel()

    completed(asyncio.wait_for(go(), 30.0))


def test_what_a_page_asks_for_is_done_in_its_order_and_a_stop_waits_for_none_of_it(page):
    """Of two values that are typed one after the other the later one counts, however long the first one takes."""
    done, stopped = [], threading.Event()

    def act(name, action, words):
        if action == "value 1":
            assert stopped.wait(10.0)
        done.append(action)
        if action == "stop":
            stopped.set()
        return {"ok": True, "said": action}

    page.workspace.act = act
    hear(page, *({"id": i, "act": one} for i, one in enumerate(("value 1", "value 2", "stop"))), answers=3)
    assert done == ["stop", "value 1", "value 2"]


@pytest.mark.parametrize(
    ("hello", "seen", "told", "stream"),
    [
        ({"server": "this", "epoch": 3, "seen": 40, "log": 7, "stream": True}, (3, 40), 7, True),
        ({"server": "another", "epoch": 3, "seen": 40, "log": 7, "stream": 1}, (0, 0), 0, True),
        ({"epoch": 3, "seen": 40, "log": 7}, (0, 0), 0, False),
        ({"server": "this", "epoch": -1, "seen": True, "log": "7"}, (0, 0), 0, False),
    ],
)
def test_a_page_of_this_server_goes_on_where_it_was_and_one_of_another_begins_anew(page, hello, seen, told, stream):
    page.remember(hello)
    assert (page._seen, page._told, page.stream) == (seen, told, stream)


def test_a_message_is_an_object_of_json_and_a_count_is_a_whole_number_that_a_browser_holds():
    assert _read('{"a": 1}') == {"a": 1}
    for text in ("", "[1]", "3", "{", "null", "[" * 10_000, '{"a": "' + "x" * LONGEST + '"}'):
        assert _read(text) == {}
    for value, count in ((5, 5), (0, 0), (2**53 - 1, 2**53 - 1), (2**53, 0), (-1, 0), (True, 0), (1.0, 0), ("1", 0)):
        assert _whole(value) == count and not isinstance(_whole(value), bool)


def test_every_action_is_answered_by_its_number_and_only_whole_words_are_taken(page):
    hear(
        page,
        {"act": "set", "id": 4, "words": {"pressure": "1 bar"}}, {"act": "vent", "id": 5, "words": [1]},
        '{"act": "long", "id": 6, "words": {"a": "' + "x" * LONGEST + '"}}', {"kept": 1},
        {"shown": 12, "epoch": 2}, {"shown": "x", "epoch": -2},
        answers=3,
    )  # fmt: skip
    assert ("a page", "set", {"pressure": "1 bar"}) in page.workspace.asked
    assert ("a page", "vent", {}) in page.workspace.asked and ("a page", "", {}) in page.workspace.asked
    answers = {one["id"]: one for one in page.sent if isinstance(one, dict)}
    assert answers[4] == {"type": "answer", "id": 4, "ok": True, "said": "set"} and answers[5]["said"] == "vent"
    assert page.sent.count("confirmed") == 1 and page.workspace.drawn == [("a page", 2, 12), ("a page", 0, 0)]


@pytest.mark.parametrize(
    ("acts", "stops", "act", "taken"),
    [(AT_ONCE - 1, 0, "set", True), (AT_ONCE, 0, "set", False), (AT_ONCE, AT_ONCE - 1, "stop", True),
     (0, AT_ONCE, "emergency_stop", False), (0, AT_ONCE, "set", True)],
)  # fmt: skip
def test_actions_and_stops_without_an_answer_are_bounded_each_by_itself(page, acts, stops, act, taken):
    page._acts, page._stops = acts, stops
    hear(page, {"act": act, "id": 1}, answers=1)
    (answer,) = page.sent
    assert answer["ok"] is taken and bool(page.workspace.asked) is taken
    assert taken or "too many requests: 32 of this page" in answer["said"]
    assert (page._acts, page._stops) == (acts, stops)  # with its answer its place is free again


def test_a_page_with_a_stop_on_its_way_lets_the_machine_go_no_further(page):
    page._stops = 1
    hear(page, {"shown": 12, "epoch": 2})
    assert page.workspace.drawn == []


def test_a_page_is_told_what_is_new_and_nothing_twice(page):
    status, log = {"moving": False}, []
    parts, toasts = {"bench": {"a": 1}}, SimpleNamespace(plain=lambda: [{"number": 1, "waits": False, "age": clock[0]}])
    clock, head = [0.0], [{"epoch": 1}]
    page.workspace.told = lambda: json.dumps(status, separators=(",", ":"))
    page.workspace.toasts = toasts
    machine = SimpleNamespace(describe=lambda: parts, log=lambda after: [m for m in log if m["number"] > after])
    stream = SimpleNamespace(head=lambda: head[0])

    def told():
        page.sent.clear()
        completed(page._new(machine, stream))
        return [one["type"] for one in page.sent]

    assert told() == ["part", "epoch", "toasts", "status"] and not page._moving
    clock[0], status["moving"] = 5.0, True
    log += [{"number": 3}, {"number": 4}]
    assert told() == ["status", "log"] and page._moving and page._told == 4
    parts["bench"] = {"a": 1}  # made anew
    assert told() == ["part", "status"]
    toasts.plain, head[0] = (lambda: [{"number": 1, "waits": True}]), {"epoch": 2}
    assert told() == ["epoch", "toasts", "status"]


def test_what_others_make_a_server_write_is_bounded_and_below_a_warning_nothing_is_written(monkeypatch):
    root = logging.Logger("root")
    monkeypatch.setattr(logging, "getLogger", lambda *_: root)
    handler = guard.bound_log()
    assert root.handlers == [handler] and handler.level == logging.WARNING
    assert [type(one) for one in handler.filters] == [guard.BoundedLog]


@pytest.mark.parametrize(
    ("soft", "hard", "set_to", "most"),
    [
        (1024, 65536, 4096, 256), (1024, 2000, 2000, 256), (1024, 800, 800, 200), (8192, 8192, None, 256),
        (-1, -1, None, 256), (1024, -1, 4096, 256), (640, 640, 640, 160), (636, 636, 636, None), (4096, 65536, None, 256),
    ],
)  # fmt: skip
@pytest.mark.skipif(sys.platform == "win32", reason="descriptors are counted otherwise")
def test_a_server_asks_for_descriptors_and_refuses_to_begin_with_too_few(monkeypatch, soft, hard, set_to, most):
    import resource

    limits, asked = [soft, hard], []
    monkeypatch.setattr(resource, "RLIM_INFINITY", -1)
    monkeypatch.setattr(resource, "getrlimit", lambda _: tuple(limits))
    monkeypatch.setattr(resource, "setrlimit", lambda _, pair: asked.append(pair))
    if most is None:
        with pytest.raises(InputError, match=f"ulimit -n must be 640 or more.*got {set_to}"):
            guard.reserve_descriptors()
    else:
        assert guard.reserve_descriptors() == most
    assert asked == ([] if set_to is None else [(set_to, hard)])


def test_only_addresses_of_this_machine_are_of_this_machine():
    assert all(map(guard.is_loopback, ("127.0.0.1", "127.9.8.7", "::1", "localhost")))
    assert not any(
        map(guard.is_loopback, ("0.0.0.0", "::", "10.0.0.1", "192.168.1.2", "example.org", "", "localhost.org"))
    )


class Line:
    """The socket of a page as a server has it: what the page says, and what it is told."""

    def __init__(self, *messages):
        self.coming, self.sent, self.closed = asyncio.Queue(), [], None
        for one in messages:
            self.coming.put_nowait(json.dumps(one))

    async def receive_text(self):
        text = await self.coming.get()
        if text is None:
            raise RuntimeError("the line is lost")
        return text

    async def send_text(self, text):
        self.sent.append(json.loads(text))

    async def close(self, code, reason):
        self.closed = code, reason
        self.coming.put_nowait(None)


def workspace_of(calls):
    stream = SimpleNamespace(head=lambda: 1, frame=lambda *seen: (b"", 1, 2))
    machine = SimpleNamespace(stream=stream, describe=dict, log=lambda after: [])
    control = SimpleNamespace(
        join=lambda page: calls.append(("join", page)), leave=lambda page: calls.append(("leave", page))
    )
    return SimpleNamespace(
        server="this", version=0, control=control, changed=lambda: calls.append("changed"), machine=machine,
        told=lambda: '{"moving":false}', toasts=SimpleNamespace(plain=list), saved_before=lambda file: f"saved {file}",
        act=lambda page, action, words: calls.append((page, action, words)) or {"said": "stopped"},
    )  # fmt: skip


def test_a_page_has_one_line_the_one_before_ends_and_what_an_earlier_server_saved_is_told(monkeypatch):
    calls = []

    async def go():
        lines, first = Lines(workspace_of(calls), {"version": "1"}), Line({"server": "old", "file": "a.nc"})
        one = asyncio.create_task(lines.run(first))
        while not first.sent:
            await asyncio.sleep(0.001)
        (hello, *_) = first.sent
        again = Line({"server": "this", "secret": hello["secret"], "file": "a.nc"})
        two = asyncio.create_task(lines.run(again))
        await asyncio.wait_for(one, 10.0)  # it ended when the other came
        assert list(lines._open) == [hello["page"]]
        again.coming.put_nowait(None)
        await asyncio.wait_for(two, 10.0)
        assert not lines._open and first.closed == (REPLACED, "The page has another line now.") and again.closed is None
        return hello, again.sent[0]

    hello, greeted = completed(go())
    page = hello["page"]
    assert hello == {"type": "hello", "server": "this", "page": page, "secret": hello["secret"], "saved": "saved a.nc",
                     "version": "1"}  # fmt: skip
    assert (greeted["page"], greeted["saved"]) == (page, None) and greeted["secret"] != hello["secret"]
    assert len(page) == 12 and len(hello["secret"]) == 32  # 6 bytes in hexadecimal, 24 in letters of six bits
    assert calls == [("join", page), "changed", ("join", page), "changed", *[("leave", page), "changed"] * 2]


def test_a_line_that_says_nothing_is_closed_and_a_stop_needs_no_page(monkeypatch):
    monkeypatch.setattr(live, "FIRST", 0.01)
    calls, silent = [], Line()
    workspace = workspace_of(calls)
    completed(Lines(workspace, {}).run(silent))
    assert silent.closed[0] == SILENT and not silent.sent and not calls
    assert completed(live.stop_at_once(workspace, "Esc")) == "stopped"
    assert calls == [("nobody", "emergency_stop", {"reason": "Esc"})]


def test_a_page_that_streams_gets_each_frame_from_where_it_was(page):
    frames, asked = [b"one", b"", b"two"], []

    def frame(epoch, count):
        asked.append((epoch, count))
        return (frames.pop(0) if frames else b""), 4, count + 10

    told = []

    async def send_bytes(data):
        told.append(data)

    async def new(*_):
        told.append("new")

    async def go(stream):
        page.stream, page.socket.send_bytes, page._new = stream, send_bytes, new
        page.workspace.machine = SimpleNamespace(stream=SimpleNamespace(frame=frame))
        task = asyncio.create_task(page._tell())
        while stream and len(asked) < 4:
            await asyncio.sleep(0.001)
        await asyncio.sleep(0.1)
        task.cancel()

    completed(go(False))
    assert told == ["new"] and not asked, "what has not changed is told once"
    completed(go(True))
    assert told == ["new", "new", b"one", b"two"]
    assert asked[:4] == [(0, 0), (4, 10), (4, 20), (4, 30)]


def test_while_something_moves_a_page_is_told_at_every_beat(page):
    told = []

    async def new(*_):
        told.append(asyncio.get_running_loop().time())
        page._moving = True

    async def go():
        page.stream, page._new, page.workspace.machine = False, new, SimpleNamespace(stream=None)
        task = asyncio.create_task(page._tell())
        while len(told) < 4:
            await asyncio.sleep(0.001)
        task.cancel()

    completed(go())
    assert all(later - earlier > live.BEAT for earlier, later in zip(told, told[1:], strict=False))


@pytest.mark.parametrize("close", [False, True])
def test_the_reason_of_a_closed_line_is_no_longer_than_a_frame_holds(close):
    sent, taken = [], []

    async def receive():
        taken.append(1)

    async def send(message):
        sent.append(message)

    if close:
        completed(guard._close(receive, send, 4429, "x" * 500))
    else:
        completed(guard._refuse({"type": "websocket"}, receive, send, 403, "x" * 500))
    assert sent[-1] == {"type": "websocket.close", "code": 4429 if close else 1008, "reason": "x" * 120}
    assert len(sent) == 1 + close and taken == [1]


def test_a_record_of_a_log_is_cut_where_it_is_longer_than_its_bound_and_the_budget_comes_back_by_half_a_line_a_second():
    now = [0.0]
    bounded = guard.BoundedLog(lambda: now[0])

    def written(text):
        record = logging.LogRecord("a", logging.ERROR, "a.py", 1, text, (), None)
        return record.getMessage() if bounded.filter(record) else None

    assert written("x" * guard.LONGEST) == "x" * guard.LONGEST
    assert (
        written("x" * guard.LONGEST + "y")
        == "x" * (guard.LONGEST // 2) + "\n ..\n" + "x" * (guard.LONGEST // 2 - 1) + "y"
    )
    assert [written("a") for _ in range(19)] == ["a"] * 18 + [None]  # 20 at once
    now[0] = 8.0
    assert [written("a") for _ in range(5)] == ["a (1 more were left out before)", "a", "a", "a", None]


@pytest.mark.parametrize(("length", "status"), [("20", 200), ("21", 413), ("2x", 413), ("", 413)])
def test_a_body_may_be_as_long_as_its_bound_and_a_length_is_a_number(length, status, monkeypatch):
    monkeypatch.setattr(guard, "LARGEST", 20)
    one, sent, heard = guard.Guard(None, "127.0.0.1", 1, "t"), [], []

    async def app(scope, receive, send):
        heard.append([name for name, _ in scope["headers"]])
        await send({"type": "http.response.start", "status": 200, "headers": []})

    async def send(message):
        sent.append(message)

    one.app = app
    heads = {"host": "127.0.0.1:1", "cookie": "mckibben-1=t", "accept-encoding": "gzip", "content-length": length}
    for accept in ("*/*", "text/html"):
        pairs = [(name.encode(), value.encode()) for name, value in {**heads, "accept": accept}.items()]
        completed(one({"type": "http", "path": "/x", "headers": pairs}, None, send))
    assert [message["status"] for message in sent if "status" in message] == [status] * 2
    if status == 200:  # a page is not packed, for its scripts get a nonce
        assert [b"accept-encoding" in names for names in heard] == [True, False]
