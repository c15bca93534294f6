"""The client reads the ports of every e-Series software: greeting, states, frames, RTDE."""

import pytest

from pc_client.driver.report import probe
from pc_client.driver.transport import TcpNetwork
from ur_emulator import ControlBox


@pytest.mark.parametrize(
    ("software", "size", "payload"),
    [
        ("5.0.5", 1108, None), ("5.3.0", 1108, None), ("5.4.0", 1116, None), ("5.8.0", 1116, 0.0),
        ("5.9.4", 1140, 0.0), ("5.12.2", 1220, 0.0), ("5.25.1", 1220, 0.0),
    ],
)  # fmt: skip
def test_the_client_reads_every_port(software, size, payload):
    with ControlBox(robot="ur5e", version=software, pace="lockstep", port_base=None, seed=7) as box:
        found = probe(TcpNetwork(), box.host, box.ports, 0.02)
    assert found.obstacle == ""
    assert str(found.info.version).startswith(software.removesuffix(".0"))
    assert found.info.simulated is True
    assert found.rhythm.frame_size == size
    assert found.report.configured == found.info.model == "UR5e"
    assert found.report.payload == payload
    assert found.report.tcp_offset == (0.0,) * 6
