"""The control port: every answer, its token, and everything that a client may do wrong or with bad intent."""

import json
import socket
import subprocess
import sys

import pytest
from box_support import inside
from control_support import Http, control_box

from protocol.primary.messages import ReportLevel
from ur_emulator import ControlBox
from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import EmulatorError
from ur_emulator.host.box_options import MAX_TOKEN
from ur_emulator.host.control_api.operations import OPERATIONS

JSON = "Content-Type: application/json"


@pytest.fixture(scope="module")
def box():
    """One box for all: whatever is done to it, it must go on."""
    with control_box(in_process=True) as box:
        yield box


@pytest.fixture
def http(box):
    with Http(box) as http:
        yield http


@pytest.fixture(autouse=True)
def the_box_answers_afterwards(box):
    yield
    with Http(box) as http:
        status, state = http.ask("GET", "/v1/state")
    assert (status, state["robot_mode"]) == (200, "RUNNING")
    assert state["safety_mode"] == "NORMAL"


# --- what it is for


def test_the_state_and_the_operations_describe_themselves(box, http):
    status, state = http.ask("GET", "/v1/state")
    assert (status, http.headers["content-type"]) == (200, "application/json")
    assert (state["q"], state["tick"]) == (pytest.approx(box.state.q), box.state.tick)
    status, table = http.ask("GET", "/v1/operations")
    assert (status, [row["name"] for row in table["operations"]]) == (200, list(OPERATIONS))


def test_an_operation_is_done_when_it_is_answered(box, http):
    done = http.ask("POST", "/v1/set_digital_input", {"group": "tool", "n": 1, "level": True})
    assert done == (200, {"tick": box.state.tick})
    assert box.state.digital_inputs["tool"] == (False, True)
    assert http.ask("POST", "/v1/close_popups")[0] == 200  # all defaults are taken without a body
    assert http.ask("POST", "/v1/close_popups", b"", headers=[JSON])[0] == 200


def test_the_log_is_read_on_where_it_was_left_off(http):
    http.ask("POST", "/v1/add_to_log", {"text": "first"})
    _, log = http.ask("GET", "/v1/log")
    assert log["entries"][-1]["text"] == "first"
    assert log["entries"][-1]["source"] == "Control"
    http.ask("POST", "/v1/add_to_log", {"text": "second"})
    _, more = http.ask("GET", f"/v1/log?after={log['next']}")
    assert [entry["text"] for entry in more["entries"]] == ["second"]
    assert more["next"] == log["next"] + 1
    assert http.ask("GET", f"/v1/log?after={more['next']}")[1] == {"entries": [], "next": more["next"]}
    assert http.ask("GET", "/v1/log?level=FAULT&after=999999")[1] == {"entries": [], "next": 999_999}


def test_an_answer_has_some_entries_of_a_long_log_and_the_next_one_the_others(box, http):
    start = inside(box)._box.log.count
    for k in range(2 * BUDGETS.log_entries + 10):
        inside(box)._box.log.write(0, "Test", f"{k}", ReportLevel.FAULT if k % 2 else ReportLevel.INFO)
    texts, sizes, after = [], [], start
    while not sizes or sizes[-1]:
        page = http.ask("GET", f"/v1/log?after={after}")[1]
        sizes.append(len(page["entries"]))
        texts += [entry["text"] for entry in page["entries"]]
        after = page["next"]
    assert sizes == [BUDGETS.log_entries, BUDGETS.log_entries, 10, 0]
    assert texts == [f"{k}" for k in range(2 * BUDGETS.log_entries + 10)]
    page = http.ask("GET", f"/v1/log?after={start}&level=FAULT")[1]
    assert [entry["text"] for entry in page["entries"]] == texts[1 : 2 * BUDGETS.log_entries : 2]
    assert page["next"] == start + 2 * BUDGETS.log_entries


