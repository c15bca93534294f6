"""Boxes in processes of their own, for clients that hard-code the ports."""

import sys
from pathlib import Path

import pytest
from clients_support import served_box

sys.path.append(str(Path(__file__).parents[1] / "ur_emulator"))  # its program files are of use here too


@pytest.fixture(scope="module", params=[()], ids=["cb3"])
def box(tmp_path_factory, request):
    """A box in real time, shared: a test leaves it able to run the next one.

    A CB3 with software 3.15, unless the parameter has other options.
    """
    with served_box(tmp_path_factory.mktemp("box"), *request.param) as served:
        yield served


@pytest.fixture(scope="module")
def home_q():
    """Joint angles where tests of ur_rtde begin [rad]."""
    from ur_rtde_support import HOME

    return HOME


@pytest.fixture(scope="module")
def ur_rtde_interfaces(box, home_q):
    """ur_rtde's control and receive interfaces, connected once for all tests of a file."""
    from ur_rtde_support import Arm, RTDEControl, RTDEReceive, connected

    with connected(RTDEReceive, box.host) as receive, connected(RTDEControl, box.host) as control:
        yield Arm(box=box, receive=receive, control=control, home=home_q)


@pytest.fixture
def arm(ur_rtde_interfaces):
    """The same with the control script running and the arm at its start."""
    ur_rtde_interfaces.get_ready()
    return ur_rtde_interfaces
