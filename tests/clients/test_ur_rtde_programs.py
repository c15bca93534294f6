"""Programs that users give ur_rtde, its upper range, and its URCap mode."""

import gzip
import socket

import pytest
from clients_support import served_box, wait_until
from ur_rtde_support import HOME, Arm, Dashboard, RTDEControl, RTDEReceive, connected, home

STOP = 255  # the client's command for its script to end


def test_a_custom_function_runs_and_the_control_script_returns(arm):
    function = (
        f"movej({home(0.2)}, a=12, v=3)\n"
        "q = get_actual_joint_positions()\n"
        "write_output_float_register(12, q[0])\n"
        "write_output_integer_register(12, 4711)\n"
    )
    assert arm.control.sendCustomScriptFunction("mine", function)
    arm.until(lambda r: r.getOutputIntRegister(12) == 4711)
    arm.until(lambda r: r.getOutputDoubleRegister(12) == pytest.approx(HOME[0] + 0.2, abs=0.01))
    assert arm.is_at(home(0.2))
    # Whether the client still sees its custom program or the control script again is a matter of a moment.
    wait_until(lambda: arm.control.moveJ(list(HOME), 3.0, 12.0))


def test_a_custom_script_and_a_script_file(arm, tmp_path):
    script = (
        "def whole():\n  write_output_integer_register(13, {})\n  write_output_integer_register(0, 2)\nend\n"
    )
    assert arm.control.sendCustomScript(script.format(11))
    arm.until(lambda r: r.getOutputIntRegister(13) == 11)
    path = tmp_path / "whole.script"
    path.write_text(script.format(12))
    assert arm.control.sendCustomScriptFile(str(path))
    arm.until(lambda r: r.getOutputIntRegister(13) == 12)
    wait_until(lambda: arm.control.moveJ(home(0.05), 3.0, 12.0))


def test_another_control_script(arm, tmp_path):
    path = tmp_path / "control.script"
    path.write_text(
        "def rtde_control():\n"
        "  write_output_integer_register(14, 77)\n"
        "  write_output_integer_register(0, 1)\n"
        f"  while read_input_integer_register(0) != {STOP}:\n    sync()\n  end\nend\n"
    )
    arm.control.setCustomScriptFile(str(path))
    arm.until(lambda r: r.getOutputIntRegister(14) == 77)
    wait_until(arm.control.isProgramRunning)
    arm.control.setCustomScriptFile("")
    wait_until(lambda: arm.control.isProgramRunning() and arm.control.moveJ(home(0.05), 3.0, 12.0))


@pytest.mark.slow
def test_a_second_control_interface_in_the_upper_range(arm):
    """Its registers belong to nobody, the force input does: it connects, and its script replaces the first one's."""
    flags = RTDEControl.FLAG_UPPER_RANGE_REGISTERS | RTDEControl.FLAG_UPLOAD_SCRIPT
    with pytest.raises(RuntimeError, match="in use"):
        RTDEControl(arm.box.host, -1.0, flags)
    with connected(RTDEControl, arm.box.host, -1.0, flags | RTDEControl.FLAG_NO_EXT_FT) as second:
        assert second.moveJ(home(0.1), 3.0, 12.0)
        assert arm.is_at(home(0.1))
        second.stopScript()
    arm.get_ready()
    assert arm.is_at(HOME)


def test_a_client_that_left_its_script_running_leaves_the_box_to_the_next(arm):
    arm.control.disconnect()
    with connected(RTDEControl, arm.box.host) as second:
        assert second.moveJ(home(0.1), 3.0, 12.0)
    assert arm.control.reconnect()
    arm.get_ready()
    assert arm.is_at(HOME)


def external_control(port):
    """A program with one External Control node, as PolyScope would save it, that asks this PC."""
    data = f'<data key="host_ip" value="127.0.0.1"/><data key="port_nr" value="{port}"/>'
    node = (
        '<Contributed strategyClass="com.fzi.externalcontrol.ExternalControlNode" '
        'strategyProgramNodeType="External Control" strategyURCapName="External Control">'
        f"<dataModel>{data}</dataModel></Contributed>"
    )
    text = (
        '<?xml version="1.0" encoding="UTF-8"?><URProgram name="external_control" installation="default">'
        '<children><MainProgram runOnlyOnce="true"><children>'
        f"{node}</children></MainProgram></children></URProgram>"
    )
    return gzip.compress(text.encode(), mtime=0)


@pytest.mark.slow
def test_the_box_fetches_the_control_script_itself(tmp_path):
    """The URCap's way: the client uploads nothing, the box asks it for its script when its program is played."""
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    programs = tmp_path / "programs"
    programs.mkdir()
    (programs / "external_control.urp").write_bytes(external_control(port))
    flags = RTDEControl.FLAG_USE_EXT_UR_CAP | RTDEControl.FLAG_NO_WAIT
    with (
        served_box(tmp_path, "--programs", programs) as box,
        connected(RTDEReceive, box.host) as receive,
        connected(RTDEControl, box.host, -1.0, flags, port) as control,
    ):
        dashboard = Dashboard(box.host)
        dashboard.connect()
        dashboard.loadURP("external_control.urp")
        dashboard.play()
        wait_until(control.isProgramRunning, "the program")
        assert dashboard.programState() == "PLAYING external_control.urp"
        arm = Arm(box=box, control=control, receive=receive, home=HOME)
        assert control.moveJ(home(0.1), 3.0, 12.0)
        assert arm.is_at(home(0.1))
        dashboard.stop()
        dashboard.disconnect()