def test_a_wait_is_answered_when_it_is_over_and_others_are_served_meanwhile(box, http):
    http.send(http.request("POST", "/v1/wait_until", {"log": "the end of all waiting", "timeout": 60}))
    with Http(box) as other:
        assert other.ask("GET", "/v1/state")[0] == 200
        other.ask("POST", "/v1/add_to_log", {"text": "the end of all waiting"})
    assert http.answer()[0] == 200


# --- errors


@pytest.mark.parametrize(
    ("method", "path", "body", "status", "words"),
    [
        ("POST", "/v1/push", {}, 400, "needs force"),
        ("POST", "/v1/push", b'{"force": [0, 0, NaN]}', 400, "NaN is not a number"),
        ("POST", "/v1/push", b'{"force": [0, 0, 1e999]}', 400, "three numbers"),
        ("POST", "/v1/push", b'{"force": [0, 0, 1' + b"0" * 4000 + b"]}", 400, "three numbers"),
        ("POST", "/v1/push", b'{"force": [0, 0, 1' + b"0" * 5000 + b"]}", 400, "not JSON"),
        ("POST", "/v1/push", b"force=1", 400, "not JSON"),
        ("POST", "/v1/push", b"[1, 2]", 400, "JSON object"),
        ("POST", "/v1/push", b"\xff\xfe", 400, "not JSON"),
        ("POST", "/v1/push", b"[" * 60_000, 400, "not JSON"),
        ("POST", "/v1/add_to_log", b'{"text": "\\ud800"}', 400, "text"),
        ("POST", "/v1/run_program", {"script": "def f("}, 400, "does not compile"),
        ("POST", "/v1/unlock_protective_stop", {}, 409, "no protective stop"),
        ("POST", "/v1/wait_until", {"robot_mode": "IDLE", "timeout": 0}, 408, "in vain"),
        ("GET", "/v1/log?after=x", None, 400, "after 'x'"),
        ("GET", "/v1/log?before=3", None, 400, "before"),
        ("GET", "/v1/log?" + "a=1&" * 50, None, 400, "too many"),
        ("GET", "/v1/state?x=1", None, 400, "it takes none"),
        ("GET", "/", None, 404, "/v1/operations"),
        ("GET", "/v1/nope", None, 404, "nope"),
        ("GET", "/v2/state", None, 404, "v2"),
        ("GET", "*", None, 404, "no"),
        ("GET", "http://[/v1/state", None, 404, "http://["),
        ("GET", "/v1/push", None, 405, "POST"),
        ("POST", "/v1/state", {}, 405, "GET"),
        ("OPTIONS", "/v1/push", None, 405, "POST"),
        ("X" * 200, "/v1/push", None, 405, "POST"),
    ],
)
def test_a_mistake_is_answered_in_one_line_and_the_connection_stays(http, method, path, body, status, words):
    got, answer = http.ask(method, path, body)
    assert got == status
    assert list(answer) == ["error"]
    assert words in answer["error"]
    assert "\n" not in answer["error"]
    assert len(answer["error"]) < 400
    if status == 405:
        assert http.headers["allow"] in ("GET", "POST")
    assert http.ask("GET", "/v1/state")[0] == 200


def test_what_the_box_does_not_do_is_answered_with_409(box, http):
    box.emergency_stop()
    for name in ("power_on", "release_brakes", "protective_stop", "confirm_safety", "resume_program"):
        status, answer = http.ask("POST", f"/v1/{name}", {})
        assert status == 409
        assert list(answer) == ["error"]
    box.release_emergency_stop()
    for name, mode in (("power_on", "IDLE"), ("release_brakes", "RUNNING")):
        assert http.ask("POST", f"/v1/{name}", {})[0] == 200
        box.wait_until(robot_mode=mode)
    assert http.ask("POST", "/v1/power_on", {})[0] == 200  # it has its power


def test_a_body_must_say_that_it_is_json(http):
    for kind in ("text/plain", "application/x-www-form-urlencoded", ""):
        status, answer = http.ask("POST", "/v1/power_off", {}, headers=[f"Content-Type: {kind}"])
        assert status == 400
        assert "application/json" in answer["error"]
    assert (
        http.ask("POST", "/v1/close_popups", {}, headers=["Content-Type: Application/JSON; charset=utf-8"])[0]
        == 200
    )


