"""The calls of the Robot API about programs: the loaded one, and the files of the programs folder."""

from __future__ import annotations

from collections.abc import Callable

from ur_emulator.errors import RefusedError
from ur_emulator.servers.box_access import BoxAccess
from ur_emulator.servers.http.messages import HttpAnswer, HttpError, HttpRequest
from ur_emulator.servers.programs.player import ProgramPlayer
from ur_emulator.servers.robot_api.program_files import (
    Outcome,
    find_program,
    list_programs,
    read_program,
    write_program,
)
from ur_emulator.servers.steps import Steps

# Name of the program of a box that has loaded none. Source: a fresh simulator.
DEFAULT_PROGRAM = "Default program"


class ProgramCalls:
    """Answers these calls.

    Args:
        access: to the box.
        player: holds the loaded program.
    """

    def __init__(self, access: BoxAccess, player: ProgramPlayer) -> None:
        self._access = access
        self._player = player

    # --- the loaded one

    def state(self) -> str:
        """Return PLAYING, PAUSED or STOPPED."""
        if self._player.is_paused:
            return "PAUSED"
        return "PLAYING" if self._player.is_running else "STOPPED"

    def loaded_name(self) -> str:
        """Return the name of the loaded program."""
        loaded = self._player.loaded
        return loaded.file_name.rpartition(".")[0] if loaded else DEFAULT_PROGRAM

    def change_state(self, request: HttpRequest) -> Steps[HttpAnswer]:
        """Play, pause, resume or stop, and answer when that is done."""
        player = self._player
        actions: dict[str, Callable[[], Steps[None]]] = {
            "play": lambda: player.play(""),
            "pause": player.pause,
            "resume": self._resume,
            "stop": player.stop,
        }
        yield from actions[request.word("action", actions)]()
        return HttpAnswer(200, {"state": self.state(), "details": ""})

    def _resume(self) -> Steps[None]:
        if not self._player.is_paused:
            raise RefusedError(f"resume given: the program is {self.state()}")
        yield from self._player.play("")

    def load(self, request: HttpRequest, key: str) -> Steps[HttpAnswer]:
        """Load the program that the body names under a key."""
        name = request.text(key)
        file = find_program(self._player.folder, name)
        yield from self._player.load(file.wire_path)
        return HttpAnswer(200, {"name": name})

    # --- files

    def list_all(self) -> Steps[HttpAnswer]:
        """Name all programs."""
        programs = yield from self._access.in_worker(list_programs, self._player.folder)
        return HttpAnswer(200, {"programs": programs, "message": ""})

    def send(self, name: str) -> Steps[HttpAnswer]:
        """Send the file of a program."""
        data = yield from self._access.in_worker(read_program, self._player.folder, name)
        return HttpAnswer(200, data)

    def store(self, request: HttpRequest, *, is_new: bool) -> Steps[HttpAnswer]:
        """Take the file of a program, a new one or one that exists."""
        in_use = self.loaded_name() if self._player.is_running else ""
        name, outcome = yield from self._access.in_worker(
            write_program,
            self._player.folder,
            request.headers.get("content-type", ""),
            request.body,
            is_new,
            in_use,
        )
        match outcome:
            case Outcome.EXISTS:
                raise HttpError(400, f"there is a program {name!r} already: PUT replaces it")
            case Outcome.MISSING:
                raise HttpError(404, f"there is no program {name!r} yet: POST makes it")
            case Outcome.IN_USE:
                raise RefusedError(f"{name} is loaded and plays: stop it first")
        return HttpAnswer(200, {"programName": name})
