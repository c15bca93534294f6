"""The Robot API of a PolyScope X box, as its clients use it: status codes, fields, local control, files."""

import json
import socket
import urllib.error
import urllib.request
from contextlib import contextmanager

import pytest
from box_support import TIMEOUT

from protocol.robot_api import BASE, CALLS
from protocol.ur_types import Ports
from ur_emulator import ControlBox
from ur_emulator.errors import EmulatorError

PROGRAM = 'def dance():\n  textmsg("dancing")\n  while True:\n    sync()\n  end\nend\n'
FORM = "multipart/form-data; boundary=XX"


@contextmanager
def x_box(version="10.12.0", **options):
    with ControlBox(robot="ur5e", version=version, pace="lockstep", port_base=None, seed=7, **options) as box:
        yield box


@pytest.fixture(scope="module")
def box(tmp_path_factory):
    folder = tmp_path_factory.mktemp("programs")
    (folder / "dance.script").write_text(PROGRAM)
    (folder / "odd.urpx").write_text("{}")
    with x_box("10.14.0", programs=folder) as box:
        yield box


def ask(box, method, path, body=None, content_type="application/json"):
    """Return status and answer of a request."""
    data = body if body is None or isinstance(body, bytes) else json.dumps(body).encode()
    url = f"http://{box.host}:{box.ports.robot_api}{path if path.startswith('/univ') else BASE + path}"
    request = urllib.request.Request(url, data, {"Content-Type": content_type}, method=method)
    try:
        with urllib.request.urlopen(request, timeout=TIMEOUT) as answer:
            content = answer.read()
            return answer.status, json.loads(content) if "json" in answer.headers["Content-Type"] else content
    except urllib.error.HTTPError as error:
        with error:
            return error.code, json.loads(error.read())


def form(file_name, content):
    head = f'--XX\r\nContent-Disposition: form-data; name="file"; filename="{file_name}"\r\n\r\n'
    return head.encode() + content + b"\r\n--XX--\r\n"


def stop(box):
    assert ask(box, "PUT", "/program/v1/state", {"action": "stop"})[0] == 200


def test_it_takes_the_place_of_the_dashboard_and_other_ports_wait_for_their_services():
    with x_box() as box:
        assert not box.ports.dashboard
        assert not box.ports.primary
        assert not box.ports.rtde
        assert "--services primary,rtde" in box.notices[0]
    with x_box(services=("rtde",)) as box:
        assert box.ports.rtde
        assert not box.ports.secondary
    with ControlBox(robot="ur5e", pace="lockstep", port_base=None) as box:
        assert box.ports.dashboard
        assert not box.ports.robot_api


def test_services_and_versions_that_do_not_exist():
    with pytest.raises(
        EmulatorError, match="'dashboard' given: PolyScope X has no such service, choose of primary"
    ):
        ControlBox(robot="ur5e", version="10.11", services=["dashboard"])
    with pytest.raises(EmulatorError, match="CB3 has no such service, all ports are open"):
        ControlBox(services=["rtde"])
    with pytest.raises(EmulatorError, match=r"10\.11 given"):
        ControlBox(robot="ur3", version="10.11")


def test_standard_number():
    assert Ports().robot_api == 80


def test_description_names_the_version_by_which_clients_choose(box):
    status, document = ask(box, "GET", "/openapi.json")
    assert (status, document["info"]["version"]) == (200, "5.0.107")
    assert sum(len(methods) for methods in document["paths"].values()) == len(CALLS)


def test_power_up_is_answered_when_it_is_done(box):
    assert ask(box, "PUT", "/robotstate/v1/state", {"action": "POWER_OFF"})[0] == 200
    assert ask(box, "GET", "/robotstate/v1/robotmode")[1]["mode"] == "POWER_OFF"
    assert ask(box, "PUT", "/robotstate/v1/state", {"action": "BRAKE_RELEASE"})[0] == 409
    assert ask(box, "PUT", "/robotstate/v1/state", {"action": "POWER_ON"})[0] == 200
    assert ask(box, "GET", "/robotstate/v1/robotmode")[1]["mode"] == "IDLE"
    assert ask(box, "PUT", "/robotstate/v1/state", {"action": "BRAKE_RELEASE"})[0] == 200
    assert ask(box, "GET", "/robotstate/v1/robotmode")[1]["mode"] == "RUNNING"


def test_safety(box):
    assert ask(box, "GET", "/robotstate/v1/safetymode")[1]["mode"] == "NORMAL"
    box.emergency_stop()
    assert ask(box, "GET", "/robotstate/v1/safetymode")[1]["mode"] == "EMERGENCY_STOP"
    assert ask(box, "PUT", "/robotstate/v1/state", {"action": "POWER_ON"})[0] == 409
    box.release_emergency_stop()
    for action in ("POWER_ON", "BRAKE_RELEASE"):
        assert ask(box, "PUT", "/robotstate/v1/state", {"action": action})[0] == 200
    assert ask(box, "PUT", "/robotstate/v1/state", {"action": "UNLOCK_PROTECTIVE_STOP"})[0] == 409


