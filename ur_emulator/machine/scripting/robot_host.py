"""The robot as a URScript program sees it: all builtin groups, and the end of threads and programs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from ur_emulator.machine.controller.events import TextPrinted
from ur_emulator.machine.controller.state import ControllerState
from ur_emulator.machine.scripting.builtin_group import BuiltinGroup, ScriptArm
from ur_emulator.machine.scripting.flow_builtins import ErrorBuiltins, InterpreterBuiltins, PendantBuiltins
from ur_emulator.machine.scripting.force_builtins import ForceBuiltins
from ur_emulator.machine.scripting.line_builtins import LineBuiltins, RegisterBuiltins
from ur_emulator.machine.scripting.modbus_builtins import MapBuiltins, ModbusBuiltins
from ur_emulator.machine.scripting.move_builtins import MoveBuiltins
from ur_emulator.machine.scripting.move_planner import MovePlanner
from ur_emulator.machine.scripting.overlay_builtins import (
    ConveyorBuiltins,
    EncoderBuiltins,
    PathOffsetBuiltins,
)
from ur_emulator.machine.scripting.rpc_builtins import RpcBuiltins
from ur_emulator.machine.scripting.rtde_builtins import RtdeBuiltins
from ur_emulator.machine.scripting.setting_builtins import SettingBuiltins, WorldBuiltins
from ur_emulator.machine.scripting.socket_builtins import SocketBuiltins
from ur_emulator.machine.scripting.state_builtins import StateBuiltins
from ur_emulator.machine.scripting.stream_builtins import StreamBuiltins, TorqueBuiltins
from urscript.builtins import pure_builtins
from urscript.run.host import HostFunction


def robot_hosts(state: ControllerState) -> Callable[[], RobotHost]:
    """Bind the builtins of a box, each group to its parts; return what makes the host of a program."""
    arm = ScriptArm(state.robot, state.arm, state.motion, state.tool, state.safety)
    step_time, past = state.clock.period_s, state.past
    settings = SettingBuiltins(state.robot, state.tool, state.force_sense, step_time)
    planner = MovePlanner(state.dynamics, state.planning, state.tool)
    groups = (
        MoveBuiltins(arm, state.place_arm, state.events, planner, state.planning, state.world),
        StreamBuiltins(arm, step_time),
        StateBuiltins(arm, state.dynamics, past, state.clock),
        ForceBuiltins(arm, state.compliance, state.force_sense, past),
        settings,
        WorldBuiltins(state.world, settings.set_target_payload),
        LineBuiltins(state.io, state.io_configuration),
        RegisterBuiltins(state.registers),
        MapBuiltins(state),
        ModbusBuiltins(state.modbus, state.io_configuration, state.clock),
        RtdeBuiltins(past, state.clock, state.watchdogs, state.force_sense),
        EncoderBuiltins(state.encoders, state.io),
        PendantBuiltins(state.pendant, state.events),
        InterpreterBuiltins(state.interpreter),
        ErrorBuiltins(state.error_settings, past, state.requests),
    )
    shared = _functions(groups)
    return lambda: RobotHost(state, arm, shared)


def _functions(groups: Iterable[BuiltinGroup]) -> dict[str, HostFunction]:
    return {name: function for group in groups for name, function in group.functions().items()}


class RobotHost:
    """The host of one running program (see urscript.run.host.Host)."""

    def __init__(self, state: ControllerState, arm: ScriptArm, shared: Mapping[str, HostFunction]) -> None:
        """Bind the builtins that keep something for one program; those of all programs are `shared`."""
        random = pure_builtins(state.seed)["random"]
        self.step_time = state.clock.period_s
        self._state = state
        # What a program opens or displaces the arm by ends with it.
        self._ending = (
            SocketBuiltins(state.clock, state.events, state.network),
            RpcBuiltins(state.network, state.clock),
            ConveyorBuiltins(arm, state.encoders, state.clock),
            PathOffsetBuiltins(arm),
        )
        torque = TorqueBuiltins(arm, state.past, state.events)
        own = _functions((*self._ending, torque))
        self._builtins = {**shared, **own, "random": lambda thread: random()}

    def builtins(self) -> Mapping[str, HostFunction]:
        """Return the effects that this robot offers, by URScript name."""
        return self._builtins

    def textmsg(self, text: str) -> None:
        """Publish a text message."""
        self._state.events.append(TextPrinted(text))

    def thread_ended(self, thread: object) -> None:
        """Stop the motion of a thread that ended or was killed."""
        self._state.motion.release(thread)

    def program_ended(self) -> None:
        """Close what the program opened, and end what displaces the arm from its path."""
        for group in self._ending:
            group.end()
