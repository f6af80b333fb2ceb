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
from mckibben.web import guard
from mckibben.web.live import AT_ONCE, LONGEST, PageConnection, _read, _whole


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
