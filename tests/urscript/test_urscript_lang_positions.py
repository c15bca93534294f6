"""Positions of instructions: the table that a compilation makes agrees with Python's own."""

import marshal
from types import CodeType

from urscript import ProgramStatus, RecordingHost, compile_program

TEXT = """def p():
  def far(a, b=1):
    x = [a, b, a + b]
    return x[2] / (a - b)
  end
  thread t():
    while True:
      sync()
    end
  end
  run t()
  i = 0
  while i < 3:
    i = i + 1
    sync()
    i = i + far(i, 9)
  end
end
"""


def test_all_instructions_have_the_position_that_python_reports():
    program = compile_program(TEXT)
    module = marshal.loads(program.compiled.code)
    functions = [constant for constant in module.co_consts if isinstance(constant, CodeType)]
    assert {function.co_name for function in functions} == set(program.compiled.positions)
    for function in functions:
        table = program.compiled.positions[function.co_name]
        for i, (line, _, column, _) in enumerate(function.co_positions()):
            assert table.at(2 * i) == (line or 1, 1 if column is None else column + 1)


def test_a_suspended_thread_stands_where_it_waits():
    running = compile_program(TEXT).start(RecordingHost())
    assert running.step() is ProgramStatus.RUNNING
    assert [running.position(thread) for thread in running.threads] == [(15, 5), (8, 7)]
