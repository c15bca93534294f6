"""What the tests of the state machines share: how to bring a box into any safety mode, and a moving arm."""

from functools import cache

from box_support import VERSION, Bench

from protocol.primary.layout import JointData, MasterboardData, RobotModeData
from protocol.primary.packages import decode_package, encode_state
from protocol.realtime.layout import layout_for_version
from protocol.rtde.types import RobotStatusBits, SafetyStatusBits
from protocol.ur_types import RobotMode, SafetyMode
from ur_emulator.host.ports.primary.robot_state import state_records
from ur_emulator.machine.commands.power import PowerOff, PowerOn, ReleaseBrakes
from ur_emulator.machine.commands.safety import (
    PressEmergencyStop,
    ReducedMode,
    ReleaseEmergencyStop,
    RestartSafety,
    SafeguardStop,
    TriggerFault,
    TriggerProtectiveStop,
    TriggerViolation,
    UnlockProtectiveStop,
)
from ur_emulator.machine.controller.events import ErrorReported, SafetyModeChanged, ScriptFailed
from ur_emulator.machine.controller.modbus_map import read_coil, read_register
from ur_emulator.machine.controller.safety.modes import SafetyEvent

ENDLESS = (
    "def endless():\n  q = get_actual_joint_positions()\n  while True:\n"
    "    movej([q[0] + 0.5, q[1], q[2], q[3], q[4], q[5]], a=3, v=1)\n    movej(q, a=3, v=1)\n  end\nend\n"
)
BRAKING = 150  # cycles, more than any arm needs to come to rest and lose its power

# How each event is made to happen from outside, where it can be.
COMMANDS = {
    SafetyEvent.PROTECTIVE_STOP: TriggerProtectiveStop(),
    SafetyEvent.UNLOCK: UnlockProtectiveStop(),
    SafetyEvent.SAFEGUARD_OPENED: SafeguardStop(True),
    SafetyEvent.SAFEGUARD_RESTORED: SafeguardStop(False),
    SafetyEvent.ROBOT_EMERGENCY_PRESSED: PressEmergencyStop("robot"),
    SafetyEvent.SYSTEM_EMERGENCY_PRESSED: PressEmergencyStop("system"),
    SafetyEvent.ROBOT_EMERGENCY_RELEASED: ReleaseEmergencyStop(),
    SafetyEvent.SYSTEM_EMERGENCY_RELEASED: ReleaseEmergencyStop(),
    SafetyEvent.REDUCED_ON: ReducedMode(True),
    SafetyEvent.REDUCED_OFF: ReducedMode(False),
    SafetyEvent.VIOLATION: TriggerViolation(),
    SafetyEvent.FAULT: TriggerFault(),
    SafetyEvent.RESTART: RestartSafety(),
    SafetyEvent.POWERED_OFF: PowerOff(),
}
# The event that leads from NORMAL into a mode.
ENTRY = {
    SafetyMode.NORMAL: None,
    SafetyMode.REDUCED: SafetyEvent.REDUCED_ON,
    SafetyMode.RECOVERY: SafetyEvent.RANGE_LEFT,
    SafetyMode.SAFEGUARD_STOP: SafetyEvent.SAFEGUARD_OPENED,
    SafetyMode.PROTECTIVE_STOP: SafetyEvent.PROTECTIVE_STOP,
    SafetyMode.SYSTEM_EMERGENCY_STOP: SafetyEvent.SYSTEM_EMERGENCY_PRESSED,
    SafetyMode.ROBOT_EMERGENCY_STOP: SafetyEvent.ROBOT_EMERGENCY_PRESSED,
    SafetyMode.VIOLATION: SafetyEvent.VIOLATION,
    SafetyMode.FAULT: SafetyEvent.FAULT,
}


def moving(*, loaded=False, **kwargs):
    """A bench whose arm is moving for ever."""
    bench = Bench(**kwargs)
    bench.start(ENDLESS, loaded=loaded)
    bench.tick(60)
    assert any(bench.now.target_qd)
    return bench


def infos(bench):
    return [event.text for event in bench.events if isinstance(event, ErrorReported) and event.code == 0]


def modes(bench):
    """Names of the safety modes that the box has entered."""
    return [SafetyMode(e.safety_mode).name for e in bench.events if isinstance(e, SafetyModeChanged)]


def failures(bench):
    return [event.text for event in bench.events if isinstance(event, ScriptFailed)]


def power_up(bench):
    """What a client does after an emergency stop."""
    bench.tick(1, PowerOn())
    bench.tick(200)
    assert bench.now.robot_mode == RobotMode.IDLE
    bench.tick(1, ReleaseBrakes())
    bench.tick(60)
    return bench.now


@cache
def _realtime(version):
    layout = layout_for_version(version)
    return layout, layout.encoder()


def check_wires(bench, version=VERSION):
    """What the ports say of the modes in this cycle agrees, each in its own encoding."""
    controller, now = bench.controller, bench.now
    state, safety = controller.state, SafetyMode(now.safety_mode)
    emergency = safety in (SafetyMode.ROBOT_EMERGENCY_STOP, SafetyMode.SYSTEM_EMERGENCY_STOP)
    protective = safety is SafetyMode.PROTECTIVE_STOP
    stops = safety not in (SafetyMode.NORMAL, SafetyMode.REDUCED, SafetyMode.RECOVERY)
    powered = now.robot_mode in (RobotMode.POWER_ON, RobotMode.IDLE, RobotMode.BACKDRIVE, RobotMode.RUNNING)

    layout, encode_frame = _realtime(version)
    frame = layout.decode(encode_frame(now))
    assert frame.safety_mode == safety
    assert getattr(frame, "safety_status", safety) in (now.safety_status, safety)
    assert frame.robot_mode == now.robot_mode
    assert tuple(frame.joint_mode) == now.joint_mode

    package = decode_package(encode_state(state_records(now), version), version)
    mode_data, joints, board = (package.find(kind) for kind in (RobotModeData, JointData, MasterboardData))
    assert (mode_data.is_emergency_stopped, mode_data.is_protective_stopped) == (emergency, protective)
    assert (mode_data.is_robot_power_on, mode_data.robot_mode) == (powered, now.robot_mode)
    assert board.safety_mode == safety
    assert tuple(joints.joint_mode) == now.joint_mode

    bits = SafetyStatusBits(now.safety_status_bits)
    assert (SafetyStatusBits.EMERGENCY_STOPPED in bits) is emergency
    assert (SafetyStatusBits.PROTECTIVE_STOPPED in bits) is protective
    assert (SafetyStatusBits.STOPPED_DUE_TO_SAFETY in bits) is stops
    assert (SafetyStatusBits.NORMAL_MODE in bits) is (safety is SafetyMode.NORMAL)
    assert (SafetyStatusBits.REDUCED_MODE in bits) is (safety is SafetyMode.REDUCED)
    own = RobotStatusBits(now.robot_status_bits)
    assert (RobotStatusBits.POWER_ON in own) is powered

    registers = [read_register(state, address) for address in range(260, 267)]
    teach, power = RobotStatusBits.TEACH_BUTTON_PRESSED in own, RobotStatusBits.POWER_BUTTON_PRESSED in own
    assert registers == [powered, protective, emergency, teach, power, stops, safety]
    assert [read_coil(state, address) for address in range(260, 266)] == registers[:6]
    assert read_register(state, 258) == now.robot_mode
