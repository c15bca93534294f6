"""A bench with an e-Series arm and the newest software, whose programs' variables can be read."""

from box_support import Bench
from box_support import program as program

from ur_emulator.machine.commands.programs import StartProgram
from ur_emulator.machine.models.generations import E_SERIES
from urscript import compile_program
from urscript.catalogue import catalogue_for

DT = E_SERIES.period_s


class ESeriesBench(Bench):
    """See the module."""

    def __init__(self, *, robot="ur5e", software="5.25", **kwargs):
        super().__init__(robot=robot, generation=E_SERIES, **kwargs)
        self.catalogue = catalogue_for(software)

    def start(self, text, *, loaded=False):
        return self.tick(1, StartProgram(compile_program(text, catalogue=self.catalogue), loaded=loaded))

    def __getitem__(self, name):
        return self.controller.programs.latest.read_global(name)

    @property
    def errors(self):
        """Codes and texts that were reported, and texts of script errors."""
        return [
            (event.code, event.argument) if type(event).__name__ == "ErrorReported" else event.text
            for event in self.events
            if type(event).__name__ in ("ErrorReported", "ScriptFailed")
        ]
