"""The door of the machine: a box as a function of its inputs.

    answer = machine.tick(inputs)

An input is a command of a client or a person, or an arrival for a script. The answer has the snapshot of the
cycle, its events, the requests that the host carries out, and what has become of each command. Nothing else
comes in or goes out, and the same inputs in the same cycles give the same answers bit for bit: that is what
a journal holds and `ur-emulator replay` proves.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from ur_emulator.machine.controller.command import Command, Outcome
from ur_emulator.machine.controller.controller import Controller
from ur_emulator.machine.controller.events import Event
from ur_emulator.machine.controller.io.network import Arrival, Request
from ur_emulator.machine.controller.snapshot import Snapshot
from ur_emulator.machine.models.fidelity import Fidelity
from ur_emulator.machine.models.robot_model import RobotModel
from ur_emulator.machine.scripting.robot_host import robot_hosts
from ur_hil.cell import Cell
from ur_hil.tools import ToolModel

Input = Command | Arrival


class Answer(NamedTuple):
    """What a cycle gives; `outcomes` are those of the commands, in their order."""

    snapshot: Snapshot
    events: Sequence[Event]
    requests: Sequence[Request]
    outcomes: Sequence[Outcome]


class Machine:
    """A control box without ports, sockets and clock.

    Attributes:
        controller: its parts; whoever is not of the machine only reads them.
        network: what its scripts have outside; likewise.
    """

    def __init__(
        self,
        robot: RobotModel,
        fidelity: Fidelity,
        seed: int,
        *,
        version: tuple[int, int] | None = None,
        tools: Sequence[ToolModel] = (),
        scene: Cell | Path | None = None,
        remote_control: bool = True,
    ) -> None:
        """Assemble the box, powered on with its brakes released; arguments as of `Controller`.

        Args:
            scene: what stands around the arm.
            remote_control: clients may command the box (e-Series).
        """
        self.controller = Controller(robot, fidelity, seed, robot_hosts, version=version, tools=tools)
        self.network = self.controller.state.network
        self.controller.state.pendant.set_remote_control(remote_control)
        if scene is not None:
            self.controller.plant.furnish(scene)

    def take(self, arrival: Arrival) -> None:
        """Take an arrival before its cycle begins: `Controller.waits_outside` counts with it."""
        self.network.take(arrival)

    def tick(self, inputs: Iterable[Input] = ()) -> Answer:
        """Advance one control cycle. Commands act in their order; arrivals come before them."""
        commands: list[Command] = []
        for one in inputs:
            if isinstance(one, Command):
                commands.append(one)
            else:
                self.network.take(one)
        controller = self.controller
        snapshot = controller.tick(commands)
        events, requests = controller.state.events.take(), self.network.take_requests()
        return Answer(snapshot, events, requests, controller.outcomes)

    def use_idle_time(self) -> None:
        """Compute now what the last cycle has left for later; that changes no answer."""
        self.controller.plant.complete_cycle()

    def forget_ended(self) -> None:
        """Drop the variables of the last program if it has ended; that changes no answer."""
        self.controller.programs.forget()
