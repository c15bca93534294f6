"""What the tests of the state machines share: how to bring a box into any safety mode, and a moving arm."""

from box_support import Bench

from protocol.ur_types import RobotMode, SafetyMode
from ur_emulator.controller import commands as cmd
from ur_emulator.controller import safety_commands as safe
from ur_emulator.controller.events import ErrorReported, ScriptFailed
from ur_emulator.controller.safety_modes import SafetyEvent

ENDLESS = (
    "def endless():\n  q = get_actual_joint_positions()\n  while True:\n"
    "    movej([q[0] + 0.5, q[1], q[2], q[3], q[4], q[5]], a=3, v=1)\n    movej(q, a=3, v=1)\n  end\nend\n"
)
BRAKING = 150  # cycles, more than any arm needs to come to rest and lose its power

# How each event is made to happen from outside, where it can be.
COMMANDS = {
    SafetyEvent.PROTECTIVE_STOP: cmd.TriggerProtectiveStop(),
    SafetyEvent.UNLOCK: cmd.UnlockProtectiveStop(),
    SafetyEvent.SAFEGUARD_OPENED: safe.SafeguardStop(True),
    SafetyEvent.SAFEGUARD_RESTORED: safe.SafeguardStop(False),
    SafetyEvent.ROBOT_EMERGENCY_PRESSED: safe.PressEmergencyStop("robot"),
    SafetyEvent.SYSTEM_EMERGENCY_PRESSED: safe.PressEmergencyStop("system"),
    SafetyEvent.ROBOT_EMERGENCY_RELEASED: safe.ReleaseEmergencyStop(),
    SafetyEvent.SYSTEM_EMERGENCY_RELEASED: safe.ReleaseEmergencyStop(),
    SafetyEvent.REDUCED_ON: safe.ReducedMode(True),
    SafetyEvent.REDUCED_OFF: safe.ReducedMode(False),
    SafetyEvent.VIOLATION: safe.TriggerViolation(),
    SafetyEvent.FAULT: safe.TriggerFault(),
    SafetyEvent.RESTART: cmd.RestartSafety(),
    SafetyEvent.POWERED_OFF: cmd.PowerOff(),
}
# The event that leads from NORMAL into a mode.
WAY_IN = {
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


def moving(**kwargs):
    """A bench whose arm is moving for ever."""
    bench = Bench(**kwargs)
    bench.start(ENDLESS)
    bench.tick(60)
    assert any(bench.now.target_qd)
    return bench


def infos(bench):
    return [event.text for event in bench.events if isinstance(event, ErrorReported) and event.code == 0]


def failures(bench):
    return [event.text for event in bench.events if isinstance(event, ScriptFailed)]


def power_up(bench):
    """What a client does after an emergency stop."""
    bench.tick(1, cmd.PowerOn())
    bench.tick(200)
    assert bench.now.robot_mode == RobotMode.IDLE
    bench.tick(1, cmd.ReleaseBrakes())
    bench.tick(60)
    return bench.now
