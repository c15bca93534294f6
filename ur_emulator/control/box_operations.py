"""The operations as methods of `ControlBox`: thin, typed, callable from any thread but that of the loop.

A method returns after the cycle in which what it asks was applied, and gives the number of that cycle. It
raises `ArgumentError` for what it does not take, `RefusedError` when the state of the box stands against it,
and `NotRunningError` when the box does not run; all of them are `EmulatorError`s. `operations` has the table.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from ur_emulator.control.box_state import BoxState
    from ur_emulator.controller.operator import Answer
    from ur_emulator.models.robot_model import Vector3

_ORIGIN = (0.0, 0.0, 0.0)


class BoxOperations:
    """What people and tests do to a box."""

    def _perform(self, name: str, arguments: Mapping[str, Any]) -> Any:
        """Have an operation of the table done; return its result."""
        raise NotImplementedError

    def _tick(self, operation: str, /, **arguments: Any) -> int:
        tick: int = self._perform(operation, arguments)["tick"]
        return tick

    # --- what is going on

    @property
    def state(self) -> BoxState:
        """What the box is doing at the end of its last cycle."""
        state: BoxState = self._perform("state", {})
        return state

    @property
    def identity(self) -> dict[str, Any]:
        """What the box is."""
        facts: dict[str, Any] = self._perform("identity", {})
        return facts

    def wait_until(
        self,
        robot_mode: str | None = None,
        safety_mode: str | None = None,
        program_state: str | None = None,
        steady: bool | None = None,
        popup: bool | None = None,
        question: bool | None = None,
        log: str | None = None,
        after: int = 0,
        timeout: float = 10.0,
    ) -> BoxState:
        """Wait until all conditions hold at the end of a cycle, and return the state then.

        In lockstep time stands still while nothing goes on: what would only come with time does not come.

        Args:
            robot_mode: name of a RobotMode.
            safety_mode: name of a SafetyMode.
            program_state: name of a ProgramState; STOPPED still right after a port was sent a program.
            steady: the arm stands still, or not.
            popup: a popup is shown, or none.
            question: a program waits for an answer, or none does.
            log: an entry of the log contains this.
            after: so many entries of the log do not count, from the beginning of the log.
            timeout: give up after so long in real time [s].

        Raises:
            WaitTimeoutError: they did not all hold in time.
        """
        arguments = {
            "robot_mode": robot_mode,
            "safety_mode": safety_mode,
            "program_state": program_state,
            "steady": steady,
            "popup": popup,
            "question": question,
            "log": log,
            "after": after,
            "timeout": timeout,
        }
        state: BoxState = self._perform("wait_until", arguments)
        return state

    # --- wires

    def set_digital_input(
        self, group: Literal["standard", "configurable", "tool"], n: int, level: bool
    ) -> int:
        """Let a digital input be high or low from now on.

        Args:
            group: which inputs.
            n: number of the input: 0 to 7, of the tool 0 to 1.
            level: high.
        """
        return self._tick("set_digital_input", group=group, n=n, level=level)

    def set_analog_input(self, group: Literal["standard", "tool"], n: int, value: float) -> int:
        """Let an analogue input have a voltage or a current from now on.

        Args:
            group: which inputs.
            n: number of the input, 0 or 1.
            value: in V, or in A where the input measures current.
        """
        return self._tick("set_analog_input", group=group, n=n, value=value)

    # --- hands

    def push(self, force: Vector3, point: Vector3 = _ORIGIN, duration: float | None = None) -> int:
        """Push the flange as a hand would; a zero force ends it.

        Args:
            force: in base axes [N].
            point: where it acts, in the flange frame [m].
            duration: for so long in robot time [s]; None until the next push.
        """
        return self._tick("push", force=force, point=point, duration=duration)

    def attach_payload(self, mass: float, cog: Vector3 = _ORIGIN) -> int:
        """Hang a load on the flange that no program has declared.

        Args:
            mass: [kg].
            cog: centre of gravity in the flange frame [m].
        """
        return self._tick("attach_payload", mass=mass, cog=cog)

    def add_obstacle(
        self,
        name: str,
        shape: Literal["box", "sphere", "capsule", "plane"],
        size: Sequence[float],
        pose: Sequence[float],
    ) -> int:
        """Put a fixed obstacle somewhere; one of the same name gives way.

        Args:
            name: to remove it by.
            shape: what it is; a plane has no end.
            size: box: three edges; sphere: radius; capsule: radius, length; plane: () [m].
            pose: of its middle in the base frame [m, rotation vector in rad].

        Raises:
            RefusedError: the arm is there, or there are too many.
        """
        return self._tick("add_obstacle", name=name, shape=shape, size=size, pose=pose)

    def remove_obstacle(self, name: str) -> int:
        """Take an obstacle away.

        Args:
            name: of the obstacle.

        Raises:
            RefusedError: there is none of that name.
        """
        return self._tick("remove_obstacle", name=name)

    # --- safety

    def emergency_stop(self, kind: Literal["robot", "system"] = "robot") -> int:
        """Press an emergency stop button.

        Args:
            kind: the pendant's button, or that of the surroundings.
        """
        return self._tick("emergency_stop", kind=kind)

    def release_emergency_stop(self) -> int:
        """Release all emergency stop buttons; the power stays off."""
        return self._tick("release_emergency_stop")

    def safeguard_stop(self, active: bool = True) -> int:
        """Open the safeguard, or close it again."""
        return self._tick("safeguard_stop", active=active)

    def reduced_mode(self, active: bool = True) -> int:
        """Switch reduced mode on or off, as its input does."""
        return self._tick("reduced_mode", active=active)

    def protective_stop(self) -> int:
        """Stop the arm as a safety function would."""
        return self._tick("protective_stop")

    def unlock_protective_stop(self) -> int:
        """End a protective stop at once, without the dashboard's 5 s."""
        return self._tick("unlock_protective_stop")

    def trigger_violation(self, text: str = "Safety violation requested") -> int:
        """Let the safety system find a violation.

        Args:
            text: for log and clients.
        """
        return self._tick("trigger_violation", text=text)

    def trigger_fault(self, text: str = "Safety fault requested") -> int:
        """Let the safety system find a fault in itself.

        Args:
            text: for log and clients.
        """
        return self._tick("trigger_fault", text=text)

    def restart_safety(self) -> int:
        """Restart the safety system; the power is off then."""
        return self._tick("restart_safety")

    # --- power

    def power_on(self) -> int:
        """Power the joints; the brakes stay closed."""
        return self._tick("power_on")

    def power_off(self) -> int:
        """Close the brakes and cut the power."""
        return self._tick("power_off")

    def release_brakes(self) -> int:
        """Go to RUNNING, powering on first if need be."""
        return self._tick("release_brakes")

    # --- programs

    def run_program(self, script: str | Path | None = None, file: str | None = None) -> int:
        """Run a program in place of the one that runs.

        Args:
            script: text of a program, as sent to port 30002, or the path of a file that holds it.
            file: or a file in the folder of programs, as for the dashboard's `load`.

        Raises:
            ArgumentError: the program does not compile.
            RefusedError: the box does not run programs now, or cannot use the file.
        """
        text = script.read_text(encoding="utf-8") if isinstance(script, Path) else script
        return self._tick("run_program", script=text, file=file)

    def stop_program(self) -> int:
        """End the program, if one runs."""
        return self._tick("stop_program")

    def pause_program(self) -> int:
        """Let the program stand still, and the arm come to rest on its path."""
        return self._tick("pause_program")

    def resume_program(self) -> int:
        """Let a paused program go on."""
        return self._tick("resume_program")

    def set_speed(self, fraction: float) -> int:
        """Set the speed slider.

        Args:
            fraction: of full speed, 0 to 1.
        """
        return self._tick("set_speed", fraction=fraction)

    # --- the operator

    def answer(self, value: Answer, id: int | None = None) -> int:
        """Answer a question of a program.

        Args:
            value: of the type that was asked for.
            id: number of the question; None for the oldest that fits.
        """
        return self._tick("answer", value=value, id=id)

    def close_popups(self) -> int:
        """Press the button of all popups."""
        return self._tick("close_popups")

    def add_to_log(self, text: str) -> int:
        """Write a line into the log.

        Args:
            text: the line.
        """
        return self._tick("add_to_log", text=text)
