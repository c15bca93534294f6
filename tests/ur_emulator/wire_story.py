"""An eventful hour of a box, for the tests of what its ports say: everything that can change changes once.

`Story().moments` are pairs of a snapshot and what Modbus says in the same cycle, some from every event.
"""

from box_support import Bench

from protocol.ur_types import RobotMode
from ur_emulator.machine.commands.client_writes import WriteInputs
from ur_emulator.machine.commands.power import ReleaseBrakes
from ur_emulator.machine.commands.programs import (
    PauseProgram,
    ResumeProgram,
    SetSpeedSlider,
    StartProgram,
    StopProgram,
)
from ur_emulator.machine.commands.safety import (
    BUTTON_BITS,
    PressButton,
    PressEmergencyStop,
    ReducedMode,
    ReleaseEmergencyStop,
    RestartSafety,
    SafeguardStop,
    TriggerProtectiveStop,
    TriggerViolation,
    UnlockProtectiveStop,
)
from ur_emulator.machine.commands.surroundings import Push
from ur_emulator.machine.controller.modbus_map import read_register
from urscript import compile_program
from urscript.catalogue import catalogue_for

MODBUS = (0, 1, 4, 6, 8, 10, 16, 18, 20, 21, 22, 24, 26, 30, 31, 258, 266, 450, 451, 768, 769, 770,
          *range(270, 276), *range(280, 286), *range(300, 306), *range(310, 316), *range(400, 403),
          *range(420, 426))  # fmt: skip

REGISTERS = """def registers():
  i = 0
  while i < 128:
    write_output_boolean_register(i, True)
    if i < 48:
      write_output_integer_register(i, i + 1)
      write_output_float_register(i, i + 0.5)
    end
    i = i + 1
  end
  sync()
end
"""
OUTPUTS = """def outputs():
  i = 0
  while i < 8:
    set_standard_digital_out(i, True)
    set_configurable_digital_out(i, True)
    set_euromap_output(i, True)
    i = i + 1
  end
  set_tool_voltage(24)
  set_tool_digital_out(0, True)
  set_analog_outputdomain(0, 1)
  set_analog_outputdomain(1, 1)
  set_standard_analog_out(0, 0.7)
  set_standard_analog_out(1, 0.2)
  set_standard_analog_input_domain(0, 0)
  set_standard_analog_input_domain(1, 0)
  set_tool_analog_input_domain(0, 0)
  set_tool_analog_input_domain(1, 0)
  sleep(0.1)
end
"""
MOVES = """def moves():
  set_tcp(p[0.01, 0.02, 0.1, 0.1, 0.2, 0.3])
  set_payload(1.5, [0.01, 0.02, 0.03])
  movej([0.6, -1.2, -1.9, -0.5, 1.0, 1.2], a=3, v=1.5)
  movej([0.2, -1.5, -1.5, -0.8, 1.4, 0.8], a=3, v=1.5)
end
"""
TOOL = """def tool():
  set_target_payload(1.5, [0, 0, 0.1], [0.01, 0.02, 0.03, 0.001, 0.002, 0.003])
  set_tool_output_mode(1)
  set_tool_digital_output_mode(0, 2)
  set_tool_digital_output_mode(1, 3)
end
"""
E_SERIES = """def e_series():
  set_gravity([0.1, 0.2, 9.8])
  encoder_enable_set_tick_count(0, 0)
  encoder_enable_set_tick_count(1, 0)
  encoder_set_tick_count(0, 7)
  encoder_set_tick_count(1, -9)
  set_base_acceleration([0.1, 0.2, 0.3])
  set_tool_communication(True, 1000000, 2, 2, 2, 4)
end
"""
ENDLESS = MOVES.replace("  movej", "  while True:\n    movej", 1).replace("\nend\n", "\n  end\nend\n")
INPUT_ACTION = 'def action():\n  set_standard_digital_input_action(0, "freedrive")\n  sleep(0.1)\nend\n'


def _modes(now):
    return now.robot_mode, now.safety_mode, now.runtime_state


