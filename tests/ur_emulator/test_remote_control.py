"""Remote and local control of an e-Series box: who may command it, over which port, and since which connect."""

import pytest
from box_support import MessageReader, connect
from dashboard_support import Dashboard
from rtde_support import RtdeClient

from protocol.dashboard.commands import COMMANDS, REMOTE_CONTROL_ONLY
from protocol.primary.messages import ErrorCodeMessage, TextMessage
from ur_emulator import ControlBox
from ur_emulator.errors import EmulatorError, RefusedError

SCRIPT = b'def one():\n  textmsg("it ran")\nend\n'
GATED = sorted({row.name for row in COMMANDS if row.needs_remote})


def ur5e(**options):
    return ControlBox("ur5e", in_process=True, pace="lockstep", port_base=None, **options)


@pytest.fixture
def box():
    with ur5e() as box:
        yield box


@pytest.fixture
def local_box():
    with ur5e(remote_control=False) as box:
        yield box


def test_a_box_starts_in_remote_control_and_a_switch_to_it_changes_nothing(box):
    assert box.state.remote_control
    with Dashboard(box) as dashboard:
        box.remote_control(True)
        assert dashboard.ask_all("is in remote control", "stop") == ["true", "Stopped"]


def test_it_may_start_in_local_control(local_box):
    assert not local_box.state.remote_control
    with Dashboard(local_box) as dashboard:
        assert dashboard.ask_all(*GATED) == [REMOTE_CONTROL_ONLY] * len(GATED)
        assert dashboard.ask_all(
            "is in remote control", "robotmode", "popup x", "set operational mode manual", "get operational mode"
        ) == [
            "false", "Robotmode: RUNNING", "showing popup", "Operational mode MANUAL is set", "MANUAL",
        ]  # fmt: skip


def test_a_dashboard_client_connects_anew_after_the_switch(local_box):
    with Dashboard(local_box) as before:
        local_box.remote_control(True)
        assert before.ask_all("is in remote control", "power off") == ["true", REMOTE_CONTROL_ONLY]
        with Dashboard(local_box) as after:
            assert after.ask("power off") == "Powering off"
            local_box.remote_control(False)
            assert after.ask("power on") == REMOTE_CONTROL_ONLY
            local_box.remote_control(True)
            assert after.ask("power on") == REMOTE_CONTROL_ONLY


@pytest.mark.parametrize("port", ["primary", "secondary", "realtime"])
def test_scripts_and_words_have_no_effect_in_local_control(local_box, port):
    with connect(local_box, "primary") as watcher, connect(local_box, port) as sender:
        messages = MessageReader(watcher)
        messages.next()
        for text in (SCRIPT, b"power off\n"):
            sender.sendall(text)
            error = messages.message(ErrorCodeMessage)
            assert (error.code, "read-only" in error.text) == (210, True)
        assert local_box.state.robot_mode == "RUNNING"
        # The same connection only reads after the switch too; a new one writes.
        local_box.remote_control(True)
        sender.sendall(SCRIPT)
        assert messages.message(ErrorCodeMessage).code == 210
        with connect(local_box, port) as anew:
            anew.sendall(SCRIPT)
            assert messages.message(TextMessage).text == "it ran"


def test_rtde_and_the_control_api_work_in_local_control(local_box):
    with connect(local_box, "rtde") as sock:
        client = RtdeClient(sock)
        inputs = client.own("speed_slider_mask", "speed_slider_fraction")
        client.write(inputs, 1, 0.5)
        client.subscribe("target_speed_fraction")
        client.until(lambda data: data["target_speed_fraction"] == 0.5)
    assert local_box.run_program(SCRIPT.decode()) is not None
    assert "it ran" in [entry.text for entry in local_box.log]


def test_a_cb3_has_no_local_control():
    with pytest.raises(EmulatorError, match="a box of the CB3 has none"):
        ControlBox(remote_control=False)
    box = ControlBox(in_process=True, pace="lockstep", port_base=None)
    with box, pytest.raises(RefusedError, match="CB3 has no remote control"):
        box.remote_control(False)


def test_a_selector_keeps_the_dashboard_from_choosing(box):
    box.assign_safety_input(0, "operational mode")
    with Dashboard(box) as dashboard:
        assert dashboard.ask_all("set operational mode manual", "get operational mode") == [
            "Failed setting operational mode: manual", "AUTOMATIC",
        ]  # fmt: skip
    assert box.state.operational_mode == "AUTOMATIC"


def test_the_dashboard_keeps_the_pendant_from_choosing_until_it_gives_it_back(box):
    with Dashboard(box) as dashboard:
        dashboard.ask("set operational mode automatic")
        with pytest.raises(RefusedError, match="dashboard decides"):
            box.set_operational_mode("manual")
        assert dashboard.ask("clear operational mode").endswith("Current operational mode: 'NONE'.")
        box.set_operational_mode("manual")
        assert dashboard.ask("get operational mode") == "MANUAL"


def test_both_new_stops_on_the_dashboard(box):
    with Dashboard(box) as dashboard:
        box.set_operational_mode("manual")
        assert box.state.remote_control  # PolyScope X takes it away
        box.enabling_device("released")
        assert dashboard.ask_all("safetymode", "safetystatus") == [
            "Safetymode: SAFEGUARD_STOP", "Safetystatus: SYSTEM_THREE_POSITION_ENABLING_STOP",
        ]  # fmt: skip
        box.enabling_device("pressed")
        assert box.state.safety_status == "NORMAL"
        box.set_operational_mode("automatic")
        box.safeguard_stop(safeguard="automatic mode")
        assert dashboard.ask("safetystatus") == "Safetystatus: AUTOMATIC_MODE_SAFEGUARD_STOP"


def test_polyscope_x_has_no_remote_control_in_manual_mode():
    with ur5e(version="10.12") as box:
        box.set_operational_mode("manual")
        assert not box.state.remote_control
        with pytest.raises(RefusedError, match="PolyScope X has no remote control in manual mode"):
            box.remote_control(True)
        box.set_operational_mode("automatic")
        assert not box.state.remote_control
        box.remote_control(True)
        assert box.state.remote_control
