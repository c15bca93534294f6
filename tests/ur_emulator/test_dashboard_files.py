"""Logs, flight reports and support files that the dashboard has the box write."""

import gc
import json
import zipfile

import pytest
from dashboard_support import Dashboard, write_programs

from ur_emulator.emulator import ControlBox
from ur_emulator.polyscope.report_files import BoxFacts


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "programs").mkdir()
    return write_programs(tmp_path / "programs")


def session(folder, *lines):
    """Let a box answer lines; return the replies and the log."""
    with (
        ControlBox(in_process=True, pace="lockstep", port_base=None, seed=7, programs=folder) as box,
        Dashboard(box) as dashboard,
    ):
        return dashboard.ask_all(*lines), [str(entry) for entry in box.log]


def test_the_log_is_written_line_by_line(folder):
    _, log = session(folder, "addToLog first", "load hello.urp", "saveLog")
    saved = (folder / "log_history.txt").read_text().splitlines()
    assert saved == log[: len(saved)]
    assert saved[-1].endswith("Dashboard: Loaded program: /programs/hello.urp")
    session(folder, "addToLog second", "saveLog")
    assert "first" not in (folder / "log_history.txt").read_text()


def test_a_support_file_holds_all_reports_and_the_state(folder):
    replies, _ = session(
        folder, "load hello.urp", "generate flight report", "generate flight report software", "generate support file cell",
        "generate flight report controller",
    )  # fmt: skip
    name = replies[3].removeprefix("Completed successfully:")
    assert [reply.rpartition(":")[2] for reply in replies[1:3]] == ["1", "2"]
    assert replies[4].endswith("id:4")  # the support file has made the third
    with zipfile.ZipFile(folder / "cell" / name) as archive:
        assert archive.namelist() == [
            "flightreports/flightreport_1.zip", "flightreports/flightreport_2.zip", "flightreports/flightreport_3.zip",
            "log_history.txt", "program.script", "programs.json", "state.json", "versions.json",
        ]  # fmt: skip
        assert json.loads(archive.read("versions.json"))["software"] == "3.15.8.106339"
        assert json.loads(archive.read("programs.json")) == {
            "program": "/programs/hello.urp",
            "installation": "/programs/default.installation",
        }
        state = json.loads(archive.read("state.json"))
        assert len(state["actual_q"]) == 6
        assert "def hello()" in archive.read("program.script").decode()
        assert "Loaded program" in archive.read("log_history.txt").decode()
    kinds = []
    for number in (1, 2, 3, 4):
        with zipfile.ZipFile(folder / "flightreports" / f"flightreport_{number}.zip") as archive:
            kinds.append(json.loads(archive.read("report.json"))["kind"])
    assert kinds == ["system", "software", "system", "controller"]


def test_support_files_of_the_same_second_do_not_replace_each_other(folder):
    replies, _ = session(folder, *["generate support file /programs"] * 3)
    names = [reply.removeprefix("Completed successfully:") for reply in replies]
    assert len(set(names)) == 3
    assert all((folder / name).is_file() for name in names)


def test_equal_runs_write_equal_bytes(tmp_path):
    written = []
    for run in ("a", "b"):
        (tmp_path / run).mkdir()
        folder = write_programs(tmp_path / run)
        session(folder, "load wait.urp", "play", "stop", "generate flight report")
        with zipfile.ZipFile(folder / "flightreports" / "flightreport_1.zip") as archive:
            # Everything but the log, which has the client's port, is the same to the last bit.
            written.append(
                [
                    (i.filename, i.date_time, archive.read(i))
                    for i in archive.infolist()
                    if "log" not in i.filename
                ]
            )
    assert written[0] == written[1]


def test_without_a_folder_the_files_go_to_a_temporary_one_that_goes_with_the_box(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with ControlBox(in_process=True, pace="lockstep", port_base=None) as box, Dashboard(box) as dashboard:
        replies = dashboard.ask_all("saveLog", "generate support file .", "generate support file .")
        assert replies[0] == "Log saved to disk"
        (written,) = tmp_path.iterdir()
        assert sorted(path.suffix for path in written.iterdir()) == ["", ".txt", ".zip", ".zip"]
        assert not any(str(tmp_path) in str(entry) for entry in box.log)
    assert not list(tmp_path.iterdir())
    box.close()  # harmless


@pytest.mark.parametrize("directory", ["", "..", "/etc", "/programs/..", "no/such", "wait.urp", "a\0b"])
def test_places_that_are_none(folder, directory):
    replies, _ = session(folder, f"generate support file {directory}")
    assert replies == [f"Directory not found: {directory}"]
    assert not list(folder.glob("*.zip"))


def test_a_report_that_is_refused_leaves_nothing_to_the_garbage_collector(folder):
    """What goes into a report is long: the log alone may have 5 MB."""
    gc.collect()
    gc.disable()
    try:
        session(folder, *["generate support file nowhere"] * 3, *["generate flight report unknown"] * 3)
        assert [kept for kept in gc.get_objects() if isinstance(kept, BoxFacts)] == []
    finally:
        gc.enable()
