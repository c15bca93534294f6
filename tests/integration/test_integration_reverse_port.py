"""Where the robot's program calls the client, on real sockets: the port that is asked for, and what if it is taken."""

import socket
from contextlib import ExitStack, suppress

import pytest
from integration_support import Messages, port_base_of, programs_since

from pc_client.driver.receiver import REVERSE_PORT

pytestmark = pytest.mark.usefixtures("without_page")
HOST = "127.0.0.1"


@pytest.fixture
def run_movement(ur_client, standard_box, tmp_path):
    def run(*options):
        where = ("--robot", standard_box.host, "--port-base", port_base_of(standard_box))
        return ur_client("run", "uniform_4_1", *where, "--out", tmp_path / "out", *options)

    return run


def test_a_given_port_that_is_taken_is_one_line_and_nothing_moves(run_movement, standard_box, tmp_path):
    with socket.create_server((HOST, 0)) as other, Messages(standard_box) as primary:
        port = other.getsockname()[1]
        done = run_movement("--reverse-port", port)
        assert done.code == 1
        assert f"cannot listen on {HOST}:{port}: another program uses the port" in done.complaint()
        assert "velocity_receiver" not in programs_since(primary, standard_box)
    assert not list(tmp_path.glob("out/*.mcap"))


def test_a_given_port_serves_all_programs_of_a_session_and_the_next_session(run_movement, tmp_path):
    # The approach, the excitation and two runs: a program each, and each leaves a connection behind.
    with socket.create_server((HOST, 0)) as found:
        port = found.getsockname()[1]
    for _ in range(2):
        done = run_movement("--reverse-port", port, "--repeat", 2, "--overwrite")
        assert done.code == 0, done.err
    assert len(list(tmp_path.glob("out/*.mcap"))) == 2


def test_on_this_machine_many_clients_share_the_default(run_movement):
    with ExitStack() as held:
        with suppress(OSError):  # another test holds it: as good
            held.enter_context(socket.create_server((HOST, REVERSE_PORT)))
        done = run_movement()
    assert done.code == 0, done.err


def test_any_free_port_is_taken_for_0(run_movement):
    done = run_movement("--reverse-port", 0)
    assert done.code == 0, done.err
