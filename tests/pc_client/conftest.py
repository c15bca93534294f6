"""A robot in memory for the commands of the client, and their one line of complaint."""

import pytest
from fake_robot import FakeRobot

import pc_client.arm
import pc_client.driver.session
import pc_client.driver.transport


@pytest.fixture
def robot(monkeypatch):
    """A robot in memory instead of the network."""
    fake = FakeRobot(delay=4)
    fake.q = [0.4, -1.77, -2.1, -0.1, 1.3, 1.86]
    for module in (pc_client.driver.transport, pc_client.driver.session, pc_client.arm):
        monkeypatch.setattr(module, "TcpNetwork", lambda: fake)
    return fake


@pytest.fixture
def one_line(capsys):
    """What a command has said on stderr: one line."""

    def read():
        err = capsys.readouterr().err
        assert err.count("\n") == 1, err
        assert "Traceback" not in err
        return err

    return read
