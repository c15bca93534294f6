"""All operations: each a method of `ControlBox`, a path below /v1/, a sub-command of `ur-emulator ctl`.

A row of `BoxOperations` gives an operation its name; all else is declared by its dataclass. Methods may be
called from any thread but that of the loop. They return after the cycle in which what they ask was applied,
and raise `ArgumentError` for what they do not take, `RefusedError` when the state of the box stands against
it, and `NotRunningError` when the box does not run; all of them are `EmulatorError`s.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Concatenate, ParamSpec, TypeVar, cast

from ur_emulator.errors import ArgumentError
from ur_emulator.host.control_api import step_operations as steps
from ur_emulator.machine.commands import power, programs, safety, surroundings
from ur_emulator.machine.commands.operation import Operation

P = ParamSpec("P")
R = TypeVar("R")


def method(operation: Callable[P, Operation[R]]) -> Callable[Concatenate[BoxOperations, P], R]:
    """Return the method for an operation: its parameters are those of the dataclass."""
    signature = inspect.signature(operation)

    def call(box: BoxOperations, /, *args: P.args, **kwargs: P.kwargs) -> R:
        __tracebackhide__ = True
        try:
            signature.bind(*args, **kwargs)
        except TypeError as error:
            raise ArgumentError(f"{call.__name__}: {error}; {_takes(signature.parameters)}") from None
        result: Any = box._perform(operation(*args, **kwargs))
        returned: R = result["tick"] if isinstance(result, dict) else result
        return returned

    box = inspect.Parameter("self", inspect.Parameter.POSITIONAL_ONLY)
    rows = operation.parameters  # type: ignore[attr-defined]  # the class of an operation, which is callable
    arguments = [f"    {row.name}: {row.meaning} ({row.allowed})." for row in rows]
    call.__doc__ = "\n".join([inspect.getdoc(operation) or "", *(["", "Args:", *arguments] if rows else [])])
    call.__dict__["operation"] = operation
    call.__dict__["__signature__"] = signature.replace(
        parameters=[box, *signature.parameters.values()], return_annotation=inspect.Signature.empty
    )
    return call


class ReadProperty(property):
    """The property for an operation that only reads."""

    operation: type[Operation[Any]]


def reading(operation: type[Operation[R]]) -> R:
    """Return the property for an operation that only reads."""

    def ask(box: BoxOperations) -> Any:
        __tracebackhide__ = True
        return box._perform(operation())

    made = ReadProperty(ask)
    made.__doc__ = inspect.getdoc(operation)
    made.operation = operation
    return cast(R, made)


class BoxOperations:
    """What people and tests do to a box."""

    def _perform(self, operation: Operation[Any]) -> Any:
        """Have an operation done; return its result."""
        raise NotImplementedError

    # --- what is going on
    state = reading(steps.ReadState)
    log = reading(steps.ReadLog)
    identity = reading(steps.ReadIdentity)
    wait_until = method(steps.WaitUntil)
    at = method(steps.At)
    # --- inputs
    set_digital_input = method(surroundings.SetDigitalInput)
    set_analog_input = method(surroundings.SetAnalogInput)
    # --- what acts on the arm
    push = method(surroundings.Push)
    attach_payload = method(surroundings.AttachPayload)
    add_obstacle = method(surroundings.AddObstacle)
    remove_obstacle = method(surroundings.RemoveObstacle)
    add_thing = method(surroundings.AddThing)
    move_thing = method(surroundings.MoveThing)
    remove_thing = method(surroundings.RemoveThing)
    # --- safety
    emergency_stop = method(safety.PressEmergencyStop)
    release_emergency_stop = method(safety.ReleaseEmergencyStop)
    safeguard_stop = method(safety.SafeguardStop)
    reduced_mode = method(safety.ReducedMode)
    set_safety_plane = method(safety.SetSafetyPlane)
    limit_tool_direction = method(safety.LimitToolDirection)
    protective_stop = method(safety.TriggerProtectiveStop)
    unlock_protective_stop = method(safety.UnlockProtectiveStop)
    trigger_violation = method(safety.TriggerViolation)
    trigger_fault = method(safety.TriggerFault)
    restart_safety = method(safety.RestartSafety)
    require_safeguard_reset = method(safety.RequireSafeguardReset)
    reset_safeguard = method(safety.ResetSafeguard)
    assign_safety_input = method(safety.AssignSafetyInput)
    change_safety_settings = method(safety.ChangeSafetySettings)
    confirm_safety = method(safety.ConfirmSafety)
    # --- operational mode, remote control
    set_operational_mode = method(power.SetOperationalMode)
    enabling_device = method(power.MoveEnablingDevice)
    remote_control = method(power.SwitchRemoteControl)
    # --- power
    power_on = method(power.PowerOn)
    power_off = method(power.PowerOff)
    release_brakes = method(power.ReleaseBrakes)
    # --- programs
    run_program = method(steps.RunProgram)
    stop_program = method(programs.StopProgram)
    pause_program = method(programs.PauseProgram)
    resume_program = method(programs.ResumeProgram)
    set_speed = method(programs.SetSpeedSlider)
    # --- the operator
    press_button = method(safety.PressButton)
    answer = method(programs.AnswerRequest)
    close_popups = method(programs.ClosePopup)
    add_to_log = method(steps.AddToLog)


OPERATIONS: dict[str, type[Operation[Any]]] = {}
for _name, _member in vars(BoxOperations).items():
    if hasattr(_member, "operation"):
        OPERATIONS[_name] = _member.operation
        _member.__name__ = _member.operation.api_name = _name


def make(name: str, arguments: Mapping[str, Any]) -> Operation[Any]:
    """Return an operation as it was asked for; ArgumentError if its name or an argument is wrong."""
    if name not in OPERATIONS:
        raise ArgumentError(f"there is no operation {ascii(name)[:60]}: choose from {', '.join(OPERATIONS)}")
    rows = {row.name: row for row in OPERATIONS[name].parameters}
    for given in arguments:
        if given not in rows:
            raise ArgumentError(f"{name} has no parameter {ascii(given)[:60]}: {_takes(rows)}")
    for row in rows.values():
        if row.is_required and row.name not in arguments:
            raise ArgumentError(f"{name} needs {row.name}: {row.allowed}")
    operation = OPERATIONS[name](**arguments)
    object.__setattr__(operation, "given", tuple(arguments))
    return operation


def _takes(names: Iterable[str]) -> str:
    return f"it takes {', '.join(names) or 'none'}"


def describe() -> list[dict[str, Any]]:
    """Return all operations as JSON has them."""
    return [
        {
            "name": name,
            "method": "GET" if operation.only_reads else "POST",
            "meaning": operation.meaning,
            "parameters": [
                {
                    "name": row.name,
                    "type": row.kind.value,
                    "meaning": row.meaning,
                    "allowed": row.allowed,
                    "required": row.is_required,
                    "default": None if row.is_required else row.default,
                }
                for row in operation.parameters
            ],
            "result": operation.result,
        }
        for name, operation in OPERATIONS.items()
    ]
