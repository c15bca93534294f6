"""The robot as a URScript program sees it: all builtin groups, and the end of threads and programs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ur_emulator.controller.events import TextPrinted
from ur_emulator.controller.state import ControllerState
from ur_emulator.scripting.compliance_functions import compliance_functions
from ur_emulator.scripting.io_functions import (
    io_configuration_functions,
    io_functions,
    register_functions,
    tool_functions,
)
from ur_emulator.scripting.modbus_functions import modbus_functions, port_functions
from ur_emulator.scripting.motion_functions import motion_functions, planning_functions
from ur_emulator.scripting.move_planner import MovePlanner
from ur_emulator.scripting.network import Network
from ur_emulator.scripting.operator_functions import (
    error_functions,
    interpreter_functions,
    operator_functions,
)
from ur_emulator.scripting.overlay_functions import ProgramConveyor, ProgramPathOffset, encoder_functions
from ur_emulator.scripting.remote_procedures import ProgramRemotes
from ur_emulator.scripting.rtde_functions import rtde_functions, watchdog_functions
from ur_emulator.scripting.script_arm import ScriptArm
from ur_emulator.scripting.settings_functions import payload_functions, settings_functions, world_functions
from ur_emulator.scripting.socket_functions import ProgramSockets
from ur_emulator.scripting.speed_functions import ProgramTorque, speed_functions
from ur_emulator.scripting.state_functions import clock_functions, dynamics_functions, state_functions
from urscript.builtins import pure_builtins


def robot_hosts(state: ControllerState, network: Network) -> Callable[[], RobotHost]:
    """Return what makes the host of one program on a box; arguments are those of `RobotHost`."""
    return lambda: RobotHost(state, network)


class RobotHost:
    """The host of one running program (see urscript.run.host.Host)."""

    def __init__(self, state: ControllerState, network: Network) -> None:
        """Bind the builtins.

        Args:
            state: the parts of the controller; each group of builtins gets those that it acts on.
            network: opens the program's sockets.
        """
        random = pure_builtins(state.seed)["random"]
        self.step_time = state.clock.period_s
        arm = ScriptArm(state.robot, state.arm, state.motion, state.tool, state.safety)
        settings = settings_functions(
            state.robot, state.tool, state.force_sense, state.requests, self.step_time
        )
        self._state = state
        self._sockets = ProgramSockets(state.clock, state.events, network)
        self._remotes = ProgramRemotes(network, state.clock)
        self._conveyor = ProgramConveyor(arm, state.encoders, state.clock)
        self._path_offset = ProgramPathOffset(arm)
        self._builtins: Mapping[str, Callable[..., Any]] = {
            **motion_functions(
                arm,
                state.place_arm,
                state.events,
                MovePlanner(state.dynamics, state.planning, state.tool),
                state.world,
            ),
            **planning_functions(state.planning),
            **speed_functions(arm, self.step_time),
            **state_functions(arm, state.past, self.step_time),
            **compliance_functions(arm, state.compliance, state.force_sense, state.past),
            **dynamics_functions(arm, state.dynamics, state.past),
            **settings,
            **world_functions(state.world, settings["set_target_payload"]),
            **tool_functions(state.io),
            **payload_functions(state.tool),
            **rtde_functions(state.past, state.robot.generation.rtde_outputs),
            **io_functions(state.io),
            **register_functions(state.registers),
            **io_configuration_functions(state.io, state.io_configuration),
            **port_functions(state),
            **modbus_functions(state.modbus, state.io_configuration, state.clock, network),
            **watchdog_functions(state.watchdogs, state.force_sense, state.clock),
            **encoder_functions(state.encoders, state.io),
            **self._conveyor.functions(),
            **self._path_offset.functions(),
            **ProgramTorque(state.motion, state.compliance, state.past, state.events).functions(),
            **operator_functions(state.pendant, state.events),
            **interpreter_functions(state.interpreter),
            **clock_functions(state.clock),
            **error_functions(state.error_settings, state.past, state.requests),
            **self._sockets.functions(),
            **self._remotes.functions(),
            "random": lambda thread: random(),
        }

    def builtins(self) -> Mapping[str, Callable[..., Any]]:
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
        self._sockets.close_all()
        self._remotes.close_all()
        self._conveyor.end()
        self._path_offset.end()
