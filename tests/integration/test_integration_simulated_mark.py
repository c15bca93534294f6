"""Data of a box are marked as simulated with every software, from the connection to the page."""

import json
import re

import pytest
from integration_support import at, free_port_base

from pc_client.driver.report import read_report
from pc_client.driver.transport import TcpNetwork
from pc_client.recording.recording import load_recording
from ur_emulator import ControlBox


# No serial number before 3.12; up to 3.2 the build number stands in the place of the third number.
@pytest.mark.parametrize(("version", "told"), [("3.2.0", r"3\.2\.\d+"), ("3.11.0", r"3\.11\.0")])
def test_a_box_that_reports_no_serial_number_is_simulated(ur_client, version, told):
    with ControlBox(pace="lockstep", port_base=free_port_base(), seed=7, version=version) as box:
        doctor = ur_client("doctor", *at(box), "--seconds", 0.1)
    assert re.search(f"UR3, software {told}, serial number unknown, SIMULATED", doctor.out)


def test_only_a_box_in_lockstep_says_that_its_time_waits(lockstep_box, realtime_box):
    for box, waits in ((lockstep_box, True), (realtime_box, False)):
        info = read_report(TcpNetwork(), box.host, box.ports).info
        assert (info.simulated, info.lockstep) == (True, waits)


def test_a_box_that_reports_no_serial_number_may_be_run_again_and_its_data_are_marked(ur_client, tmp_path):
    out = tmp_path / "out"
    with ControlBox(pace="lockstep", port_base=free_port_base(), seed=7, version="3.2.0") as box:
        for _ in range(2):
            done = ur_client("run", "uniform_4_1", *at(box), "--out", out, "--overwrite")
            assert done.code == 0, done.err
    assert "Table I: SIMULATED UR3" in done.out
    provenance = load_recording(out / "uniform_4_1_r1.mcap").provenance
    assert (provenance.simulated, provenance.serial, provenance.seed) == (True, "unknown", None)
    assert json.loads((out / "table1.json").read_text())["simulated"] is True
    page = (out / "report.html").read_text()
    assert "SIMULATED: an emulated arm, no real robot moved" in page
    assert "measured on a real arm" not in page
    # `preview` identifies one delay: what it does not identify must not look measured.
    assert not {"dead_time_s", "lag_s", "joint_spread_s"} & set(provenance.loop)
    assert "joints within" not in done.out
    assert "loop delay identified by the client" in page
    assert "identified loop" not in page