# --- pages in somebody's browser


@pytest.mark.parametrize(
    "host",
    [
        "evil.example:80", "127.0.0.1.evil.example", "0.0.0.0", "127.0.0.2", "", "[", "[::1]", "localhost:80@evil.example",
        "localhost:80:80", "localhost/evil.example", "localhost evil.example",
    ],
)  # fmt: skip
def test_a_foreign_name_that_resolves_to_this_machine_is_refused(http, host):
    status, answer = http.ask("POST", "/v1/power_off", {}, host=host)
    assert status == 403
    assert "host" in answer["error"]
    assert http.ask("GET", "/v1/state", host=host)[0] == 403


def test_the_own_address_and_localhost_and_what_a_browser_itself_asks_are_taken(http):
    for host in ("127.0.0.1", "localhost", "LOCALHOST:1234", "127.0.0.1:80"):
        assert http.ask("GET", "/v1/state", host=host)[0] == 200
    for site in ("none", "same-origin"):
        assert http.ask("GET", "/v1/state", headers=[f"Sec-Fetch-Site: {site}"])[0] == 200


def test_a_box_on_all_addresses_takes_any_address_but_no_name():
    token = ["Authorization: Bearer abc"]
    with control_box(in_process=True, host="0.0.0.0", control_token="abc") as box, Http(box) as http:
        assert http.ask("GET", "/v1/state", host="192.168.7.7:80", headers=token)[0] == 200
        assert http.ask("GET", "/v1/state", host="evil.example", headers=token)[0] == 403


@pytest.mark.parametrize(
    "header",
    [
        *(f"Origin: {it}" for it in ("http://evil.example", "null", "https://127.0.0.1:1", "http://[", "")),
        *(
            f"Sec-Fetch-Site: {it}"
            for it in ("cross-site", "same-site", "", "Cross-Site", "none, cross-site")
        ),
    ],
)
def test_a_page_of_another_origin_or_site_is_refused(http, header):
    for method, path in (("POST", "/v1/power_off"), ("GET", "/v1/state")):
        status, answer = http.ask(method, path, headers=[header])
        assert status == 403
        assert "pages" in answer["error"]


# --- bytes


@pytest.mark.parametrize(
    "data",
    [
        b"\x00" * 100,
        b"GET /v1/state\r\n\r\n",
        b"GET /v1/state HTTP/1.1\r\n\r\n",  # without a host
        b"GET /v1/state HTTP/9.9\r\nHost: localhost\r\n\r\n",
        b"GET /v1/state HTTP/1.1\r\nHost: localhost\r\nHost: localhost\r\n\r\n",
        b"GET /v1/state HTTP/1.1\r\nHost : localhost\r\n\r\n",
        b"POST /v1/push HTTP/1.1\r\nHost: localhost\r\nContent-Length: -1\r\n\r\n",
        b"POST /v1/push HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1\r\nContent-Length: 2\r\n\r\nxx",
        b"POST /v1/push HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\nzz\r\n",
        b"POST /v1/push HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: gzip\r\n\r\n",
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + b"\x11" * 100,
        b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
    ],
)
def test_what_is_no_http_is_answered_and_closed(http, data):
    http.send(data)
    status, answer = http.answer()
    assert status in (400, 501, 505)
    assert "HTTP " in answer["error"] or answer["error"].startswith("not understood")
    assert http.is_closed()


def test_a_body_in_chunks_that_is_too_long_is_refused(http):
    head = f"POST /v1/add_to_log HTTP/1.1\r\nHost: localhost\r\n{JSON}\r\nTransfer-Encoding: chunked\r\n\r\n"
    chunks, rest = divmod(BUDGETS.body_bytes, 0x1000)
    assert not rest
    http.send(head.encode() + chunks * (b"1000\r\n" + b"x" * 0x1000 + b"\r\n") + b"1\r\nx")
    status, answer = http.answer()
    assert status == 413
    assert str(BUDGETS.body_bytes) in answer["error"]


