"""The token of the control port: who does not show it gets nothing, and who must have one."""

import pytest
from control_support import Http, control_box

from ur_emulator import ControlBox
from ur_emulator.box_options import MAX_TOKEN
from ur_emulator.control_api.operations import OPERATIONS
from ur_emulator.errors import EmulatorError

TOKEN = "correct-horse"


@pytest.fixture(scope="module")
def box():
    with control_box(control_token=TOKEN) as box:
        yield box


@pytest.fixture
def http(box):
    with Http(box) as http:
        yield http


@pytest.mark.parametrize("name", ["operations", *OPERATIONS])
def test_every_operation_needs_it(http, name):
    method = "GET" if name == "operations" or OPERATIONS[name].only_reads else "POST"
    status, answer = http.ask(method, f"/v1/{name}")
    assert (status, http.headers["www-authenticate"]) == (401, "Bearer")
    assert list(answer) == ["error"]
    assert "Authorization: Bearer" in answer["error"]
    assert TOKEN not in str(answer)


@pytest.mark.parametrize(
    "shown",
    [
        "",
        "Bearer",
        "Bearer ",
        TOKEN,
        f"Basic {TOKEN}",
        f"Bearer {TOKEN}x",
        f"Bearer {TOKEN[:-1]}",
        f"Bearer {TOKEN.upper()}",
        f"Bearer x {TOKEN}",
        f"Bearer {TOKEN}\xe9",
    ],
)
def test_something_else_does_not_do(box, http, shown):
    asked = http.request("POST", "/v1/trigger_fault", headers=[f"Authorization: {shown}"])
    http.send(asked.decode().encode("latin-1"))
    assert http.answer()[0] == 401
    assert box.state.safety_mode == "NORMAL"


def test_with_it_all_is_done_on_the_same_connection(http):
    assert http.ask("GET", "/v1/state")[0] == 401
    for scheme in ("Bearer", "bearer", "BEARER "):
        assert http.ask("GET", "/v1/state", headers=[f"Authorization: {scheme} {TOKEN}"])[0] == 200
    assert http.ask("GET", "/v1/state")[0] == 401


def test_pages_are_refused_also_with_it(http):
    shown = f"Authorization: Bearer {TOKEN}"
    assert http.ask("GET", "/v1/state", headers=[shown, "Origin: http://evil.example"])[0] == 403
    assert http.ask("GET", "/v1/state", headers=[shown], host="evil.example")[0] == 403


@pytest.mark.parametrize("token", ["", "two words", "a\nb", "caf\xe9", "x" * (MAX_TOKEN + 1)])
def test_a_token_that_is_none(token):
    with pytest.raises(EmulatorError, match="1 to 200 printed characters of ASCII"):
        ControlBox(control_port=0, control_token=token)


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.0.2.1", "box.example", "127.0.0.1.example"])
def test_beyond_loopback_a_control_port_demands_one(host):
    with pytest.raises(EmulatorError, match="give it a token"):
        ControlBox(host=host, control_port=0, port_base=None)


@pytest.mark.parametrize("host", ["127.0.0.1", "127.9.9.9", "localhost", "::1"])
def test_on_loopback_it_does_not(host):
    ControlBox(host=host, control_port=0, port_base=None).close()
