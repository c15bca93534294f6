"""The catalogue's promise and the box must agree: what is called modelled is there, what is there is called modelled."""

import inspect

import pytest
from box_support import Bench

from ur_emulator.scripting.robot_host import robot_hosts
from urscript.builtins import PURE
from urscript.catalogue import CB3_3_15, catalogue_for
from urscript.catalogue.types import Support

# Run by the interpreter itself.
FLOW = {"sync", "sleep", "textmsg", "varmsg"}
STATEMENTS = {"pause"}


def offered():
    bench = Bench()
    host = robot_hosts(bench.controller.state, bench.network)()
    return (set(host.builtins()) | set(PURE) | FLOW) - STATEMENTS


VERSIONS = ("3.15", "5.0", "5.4", "5.9", "5.12", "5.15", "5.17", "5.18", "5.22", "5.25", "10.11", "10.12")


@pytest.mark.parametrize("version", VERSIONS)
def test_every_function_takes_the_parameters_of_its_row(version):
    bench = Bench()
    effects = robot_hosts(bench.controller.state, bench.network)().builtins()
    for row in catalogue_for(version):
        values = [None] * len(row.params)
        if row.name in effects:
            inspect.signature(effects[row.name]).bind(None, *values)
        elif row.name in PURE and not row.any_names:
            inspect.signature(PURE[row.name]).bind(*values)


@pytest.mark.parametrize("version", VERSIONS)
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
