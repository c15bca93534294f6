"""The safety status as RTDE publishes it in bits; which program states count as running."""

from protocol.rtde.types import SafetyStatusBits
from protocol.ur_types import ProgramState, SafetyMode

# A program counts as running until it stands still; paused it does not, nor when it has ended. Inferred from
# a client that waits for both flags of the robot mode data to fall.
RUNNING_STATES = frozenset({ProgramState.PLAYING, ProgramState.PAUSING, ProgramState.RESUMING})

_EMERGENCY = SafetyStatusBits.EMERGENCY_STOPPED | SafetyStatusBits.STOPPED_DUE_TO_SAFETY
_SAFEGUARD = int(SafetyStatusBits.SAFEGUARD_STOPPED | SafetyStatusBits.STOPPED_DUE_TO_SAFETY)

# Inferred from the names of the bits: every mode has one of its own, and what keeps the arm from moving also
# says so. The bits of a mode that is not listed are 0.
SAFETY_BITS: dict[int, int] = {
    SafetyMode.NORMAL: int(SafetyStatusBits.NORMAL_MODE),
    SafetyMode.REDUCED: int(SafetyStatusBits.REDUCED_MODE),
    SafetyMode.RECOVERY: int(SafetyStatusBits.RECOVERY_MODE),
    SafetyMode.PROTECTIVE_STOP: int(
        SafetyStatusBits.PROTECTIVE_STOPPED | SafetyStatusBits.STOPPED_DUE_TO_SAFETY
    ),
    SafetyMode.SAFEGUARD_STOP: _SAFEGUARD,
    SafetyMode.AUTOMATIC_MODE_SAFEGUARD_STOP: _SAFEGUARD,
    SafetyMode.SYSTEM_THREE_POSITION_ENABLING_STOP: _SAFEGUARD,
    SafetyMode.SYSTEM_EMERGENCY_STOP: int(SafetyStatusBits.SYSTEM_EMERGENCY_STOPPED | _EMERGENCY),
    SafetyMode.ROBOT_EMERGENCY_STOP: int(SafetyStatusBits.ROBOT_EMERGENCY_STOPPED | _EMERGENCY),
    SafetyMode.VIOLATION: int(SafetyStatusBits.VIOLATION | SafetyStatusBits.STOPPED_DUE_TO_SAFETY),
    SafetyMode.FAULT: int(SafetyStatusBits.FAULT | SafetyStatusBits.STOPPED_DUE_TO_SAFETY),
}


def safety_status_bits(safety_status: int) -> int:
    """Return `safety_status_bits` for a SafetyStatus, without the enabling device."""
    return SAFETY_BITS.get(safety_status, 0)
