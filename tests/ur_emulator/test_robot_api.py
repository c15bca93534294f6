"""The Robot API of a PolyScope X box, as its clients use it: status codes, fields, local control, files."""

import io
import json
import socket
import urllib.error
import urllib.request
import zipfile
from contextlib import contextmanager

import pytest
from box_support import TIMEOUT, inside

from protocol.robot_api import BASE, CALLS
from ur_emulator import ControlBox
from ur_emulator.errors import EmulatorError

PROGRAM = 'def dance():\n  textmsg("dancing")\n  while True:\n    sync()\n  end\nend\n'
APPLICATION = """\
reset_world_model()
set_input_actions_to_default()
set_gravity([0, 0, 9.82])
local parent = get_frame_parent("base")
move_frame("base", get_pose("base", parent), parent)
global base_name = "base"
set_target_payload(0, [0, 0, 0], [0, 0, 0, 0, 0, 0])
set_tcp(p[0, 0, 0, 0, 0, 0], "Tool_flange")
###
# A comment between two lines of crosses.
###
def first(values = [3, 4]):
  return values[0]
end"""
FORM = "multipart/form-data; boundary=XX"


def urpx(name, script, **information):
    """Return a program of PolyScope X, without nodes; its application begins as those of the maker do."""
    information = {"name": name, "createdDate": 1771239851763, "programState": "FINAL"} | information
    application = {"urscript": {"script": APPLICATION}}
    program = {
        "programInformation": information,
        "urscript": {"script": f'$ 1 "ur-program"\n$ 2 "ur-code"\n{script}'},
    }
    return json.dumps({"application": application, "program": program}).encode()


@contextmanager
def x_box(version="10.12.0", **options):
    box = ControlBox("ur5e", version, in_process=True, pace="lockstep", port_base=None, seed=7, **options)
    with box:
        yield box


@pytest.fixture(scope="module")
def box(tmp_path_factory):
    folder = tmp_path_factory.mktemp("programs")
    (folder / "dance.script").write_text(PROGRAM)
    (folder / "odd.urpx").write_text("{}")
    (folder / "slow.urpx").write_bytes(urpx("slow", "textmsg(base_name, first())\nsleep(100)"))
    with x_box("10.14.0", programs=folder) as box:
        yield box


def address(box, path):
    return f"http://{box.host}:{box.ports.robot_api}{path if path.startswith('/univ') else BASE + path}"


def ask(box, method, path, body=None, content_type="application/json"):
    """Return status and answer of a request."""
    data = body if body is None or isinstance(body, bytes) else json.dumps(body).encode()
    request = urllib.request.Request(address(box, path), data, {"Content-Type": content_type}, method=method)
    try:
        with urllib.request.urlopen(request, timeout=TIMEOUT) as answer:
            content = answer.read()
            is_json = "json" in answer.headers.get("Content-Type", "")  # an answer without content has none
            return answer.status, json.loads(content) if is_json else content
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
    with ControlBox(in_process=True, robot="ur5e", pace="lockstep", port_base=None) as box:
        assert box.ports.dashboard
        assert not box.ports.robot_api


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (
            ("ur5e", "10.11", "dashboard"),
            "'dashboard' given: PolyScope X has no such service, choose of primary",
        ),
        (("ur3", None, "rtde"), "CB3 has no such service, all ports are open"),
        (("ur3", "10.11", "rtde"), r"10\.11 given"),
    ],
)
def test_services_and_versions_that_do_not_exist(options, told):
    robot, version, service = options
    with pytest.raises(EmulatorError, match=told):
        ControlBox(robot, version, services=[service], in_process=True)


def test_description_for_clients_and_the_page_for_people_name_all_calls(box):
    status, document = ask(box, "GET", "/openapi.json")
    assert (status, document["info"]["version"]) == (200, "5.0.107")  # clients choose by it
    assert sum(len(methods) for methods in document["paths"].values()) == len(CALLS)
    status, page = ask(box, "GET", "/docs")
    assert (status, page.count(b"<code>")) == (200, len(CALLS) + 1)


def power(box, action):
    """Return the status of an action, and the robot mode after it."""
    status = ask(box, "PUT", "/robotstate/v1/state", {"action": action})[0]
    return status, ask(box, "GET", "/robotstate/v1/robotmode")[1]["mode"]


