"""The modes as every port tells them, first cycle by cycle, then over real sockets with the commands of clients."""

import pytest
from box_support import MessageReader, connect
from rtde_support import RtdeClient
from states_support import BRAKING, COMMANDS, ENTRY, check_wires, moving

from protocol.primary.layout import MasterboardData, RobotModeData
from protocol.primary.messages import ErrorCodeMessage, SafetyModeMessage
from protocol.primary.packages import RobotState
from protocol.ur_types import RobotMode, SafetyMode
from ur_emulator import ControlBox
from ur_emulator.commands.power import ReleaseBrakes
from ur_emulator.commands.safety import (
    ChangeSafetySettings,
    PressEmergencyStop,
    ReleaseEmergencyStop,
    TriggerFault,
    TriggerViolation,
)
from ur_emulator.controller.safety.modes import SafetyEvent

MODES = [mode for mode in ENTRY if mode is not SafetyMode.RECOVERY]


@pytest.mark.parametrize("mode", MODES)
def test_ports_agree_in_every_cycle_of_a_mode(mode):
    bench = moving(fidelity="ideal")
    check_wires(bench)
    bench.tick(1, *([COMMANDS[ENTRY[mode]]] if ENTRY[mode] else []))
    for _ in range(BRAKING):
        check_wires(bench)
        bench.tick()
    bench.tick(1, ReleaseBrakes())
    check_wires(bench)


def test_ports_agree_in_recovery_and_while_powering_up():
    bench = moving(fidelity="ideal")
    bench.tick(1, COMMANDS[SafetyEvent.POWERED_OFF])
    bench.tick(1, ReleaseBrakes())
    for _ in range(250):
        check_wires(bench)
        bench.tick()
    assert bench.now.robot_mode == RobotMode.RUNNING
    bench.controller.safety.handle(SafetyEvent.RANGE_LEFT)
    bench.controller.state.past.snapshot = bench.now._replace(
        safety_mode=int(SafetyMode.RECOVERY), safety_status=int(SafetyMode.RECOVERY)
    )
    assert bench.now.safety_status_bits == 1 << 3
    check_wires(bench)


@pytest.fixture
def box():
    with ControlBox(pace="lockstep", port_base=None, seed=7) as running:
        yield running


class Dashboard:
    def __init__(self, box):
        self.sock = connect(box, "dashboard")
        self.file = self.sock.makefile("rwb")
        self.file.readline()

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.file.close()
        self.sock.close()

    def ask(self, line):
        self.file.write(line.encode() + b"\n")
        self.file.flush()
        return self.file.readline().decode().strip()

    def until(self, line, wanted, limit=5000):
        for _ in range(limit):
            if (reply := self.ask(line)) == wanted:
                return
        raise AssertionError(f"{line} never answered {wanted}, but {reply}")


def test_an_emergency_stop_and_the_recovery_by_the_dashboard(box):
    with Dashboard(box) as dashboard, connect(box, "rtde") as sock, connect(box, "primary") as primary:
        messages = MessageReader(primary)
        messages.state()  # the box has seen this client
        client = RtdeClient(sock)
        client.subscribe(
            "robot_mode", "safety_mode", "safety_status", "safety_status_bits", "robot_status_bits"
        )
        box.submit(PressEmergencyStop("system"))
        values = client.until(lambda v: v["safety_mode"] == SafetyMode.SYSTEM_EMERGENCY_STOP)
        assert values["safety_status"] == SafetyMode.SYSTEM_EMERGENCY_STOP
        assert values["safety_status_bits"] == 1 << 5 | 1 << 7 | 1 << 10
        message = messages.message(SafetyModeMessage)
        assert message.safety_mode == SafetyMode.SYSTEM_EMERGENCY_STOP
        client.until(lambda v: v["robot_mode"] == RobotMode.POWER_OFF and v["robot_status_bits"] == 0)
        assert dashboard.ask("safetymode") == "Safetymode: SYSTEM_EMERGENCY_STOP"
        assert dashboard.ask("safetystatus") == "Safetystatus: SYSTEM_EMERGENCY_STOP"
        state = messages.state()
        while state.find(RobotModeData).robot_mode != RobotMode.POWER_OFF:
            state = messages.state()
        assert state.find(RobotModeData).is_emergency_stopped
        assert state.find(MasterboardData).safety_mode == SafetyMode.SYSTEM_EMERGENCY_STOP
        dashboard.ask("power on")
        client.until(lambda v: True)
        assert dashboard.ask("robotmode") == "Robotmode: POWER_OFF"
        box.submit(ReleaseEmergencyStop())
        client.until(lambda v: v["safety_mode"] == SafetyMode.NORMAL)
        assert dashboard.ask("power on") == "Powering on"
        client.until(lambda v: v["robot_mode"] == RobotMode.IDLE)
        assert dashboard.ask("brake release") == "Brake releasing"
        client.until(lambda v: v["robot_mode"] == RobotMode.RUNNING)
        assert dashboard.ask("safetymode") == "Safetymode: NORMAL"