def test_a_program_is_loaded_played_paused_resumed_and_stopped(box):
    assert ask(box, "PUT", "/program/v1/loaded", {"name": "waltz"})[0] == 404
    assert ask(box, "PUT", "/program/v1/loaded", {"name": "dance"})[0] == 200
    assert ask(box, "GET", "/program/v1/loaded")[1]["name"] == "dance"

    def program_state(action):
        return ask(box, "PUT", "/program/v1/state", {"action": action})

    assert program_state("resume")[0] == 409
    assert program_state("play")[0] == 200
    assert ask(box, "GET", "/program/v1/state")[1]["state"] == "PLAYING"
    assert program_state("play")[0] == 409
    assert program_state("pause")[1]["state"] == "PAUSED"
    assert program_state("resume")[0] == 200
    assert ask(box, "PUT", "/programs/v1", form("dance.script", b""), FORM)[0] == 409
    stop(box)
    assert ask(box, "GET", "/program/v1/state")[1]["state"] == "STOPPED"


def test_programs_are_listed_stored_replaced_and_sent(box):
    names = [entry["name"] for entry in ask(box, "GET", "/programs/v1/")[1]["programs"]]
    assert names == ["dance", "odd"]
    text = PROGRAM.replace("dancing", "again").encode()
    assert ask(box, "PUT", "/programs/v1", form("again.script", text), FORM)[0] == 404
    assert ask(box, "POST", "/programs/v1", form("again.script", text), FORM) == (
        200,
        {"programName": "again"},
    )
    assert ask(box, "POST", "/programs/v1", form("again.script", text), FORM)[0] == 400
    assert ask(box, "PUT", "/programs/v1", form("again.script", text + b"\n"), FORM)[0] == 200
    assert ask(box, "GET", "/programs/v1/again") == (200, text + b"\n")
    assert ask(box, "PUT", "/program/v1/loaded", {"name": "again"})[0] == 200


@pytest.mark.parametrize(
    ("file_name", "status"), [("../out.script", 200), ("x.exe", 422), ("", 422), ("a" * 400 + ".urp", 422)]
)
def test_files_stay_in_the_folder_and_are_programs(box, file_name, status):
    assert ask(box, "POST", "/programs/v1", form(file_name, b"x"), FORM)[0] == status
    assert not list(box_folder(box).parent.glob("out.script"))


def box_folder(box):
    return box._player.folder._root


def test_the_form_of_a_program_of_polyscope_x_is_not_known(box):
    assert ask(box, "GET", "/programs/v1/odd") == (200, b"{}")
    status, answer = ask(box, "PUT", "/program/v1/loaded", {"name": "odd"})
    assert status == 409
    assert "odd" in answer["error"]


@pytest.mark.parametrize(
    ("method", "path", "body", "status"),
    [
        ("PUT", "/robotstate/v1/state", {"action": "FLY"}, 422),
        ("PUT", "/robotstate/v1/state", {}, 422),
        ("PUT", "/robotstate/v1/state", b"{", 400),
        ("PUT", "/robotstate/v1/state", {"action": 3}, 422),
        ("PUT", "/program/v1/state", {"action": "PLAY"}, 422),
        ("POST", "/programs/v1", {"file": "x"}, 422),
        ("PATCH", "/program/v1/state", {}, 405),
        ("GET", "/program/v2/state", None, 404),
        ("GET", "/universal-robots/other", None, 404),
    ],
)
def test_wrong_requests_say_what_is_allowed(box, method, path, body, status):
    found, answer = ask(box, method, path, body)
    assert found == status
    assert answer["error"]


def test_popups_log_and_names(box):
    assert ask(box, "POST", "/popup/v1", {"title": "t", "message": "hello"})[0] == 200
    assert box.state.popups == ("hello",)
    assert ask(box, "DELETE", "/popup/v1")[0] == 200
    assert not box.state.popups
    assert ask(box, "POST", "/system/v1/log", {"message": "noted"})[0] == 200
    assert any("noted" in entry.text for entry in box.log)
    assert ask(box, "GET", "/versions/v1")[1]["marketingVersion"].startswith("10.14.0")
    assert ask(box, "GET", "/system/v1/information")[1]["serialNumber"] == box.serial_number


def test_in_local_control_nothing_changes(box):
    assert ask(box, "GET", "/system/v1/controlmode")[1]["mode"] == "REMOTE"
    assert ask(box, "GET", "/system/v1/operationalmode")[1]["mode"] == "AUTOMATIC"
    box.remote_control(False)
    try:
        assert ask(box, "GET", "/system/v1/controlmode")[1]["mode"] == "LOCAL"
        for call in CALLS:
            path = call.path.replace("{name}", "dance")
            assert ask(box, call.method, path, {} if call.changes else None)[0] == (
                403 if call.changes else 200
            )
    finally:
        box.remote_control(True)


def test_pages_of_other_sites_may_not_call_it(box):
    with socket.create_connection((box.host, box.ports.robot_api), timeout=TIMEOUT) as sock:
        sock.sendall(f"GET {BASE}/openapi.json HTTP/1.1\r\nHost: evil.example\r\n\r\n".encode())
        assert sock.recv(4096).startswith(b"HTTP/1.1 403")


def test_shutdown_closes_the_box(tmp_path):
    with x_box("10.14.0", programs=tmp_path) as box:
        assert ask(box, "PUT", "/system/v1/shutdown", b"")[0] == 200
        assert box.is_shut_down


def test_a_box_without_a_programs_folder():
    with x_box() as box:
        assert ask(box, "GET", "/programs/v1")[1] == {"programs": []}
        assert ask(box, "GET", "/program/v1/loaded")[1]["name"] == "Default program"
        assert ask(box, "PUT", "/program/v1/loaded", {"name": "x"})[0] == 404
        assert ask(box, "POST", "/programs/v1", form("a.script", b""), FORM)[0] == 404
        assert ask(box, "POST", "/popup/v1", {"message": "x"})[0] == 404