def test_a_request_that_trickles_in_is_understood_and_holds_up_nobody(box, http):
    data = http.request("POST", "/v1/set_speed", {"fraction": 0.5})
    for k in range(len(data)):
        http.send(data[k : k + 1])
        if k % 40 == 0:
            with Http(box) as other:
                assert other.ask("GET", "/v1/state")[0] == 200
    assert http.answer()[0] == 200
    assert http.ask("POST", "/v1/set_speed", {"fraction": 1})[0] == 200


def test_requests_sent_ahead_are_answered_in_order(box, http):
    start = inside(box)._box.log.count
    texts = [f"line {n}" for n in range(50)]
    http.send(b"".join(http.request("POST", "/v1/add_to_log", {"text": text}) for text in texts))
    http.sock.shutdown(socket.SHUT_WR)  # who says no more still gets its answers
    assert [http.answer()[0] for _ in texts] == [200] * 50
    assert http.is_closed()
    written = [entry.text for entry in inside(box)._box.log.since(start)]
    assert [text for text in written if text.startswith("line ")] == texts


def test_who_sends_ahead_is_read_when_its_answer_has_been_sent(box, http):
    http.send(http.request("POST", "/v1/wait_until", {"log": "go on", "timeout": 60}))
    request = http.request("GET", "/v1/state", headers=["X: " + "x" * 4000])
    for _ in range(50):
        http.send(request)
    with Http(box) as other:
        for _ in range(50):
            assert other.ask("GET", "/v1/state")[0] == 200
        sessions = inside(box)._port_set._ports["control"]._sessions.values()
        (waiting,) = (s for s in sessions if s._request and s._request.target == b"/v1/wait_until")
        assert len(waiting.http.trailing_data[0]) <= 2 * BUDGETS.read_bytes
        assert other.ask("POST", "/v1/add_to_log", {"text": "go on"})[0] == 200
    assert [http.answer()[0] for _ in range(51)] == [200] * 51


def test_who_goes_while_it_waits_is_forgotten(box):
    for _ in range(10):
        with Http(box) as http:
            http.send(http.request("POST", "/v1/wait_until", {"robot_mode": "IDLE", "timeout": 60}))
    with Http(box) as http:
        for _ in range(1000):
            assert http.ask("GET", "/v1/state")[0] == 200
            if not inside(box)._box.steps._under_way:
                return
    raise AssertionError("they are waited for still")


def test_a_client_that_reads_nothing_is_cut_off(http):
    with pytest.raises(ConnectionError):
        http.send(http.request("GET", "/v1/operations") * 200_000)


def test_a_client_asks_before_it_sends_its_body(http):
    body = json.dumps({"fraction": 1}).encode()
    head = http.request("POST", "/v1/set_speed", body, headers=["Expect: 100-continue", JSON])
    http.send(head.removesuffix(body))
    assert http.answer()[0] == 100
    http.send(body)
    assert http.answer()[0] == 200


def test_http_1_0_and_close_are_answered_and_closed(box):
    with Http(box) as http:
        http.send(b"GET /v1/state HTTP/1.0\r\nHost: localhost\r\n\r\n")
        assert http.answer()[0] == 200
        assert http.is_closed()
    with Http(box) as http:
        assert http.ask("GET", "/v1/state", headers=["Connection: close"])[0] == 200
        assert http.is_closed()


def test_head_is_refused_without_a_body(http):
    http.send(http.request("HEAD", "/v1/state"))
    assert b"405" in http.stream.readline()


def test_the_most_silent_client_makes_room_for_a_new_one(box):
    clients = [Http(box) for _ in range(BUDGETS.control_clients)]
    try:
        for client in (*clients, clients[0]):
            assert client.ask("GET", "/v1/state")[0] == 200
        # Now the second is the most silent one.
        with Http(box) as late:
            assert late.ask("GET", "/v1/state")[0] == 200
        assert clients[1].is_closed()
        assert clients[0].ask("GET", "/v1/state")[0] == 200
    finally:
        for client in clients:
            client.__exit__()


