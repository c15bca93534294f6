"""What each kind of node becomes, alone: the whole script."""

import pytest
from dashboard_support import urp
from urp_samples import SAMPLES
from urp_support import script_of

from ur_emulator.program_files.urp_program import KINDS
from urscript import compile_program
from urscript.catalogue import catalogue_for

# Variables that waypoints and popups name.
VARIABLES = "global part=1\nglobal Home=p[0, 0, 0, 0, 0, 0]\nglobal a=Home\nglobal b=Home\n"


@pytest.mark.parametrize(("nodes", "expected"), SAMPLES.values(), ids=SAMPLES)
def test_a_node_becomes_its_statements(tmp_path, nodes, expected):
    text = script_of(tmp_path, urp(nodes))
    assert text == "\n".join(("def sample():", expected.strip("\n"), "end"))
    program = text.replace("def sample():\n", f"def sample():\n{VARIABLES}").encode().decode("latin-1")
    compile_program(program, catalogue=catalogue_for("3.15"))


def test_every_kind_of_node_has_a_sample():
    assert set(KINDS) <= set(SAMPLES)
