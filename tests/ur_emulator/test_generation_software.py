"""One software version gives one answer on all ports that tell it: numbers, build and date."""

import json
import zipfile

import pytest
from box_support import MessageReader, connect
from dashboard_support import Dashboard, write_programs
from rtde_support import RtdeClient

from protocol.primary import messages as M
from protocol.rtde import codec as R
from protocol.ur_types import SoftwareVersion
from ur_emulator import ControlBox

# Version given, all four numbers, day, and what the version message says: third number, build, date.
TOLD = [
    ("3.2.0", (3, 2, 0, 19171), "Jan 01 2016", (19171, 0, "Jan 01 2016, 00:00:00")),
    ("3.4.5", (3, 4, 5, 60), "Jul 08 2016", (5, 60, "Jul 08 2016, 16:07:20")),
    ("3.12.1", (3, 12, 1, 76000), "May 03 2019", (1, 0, "03-05-2019, 06:39:00")),
    ("3.15.8", (3, 15, 8, 106339), "Nov 30 2021", (8, 0, "30-11-2021, 00:00:00")),
    ("3.15.8.7", (3, 15, 8, 7), "Nov 30 2021", (8, 0, "30-11-2021, 00:00:00")),
    ("5.11.11", (5, 11, 11, 1010452), "Apr 11 2022", (11, 0, "11-04-2022, 07:48:21")),
    ("5.12.2", (5, 12, 2, 1101497), "Jun 28 2022", (2, 0, "28-06-2022, 11:30:43")),
    ("5.24.0", (5, 24, 0, 1214860), "Oct 04 2025", (0, 0, "04-10-2025, 00:25:33")),
]
REPORTS_SINCE = SoftwareVersion(3, 13)


@pytest.mark.parametrize(("given", "numbers", "day", "message"), TOLD, ids=[row[0] for row in TOLD])
def test_every_port_reports_the_same_software(tmp_path, given, numbers, day, message):
    version = SoftwareVersion(*numbers)
    folder = write_programs(tmp_path)
    robot = "ur3" if version.major == 3 else "ur5e"
    with ControlBox(robot=robot, version=given, pace="lockstep", port_base=None, programs=folder) as box:
        with connect(box, "rtde") as sock:
            assert RtdeClient(sock).ask(R.GetControllerVersion()).version == version
        with connect(box, "primary") as sock:
            told = MessageReader(sock).message(M.VersionMessage)
        assert (told.major, told.minor) == numbers[:2]
        assert (told.bugfix, told.build, told.build_date) == message
        with Dashboard(box) as dashboard:
            assert dashboard.ask("PolyscopeVersion") == f"URSoftware {version} ({day})"
            if version >= REPORTS_SINCE:
                assert dashboard.ask("generate flight report").endswith(":1")
                with zipfile.ZipFile(folder / "flightreports" / "flightreport_1.zip") as report:
                    assert json.loads(report.read("versions.json"))["software"] == str(version)
        assert box.identity["software"] == given
