"""The catalogue's promise and the box must agree: what is called modelled is there, what is there is called modelled."""

import pytest
from box_support import Bench

from ur_emulator.scripting.robot_host import RobotHost
from urscript.builtins import PURE
from urscript.catalogue import CB3_3_15, catalogue_for
from urscript.catalogue.types import Support

# Run by the interpreter itself.
FLOW = {"sync", "sleep", "textmsg", "varmsg"}
STATEMENTS = {"pause"}


def offered():
    bench = Bench()
    host = RobotHost(bench.controller.state, bench.network)
    return (set(host.builtins()) | set(PURE) | FLOW) - STATEMENTS


@pytest.mark.parametrize("version", ["3.15", "5.4", "5.11", "5.15", "5.22", "5.25"])
def test_every_modelled_builtin_is_offered_and_every_offered_one_is_modelled(version):
    catalogue = catalogue_for(version)
    modelled = {row.name for row in catalogue if row.support is not Support.DECLARED_ONLY}
    missing = modelled - offered()
    undeclared = {name for name in offered() if name in catalogue} - modelled
    assert not missing
    assert not undeclared


def test_the_box_offers_nothing_that_the_language_does_not_know():
    e_series = [catalogue_for("5.11"), catalogue_for("5.25")]
    assert {name for name in offered() if not any(name in each for each in (CB3_3_15, *e_series))} == set()