def test_clients_of_a_box_that_ends_are_informed():
    with control_box(in_process=True) as box:
        http = Http(box)
        http.send(http.request("POST", "/v1/wait_until", {"robot_mode": "IDLE", "timeout": 60}))
        with Http(box) as other:  # so that the wait has begun
            other.ask("GET", "/v1/state")
    with http:
        status, answer = http.answer()
        assert status == 503
        assert "ended" in answer["error"]


def test_there_is_no_port_unless_it_is_asked_for(box):
    with control_box(in_process=True, control_port=None) as other:
        assert other.control_port == 0
        assert "control" not in other.identity["ports"]


TOKEN = "correct-horse"


@pytest.fixture(scope="module")
def guarded_box():
    with control_box(in_process=True, control_token=TOKEN) as box:
        yield box


@pytest.fixture
def guarded(guarded_box):
    with Http(guarded_box) as http:
        yield http


def test_every_operation_needs_the_token(guarded):
    for name in ("operations", *OPERATIONS):
        method = "GET" if name == "operations" or OPERATIONS[name].only_reads else "POST"
        status, answer = guarded.ask(method, f"/v1/{name}")
        assert (status, guarded.headers["www-authenticate"]) == (401, "Bearer")
        assert list(answer) == ["error"]
        assert "Authorization: Bearer" in answer["error"]
        assert TOKEN not in str(answer)


@pytest.mark.parametrize(
    "shown",
    [
        "", "Bearer", "Bearer ", TOKEN, f"Basic {TOKEN}", f"Bearer {TOKEN}x", f"Bearer {TOKEN[:-1]}",
        f"Bearer {TOKEN.upper()}", f"Bearer x {TOKEN}", f"Bearer {TOKEN}\xe9",
    ],
)  # fmt: skip
def test_another_token_does_not_do(guarded_box, guarded, shown):
    asked = guarded.request("POST", "/v1/trigger_fault", headers=[f"Authorization: {shown}"])
    guarded.send(asked.decode().encode("latin-1"))
    assert guarded.answer()[0] == 401
    assert guarded_box.state.safety_mode == "NORMAL"


def test_with_the_token_all_is_done_on_the_same_connection(guarded):
    assert guarded.ask("GET", "/v1/state")[0] == 401
    for scheme in ("Bearer", "bearer", "BEARER "):
        assert guarded.ask("GET", "/v1/state", headers=[f"Authorization: {scheme} {TOKEN}"])[0] == 200
    assert guarded.ask("GET", "/v1/state")[0] == 401
    shown = f"Authorization: Bearer {TOKEN}"  # pages are refused also with it
    assert guarded.ask("GET", "/v1/state", headers=[shown, "Origin: http://evil.example"])[0] == 403
    assert guarded.ask("GET", "/v1/state", headers=[shown], host="evil.example")[0] == 403


@pytest.mark.parametrize(
    ("options", "told"),
    [
        *(({"control_token": it}, "1 to 200 printed characters of ASCII") for it in ("", "two words", "a\nb", "caf\xe9", "x" * (MAX_TOKEN + 1))),
        *(({"host": it}, "give it a token") for it in ("0.0.0.0", "::", "192.0.2.1", "box.example", "127.0.0.1.example")),
        ({"control_port": -1}, "-1"),
        ({"control_port": 65536}, "65536"),
    ],
)  # fmt: skip
def test_a_control_port_that_cannot_be_is_refused(options, told):
    with pytest.raises(EmulatorError, match=told):
        ControlBox(**{"control_port": 0, "port_base": None, **options})


@pytest.mark.parametrize("host", ["127.9.9.9", "localhost", "::1"])
def test_on_loopback_a_control_port_demands_no_token(host):
    ControlBox(host=host, control_port=0, port_base=None, in_process=True).close()


def test_a_client_alone_knows_the_names_of_operations():
    code = (
        "from ur_emulator.host.control_api.http_client import ControlClient\n"
        "from ur_emulator.host.control_api.step_operations import ReadState\n"
        "print(ReadState.api_name)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "state\n"