def test_a_protective_stop_by_script_and_the_five_seconds_of_the_dashboard(box):
    with Dashboard(box) as dashboard, connect(box, "primary") as primary:
        messages = MessageReader(primary)
        messages.state()
        primary.sendall(b"protective_stop()\n")
        assert messages.message(ErrorCodeMessage).code == 209
        assert messages.message(SafetyModeMessage).safety_mode == SafetyMode.PROTECTIVE_STOP
        reply = dashboard.ask("unlock protective stop")
        assert reply.startswith("Cannot unlock protective stop until 5s")
        dashboard.until("unlock protective stop", "Protective stop releasing")
        assert dashboard.ask("safetymode") == "Safetymode: NORMAL"
        assert dashboard.ask("robotmode") == "Robotmode: RUNNING"
        primary.sendall(b"protective_stop()\n")
        assert messages.message(ErrorCodeMessage).code == 209
        assert messages.message(SafetyModeMessage).safety_mode == SafetyMode.PROTECTIVE_STOP
        primary.sendall(b"set unlock protective stop\n")  # no five seconds on this port
        assert messages.message(SafetyModeMessage).safety_mode == SafetyMode.NORMAL


@pytest.mark.parametrize("port", ["primary", "primary_ro"])
@pytest.mark.parametrize("mode", [mode for mode in MODES if ENTRY[mode] is not None])
def test_the_message_of_a_mode_comes_before_any_state_that_shows_it(box, mode, port):
    with connect(box, port) as primary, connect(box, "rtde") as sock:
        reader = MessageReader(primary)
        reader.state()
        client = RtdeClient(sock)
        client.subscribe("safety_mode")
        box.submit(COMMANDS[ENTRY[mode]])
        client.until(lambda v: v["safety_mode"] == mode)
        order = []
        while "state" not in order:
            package = reader.next()
            match package:
                case SafetyModeMessage(safety_mode=told) if told == mode:
                    order.append("safety mode")
                case ErrorCodeMessage(code=209):
                    order.append("error")
                case RobotState() if package.find(MasterboardData).safety_mode == mode:
                    order.append("state")
                case _:
                    pass
        assert order == ["error"] * (mode is SafetyMode.PROTECTIVE_STOP) + ["safety mode", "state"]


@pytest.mark.parametrize("command", [TriggerViolation(), TriggerFault()])
def test_safety_is_restarted_by_the_dashboard(box, command):
    with Dashboard(box) as dashboard:
        box.submit(command)
        name = "VIOLATION" if isinstance(command, TriggerViolation) else "FAULT"
        dashboard.until("safetystatus", f"Safetystatus: {name}")
        assert dashboard.ask("restart safety") == "Restarting safety"
        assert dashboard.ask("robotmode") == "Robotmode: POWER_OFF"
        assert dashboard.ask("safetymode") == "Safetymode: NORMAL"
        assert dashboard.ask("brake release") == "Brake releasing"
        dashboard.until("robotmode", "Robotmode: RUNNING")


def test_confirming_over_a_script_port(box):
    with Dashboard(box) as dashboard, connect(box, "secondary") as secondary:
        box.submit(ChangeSafetySettings())
        dashboard.until("robotmode", "Robotmode: CONFIRM_SAFETY")
        secondary.sendall(b"confirm user safety parameters\n")
        dashboard.until("robotmode", "Robotmode: POWER_OFF")