class Story(Bench):
    """A bench that boots, works, is touched, stopped in every way and comes back."""

    def __init__(self):
        super().__init__(mode=RobotMode.NO_CONTROLLER)
        self.controller.programs.reports_line = True
        self.moments = []
        self.note()
        self.power_up()
        self.work()
        self.be_guided()
        self.be_stopped()

    def note(self):
        state = self.controller.state
        self.moments.append((self.now, {n: read_register(state, n) for n in MODBUS}))

    def tick(self, n=1, *commands):
        """Advance; what counts is every twentieth cycle, those in which a mode changes, and the ends of several."""
        for i in range(n):
            before = self.now
            super().tick(1, *commands)
            commands = ()
            if hasattr(self, "moments") and (
                len(self.snapshots) % 20 == 0
                or _modes(self.now) != _modes(before)
                or (n > 1 and i in (0, n - 1))
            ):
                self.note()
        return self.now

    def until(self, condition, limit=2000):
        for _ in range(limit):
            if condition(self.now):
                return
            self.tick()
        raise AssertionError("what was waited for did not happen")

    def power_up(self):
        self.until(lambda now: now.robot_mode == RobotMode.POWER_OFF)
        self.tick(5, ReleaseBrakes())
        self.until(lambda now: now.robot_mode == RobotMode.RUNNING)

    def work(self):
        io = self.controller.state.io
        self.run(REGISTERS)
        io.digital_in, io.euromap_inputs = 0b11_1010_1010_0101_0101, 5
        self.run(OUTPUTS)
        for line, ratio in zip((*io.analog_in, *io.tool_analog_in), (0.1, 0.2, 0.3, 0.4), strict=True):
            line.set_ratio(ratio)
        self.tick(5)
        io.digital_in = 0
        self.write(
            {
                "standard_digital_output_mask": 0xFF,
                "standard_digital_output": 0x5A,
                "speed_slider_mask": 1,
                "speed_slider_fraction": 0.8,
                "input_bit_registers0_to_31": 0xDEADBEEF,
                "input_bit_registers32_to_63": 0x12345678,
                **{f"input_bit_register_{i}": True for i in range(64, 128)},
                **{f"input_int_register_{i}": -i - 1 for i in range(48)},
                **{f"input_double_register_{i}": i + 0.25 for i in range(48)},
            }
        )
        self.run(MOVES)
        e_series = compile_program(TOOL, catalogue=catalogue_for((5, 12)))
        self.tick(5, StartProgram(e_series))
        self.start(ENDLESS)
        self.tick(300)
        self.tick(100, PauseProgram())
        self.tick(50, ResumeProgram())
        self.tick(200, StopProgram())

    def write(self, values):
        self.tick(3, WriteInputs(tuple(values.items())))

    def be_guided(self):
        for button in BUTTON_BITS:
            self.tick(3, PressButton(button, True))
            self.tick(3, PressButton(button, False))
        self.run(INPUT_ACTION)
        self.controller.state.io.digital_in = 1
        self.tick(10)
        self.controller.state.io.digital_in = 0
        self.tick(10)
        self.tick(2500, Push((0.0, 0.0, -30.0), (0.0, 0.3, 0.0)))  # until the wrist is warm
        self.tick(20, Push((12.0, 15.0, -18.0)))
        self.tick(20, Push((0.0, 0.0, 0.0)))

    def be_stopped(self):
        self.tick(50, ReducedMode(True), SetSpeedSlider(1.0))
        self.start(ENDLESS.replace("a=3, v=1.5", "a=8, v=3"))  # more than reduced mode allows
        self.tick(60)
        self.tick(50, SafeguardStop(True))
        self.tick(20, SafeguardStop(False))
        self.tick(20, ReducedMode(False))
        self.tick(100, TriggerProtectiveStop())
        self.tick(20, UnlockProtectiveStop())
        self.tick(200, PressEmergencyStop("robot"))
        self.tick(5, ReleaseEmergencyStop())
        self.tick(5, ReleaseBrakes())
        self.until(lambda now: now.robot_mode == RobotMode.RUNNING)
        self.tick(20, TriggerViolation())
        self.tick(5, RestartSafety())


class ESeriesStory(Story):
    """The same with what only ports of late e-Series software show."""

    def work(self):
        super().work()
        self.tick(5, StartProgram(compile_program(E_SERIES, catalogue=catalogue_for((5, 26)))))
