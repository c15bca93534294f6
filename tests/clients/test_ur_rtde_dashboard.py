"""ur_rtde's DashboardClient: every call it has, on a box with a program."""

import pytest
from clients_support import served_box, wait_until
from ur_rtde_support import Dashboard


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    """A box with one program that loops, on other ports than the client's usual ones."""
    folder = tmp_path_factory.mktemp("cell")
    programs = folder / "programs"
    programs.mkdir()
    (programs / "wait.script").write_text("def wait():\n  while True:\n    sync()\n  end\nend\n")
    with served_box(folder, "--programs", programs, "--port-base", 100) as served:
        yield served


@pytest.fixture
def dashboard(cell):
    client = Dashboard(cell.host, cell.ports.dashboard)
    client.connect()
    yield client
    client.disconnect()


def test_a_program_from_loading_to_the_end(dashboard):
    dashboard.loadURP("wait.script")
    assert "wait" in dashboard.getLoadedProgram()
    assert dashboard.programState().startswith("STOPPED wait")
    assert not dashboard.running()
    dashboard.play()
    wait_until(dashboard.running)
    assert dashboard.programState().startswith("PLAYING wait")
    dashboard.pause()
    wait_until(lambda: dashboard.programState().startswith("PAUSED wait"))
    dashboard.play()
    wait_until(lambda: dashboard.programState().startswith("PLAYING wait"))
    dashboard.stop()
    wait_until(lambda: dashboard.programState().startswith("STOPPED wait"))
    dashboard.stop()  # must answer `Stopped` although nothing runs
    dashboard.isProgramSaved()
    with pytest.raises(RuntimeError, match="nothing"):
        dashboard.loadURP("nothing.urp")


def test_what_the_box_is(dashboard, cell):
    assert dashboard.polyscopeVersion().startswith("3.15.8.")
    assert dashboard.getRobotModel() == "UR3"
    assert dashboard.safetymode() == "Safetymode: NORMAL"
    assert dashboard.robotmode() == "Robotmode: RUNNING"
    assert dashboard.isConnected()
    assert cell.ports.dashboard == 30099


def test_power(dashboard):
    dashboard.restartSafety()
    dashboard.powerOff()
    wait_until(lambda: dashboard.robotmode() == "Robotmode: POWER_OFF")
    dashboard.powerOn()
    wait_until(lambda: dashboard.robotmode() == "Robotmode: IDLE")
    dashboard.brakeRelease()
    wait_until(lambda: dashboard.robotmode() == "Robotmode: RUNNING")


def test_popups_the_log_and_the_end(dashboard, cell):
    dashboard.popup("look here")
    dashboard.closePopup()
    dashboard.closeSafetyPopup()
    dashboard.addToLog("said by ur_rtde")
    wait_until(lambda: "said by ur_rtde" in cell.log.read_text())
    dashboard.quit()
    dashboard.disconnect()
    assert not dashboard.isConnected()