def test_power_up_is_answered_when_it_is_done_and_refused_in_an_emergency_stop(box):
    assert ask(box, "GET", "/robotstate/v1/safetymode")[1]["mode"] == "NORMAL"
    box.emergency_stop()
    assert ask(box, "GET", "/robotstate/v1/safetymode")[1]["mode"] == "EMERGENCY_STOP"
    box.wait_until(robot_mode="POWER_OFF")
    assert power(box, "POWER_ON") == (409, "POWER_OFF")
    box.release_emergency_stop()
    assert power(box, "BRAKE_RELEASE") == (409, "POWER_OFF")
    assert power(box, "POWER_ON") == (200, "IDLE")
    assert power(box, "POWER_OFF") == (200, "POWER_OFF")
    assert power(box, "POWER_ON") == (200, "IDLE")
    assert power(box, "BRAKE_RELEASE") == (200, "RUNNING")
    assert power(box, "UNLOCK_PROTECTIVE_STOP") == (409, "RUNNING")


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
    assert names == ["dance", "odd", "slow"]
    text = PROGRAM.replace("dancing", "again").encode()
    assert ask(box, "PUT", "/programs/v1", form("again.script", text), FORM)[0] == 404
    stored = ask(box, "POST", "/programs/v1", form("again.script", text), FORM)
    assert stored == (200, {"message": "done", "programName": "again"})
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
    return inside(box)._player.folder._root


def test_a_program_of_polyscope_x_plays_the_script_that_it_contains(box):
    loaded = ask(box, "PUT", "/program/v1/loaded", {"name": "slow"})
    assert loaded == (200, {"message": "Program loaded successfully", "name": "slow"})
    assert ask(box, "PUT", "/program/v1/state", {"action": "play"})[0] == 200
    assert ask(box, "GET", "/program/v1/state")[1]["state"] == "PLAYING"
    box.wait_until(log="base3")
    stop(box)


def test_a_program_of_polyscope_x_has_the_name_that_stands_in_it(box):
    """The maker's client library sends every program under the file name `filename`."""
    odd_name = form("filename", urpx("with blank", "sync()", description="none", lastSavedDate=None))
    assert ask(box, "PUT", "/programs/v1/", odd_name, FORM)[0] == 404
    assert ask(box, "POST", "/programs/v1/", odd_name, FORM)[1]["programName"] == "with blank"
    assert ask(box, "POST", "/programs/v1/", odd_name, FORM)[0] == 400
    assert ask(box, "GET", "/programs/v1/with%20blank")[0] == 200
    entries = {entry["name"]: entry for entry in ask(box, "GET", "/programs/v1/")[1]["programs"]}
    assert entries["with blank"] == {
        "name": "with blank",
        "description": "none",
        "createdDate": 1771239851763,
        "lastModifiedDate": None,
        "lastSavedDate": None,
        "programState": "FINAL",
    }
    assert entries["dance"]["createdDate"] is None


def test_a_program_as_large_as_the_makers_is_taken_and_sent(box):
    data = urpx("large", "#" + "x" * 200_000 + "\nsync()")
    assert ask(box, "POST", "/programs/v1/", form("filename", data), FORM)[0] == 200
    assert ask(box, "GET", "/programs/v1/large")[1] == data
    assert ask(box, "PUT", "/program/v1/state", b'{"action":"' + b" " * 70_000 + b'"}')[0] == 422


@pytest.mark.parametrize(
    "data", [b"{", b"[1]", b'{"program": 3}', b'{"a":' * 5000, urpx("", "sync()"), urpx("x", "")[:-9]]
)
def test_what_is_no_program_of_polyscope_x_is_not_taken(box, data):
    assert ask(box, "POST", "/programs/v1/", form("x.urpx", data), FORM)[0] in (404, 422)


def test_a_file_that_is_no_program_is_sent_but_not_loaded(box):
    assert ask(box, "GET", "/programs/v1/odd") == (200, b"{}")
    status, answer = ask(box, "PUT", "/program/v1/loaded", {"name": "odd"})
    assert status == 409
    assert "odd" in answer["details"]


