"""Every target of the Makefile and every command that a page shows begins and ends in a test, in its shortest form."""

import json
import os
import re
import runpy
import shlex
import subprocess
import sys
from ctypes.util import find_library
from pathlib import Path
from shutil import copy, which

import pytest
from page_blocks import MAKE_TARGETS, ROOT, blocks_of, commands_of, inline_commands

from bench.__main__ import ASKED, MEASUREMENTS, RESULTS

BIN = Path(sys.executable).parent
# Some words of the command make `make bench` and others do their work once, in a moment.
SHORT = {
    "attack": "--box CB3 --seconds 0.1 --out attack.json 'unread log'",
    "bench": f"--short --out bench.json {' '.join(MEASUREMENTS)}",
    "soak": "",
    "walk": "--box 'CB3 3.15' --steps 1 --length 1",
}
# Commands of pages that need nothing but themselves.
ALONE = {
    "python -m docs.make_extraction_picture": "--out picture.png",
    "python -m pc_client.movements.generate": "library",
    "python -m pydoc": "pc_client.Arm protocol.realtime.layout ur_emulator.ControlBox urscript.compile_program",
    "python tests/attack": "--box CB3 --seconds 0.1 --repeat 10 --growth 9 'unread log'",
    "python tests/fuzz/campaign.py": "--cases 1 controller",
}
# The others, and the tests that run them. What .ci/run does comes before any test.
ELSEWHERE = {
    "make ablation": "test_examples.py::test_ablation",
    "make check": "test_commands.py::test_make_runs_tests",
    "make check-static": ".ci/run",
    "make clean": "test_commands.py::test_make_clean_removes_what_was_made",
    "make demo": "test_examples.py::test_demo_and_plot",
    "make docs": "test_site.py::test_every_page_is_there_and_asks_no_other_machine",
    "make draw": "test_examples.py::test_draw",
    "make explore": "test_commands.py::test_make_runs_tests",
    "make format": "test_commands.py::test_make_format_makes_files_canonical",
    "make help": "test_commands.py::test_make_help_lists_the_targets",
    "make pick": "test_examples.py::test_pick",
    "make pictures": "test_commands.py::test_make_pictures",
    "make setup": ".ci/run",
    "make show": "test_examples.py::test_show",
    "make test": ".ci/run",
    "python -c": "test_commands.py::test_the_mean_of_an_extraction",
    "python -m bench": "test_commands.py::test_a_target_begins_and_ends",
    "python -m protocol decode": "protocol/test_protocol_command.py::",
    "python -m protocol layout": "protocol/test_protocol_command.py::",
    "python examples/ablation.py": "test_examples.py::test_ablation",
    "python examples/draw.py": "test_examples.py::test_draw",
}
