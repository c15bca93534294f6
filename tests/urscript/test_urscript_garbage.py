"""Compiling leaves nothing behind that only a garbage collector finds: that of a box must not run long."""

import gc

import pytest

from urscript.errors import ScriptCompileError
from urscript.program import compile_program

GOOD = """def p():
  def f(a, b=1):
    if a > 0:
      return f(a - 1)
    end
    def g():
      sync()
    end
    g()
    return b
  end
  thread t():
    f(1)
  end
  run t()
  textmsg(f(3))
end
"""


@pytest.mark.parametrize("text", [GOOD, GOOD.replace("textmsg", "txtmsg"), GOOD.replace("f(3)", "f(3")])
def test_nothing_is_left_to_collect(text):
    def compiled():
        try:
            return compile_program(text)
        except ScriptCompileError:
            return None

    compiled()
    gc.collect()
    gc.disable()
    try:
        kept = compiled()
        assert gc.collect() == 0
        assert (kept is None) == (text is not GOOD)
    finally:
        gc.enable()