@pytest.mark.parametrize(
    ("method", "path", "body", "status"),
    [
        ("PUT", "/robotstate/v1/state", {"action": "FLY"}, 422),
        ("PUT", "/robotstate/v1/state", {}, 422),
        ("PUT", "/robotstate/v1/state", b"{", 422),
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
    assert answer["detail"][0]["msg"] if status == 422 else answer["details"]


def test_popups_log_and_names(box):
    for path in ("/popup/v1", "/popup/v1/safety"):
        status, answer = ask(box, "DELETE", path)
        assert (status, answer["closed"]) == (409, False)
    opened = ask(box, "POST", "/popup/v1", {"title": "t", "message": "hello"})
    assert opened == (200, {"message": "Popup opened successfully"})
    assert box.state.popups == ("hello",)
    assert ask(box, "DELETE", "/popup/v1")[1]["closed"] is True
    assert not box.state.popups
    assert ask(box, "POST", "/system/v1/log", {"message": "noted"}) == (200, {"message": "Log entry added"})
    assert any("noted" in entry.text for entry in box.log)
    assert ask(box, "GET", "/versions/v1")[1]["marketingVersion"].startswith("10.14.0")
    facts = {"robotType": "UR5", "serialNumber": box.serial_number}
    assert ask(box, "GET", "/system/v1/information")[1] == facts
    assert ask(box, "GET", "/system/v1/system-time")[1]["time"].startswith("2021-11-30T")


def test_flight_reports(box):
    with urllib.request.urlopen(address(box, "/supportfiles/v1/"), timeout=TIMEOUT) as nothing:
        assert (nothing.status, nothing.read()) == (204, b"")
    status, answer = ask(box, "POST", "/supportfiles/v1")
    assert (status, answer) == (200, {"message": "Flight report generated successfully.", "details": None})
    with urllib.request.urlopen(address(box, "/supportfiles/v1"), timeout=TIMEOUT) as archive:
        assert archive.headers["Content-Type"] == "application/zip"
        assert zipfile.ZipFile(io.BytesIO(archive.read())).namelist() == ["flightreports/flightreport_1.zip"]


def test_in_local_control_nothing_changes(box):
    assert ask(box, "GET", "/system/v1/controlmode")[1]["mode"] == "REMOTE"
    assert ask(box, "GET", "/system/v1/operationalmode")[1]["mode"] == "AUTOMATIC"
    box.remote_control(False)
    try:
        assert ask(box, "GET", "/system/v1/controlmode")[1]["mode"] == "LOCAL"
        for call in CALLS:
            if call.needs_remote:
                status, answer = ask(box, call.method, call.path, {})
                assert (status, answer["message"]) == (403, "Forbidden")
            elif call.method == "GET":
                assert ask(box, "GET", call.path.replace("{name}", "dance"))[0] in (200, 204)
        stored = ask(box, "POST", "/programs/v1", form("local.script", b"sync()"), FORM)
        assert stored[0] == 200
    finally:
        box.remote_control(True)


def test_pages_of_other_sites_may_not_call_it_and_answers_have_no_blanks(box):
    """The maker's client library looks for `"closed":false` in the text."""
    for request, host, answer in (
        ("GET", "evil.example", b"HTTP/1.1 403"), ("DELETE", "localhost", b'"closed":false'),
    ):  # fmt: skip
        with socket.create_connection((box.host, box.ports.robot_api), timeout=TIMEOUT) as sock:
            sock.sendall(f"{request} {BASE}/popup/v1 HTTP/1.1\r\nHost: {host}\r\n\r\n".encode())
            assert answer in sock.recv(4096)


def test_shutdown_closes_the_box(tmp_path):
    with x_box("10.14.0", programs=tmp_path) as box:
        assert ask(box, "PUT", "/system/v1/shutdown", b"") == (202, {"message": None})
        assert box.is_shut_down


def test_a_box_without_a_programs_folder():
    with x_box() as box:
        assert ask(box, "GET", "/programs/v1")[1] == {"programs": [], "message": ""}
        assert ask(box, "GET", "/program/v1/loaded")[1]["name"] == "Default program"
        assert ask(box, "PUT", "/program/v1/loaded", {"name": "x"})[0] == 404
        assert ask(box, "POST", "/programs/v1", form("a.script", b""), FORM)[0] == 404
        assert ask(box, "POST", "/popup/v1", {"message": "x"})[0] == 404
