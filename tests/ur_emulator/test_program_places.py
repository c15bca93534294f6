"""Nothing is read or written out of the programs folder, reports stay within their budgets, and no path is told."""

import json
import os
import resource
import subprocess
import sys
import tempfile
import zipfile
from contextlib import contextmanager
from dataclasses import replace
from pathlib import PurePosixPath

import pytest
from dashboard_support import Dashboard, script_line, urp, write_programs

from ur_emulator.budgets import BUDGETS
from ur_emulator.emulator import ControlBox
from ur_emulator.errors import FileMissingError, ProgramFileError
from ur_emulator.host.ports import robot_api_files
from ur_emulator.host.ports.robot_api_files import KINDS, write_program
from ur_emulator.host.reports import report_files
from ur_emulator.host.reports.report_files import (
    BoxFacts,
    TemporaryFolder,
    flight_report,
    remove_left_folders,
    save_log,
    support_file,
)
from ur_emulator.program_files.folder import PART_NAME, ProgramFolder
from ur_emulator.program_files.loading import load_program

SECRET = 'def secret():\n  textmsg("secret of another user")\nend\n'
FACTS = BoxFacts("20193000007", {"software": "3.15"}, 12.0, {"actual_q": [0.0]}, "the log\n")


@pytest.fixture
def outside(tmp_path):
    """A folder of somebody else."""
    (tmp_path / "outside").mkdir()
    (tmp_path / "outside" / "secret.script").write_text(SECRET)
    return tmp_path / "outside"


@pytest.fixture
def folder(tmp_path, outside):
    (tmp_path / "programs").mkdir()
    return write_programs(tmp_path / "programs")


def session(folder, *lines):
    """Let a box answer lines; return the replies and the log."""
    with (
        ControlBox(in_process=True, pace="lockstep", port_base=None, seed=7, programs=folder) as box,
        Dashboard(box) as dashboard,
    ):
        return dashboard.ask_all(*lines), [str(entry) for entry in box.log]


def parts_left(folder):
    return list(folder.rglob("*.part"))


# --- links


def test_a_saved_script_that_is_a_link_does_not_leak_into_a_support_file(folder, outside):
    (folder / "hello.script").symlink_to(outside / "secret.script")
    replies, _ = session(folder, "load hello.urp", "generate support file .")
    assert replies[0] == "Loading program: /programs/hello.urp"
    with zipfile.ZipFile(folder / replies[1].removeprefix("Completed successfully:")) as archive:
        assert not any(b"secret of" in archive.read(name) for name in archive.namelist())


def test_a_flight_report_that_is_a_link_does_not_leak_into_a_support_file(folder, outside):
    (folder / "flightreports").mkdir()
    (folder / "flightreports" / "flightreport_1.zip").symlink_to(outside / "secret.script")
    os.mkfifo(folder / "flightreports" / "flightreport_2.zip")
    (folder / "flightreports" / "flightreport_3.zip").mkdir()
    name = support_file(ProgramFolder(folder), ".", FACTS)
    with zipfile.ZipFile(folder / name) as archive:
        assert [n for n in archive.namelist() if "flight" in n] == ["flightreports/flightreport_1.zip"]
        assert b"secret of" not in archive.read("flightreports/flightreport_1.zip")


@pytest.mark.parametrize("line", ["generate flight report", "generate support file ."])
def test_a_linked_report_folder_is_not_written_through(folder, outside, line):
    (folder / "flightreports").symlink_to(outside)
    replies, _ = session(folder, line)
    assert "lies outside of the programs folder" in replies[0]
    assert [path.name for path in outside.iterdir()] == ["secret.script"]


def test_a_log_that_is_a_link_is_replaced_and_not_written_through(folder, outside):
    for name in ("log_history.txt", PART_NAME):
        (folder / name).symlink_to(outside / "secret.script")
    assert session(folder, "saveLog")[0] == ["Log saved to disk"]
    assert (outside / "secret.script").read_text() == SECRET
    assert not (folder / "log_history.txt").is_symlink()
    assert not parts_left(folder)


def test_links_that_stay_in_the_folder_work(folder):
    (folder / "real").mkdir()
    (folder / "flightreports").symlink_to("real")
    (folder / "again.urp").symlink_to(folder / "hello.urp")
    (folder / "cell" / "hello.script").symlink_to("../new.script")
    (folder / "new.script").write_text("def new():\n  textmsg(1)\nend\n")
    replies, _ = session(folder, "load again.urp", "load cell/hello.script", "generate flight report")
    assert replies == [
        "Loading program: /programs/hello.urp", "Loading program: /programs/new.script", "Flight Report generated with id:1",
    ]  # fmt: skip
    assert (folder / "real" / "flightreport_1.zip").is_file()


def test_a_folder_that_is_itself_a_link_works(folder, tmp_path):
    (tmp_path / "link").symlink_to(folder)
    replies, _ = session(tmp_path / "link", "load hello.urp", "saveLog")
    assert replies == ["Loading program: /programs/hello.urp", "Log saved to disk"]


@pytest.mark.parametrize("swapped", ["file", "folder"])
def test_a_link_that_is_put_there_after_the_check_leads_nowhere(folder, outside, swapped):
    place = ProgramFolder(folder)
    (folder / "cell" / "secret.script").write_text("x = 1\n")
    found = place.find("cell/secret.script")
    if swapped == "file":
        (folder / "cell" / "secret.script").unlink()
        (folder / "cell" / "secret.script").symlink_to(outside / "secret.script")
    else:
        (folder / "cell").rename(folder / "moved")
        (folder / "cell").symlink_to(outside)
        with pytest.raises(ProgramFileError, match="cannot be written"):
            place.write(PurePosixPath("cell/evil.txt"), b"x")
        assert not (outside / "evil.txt").exists()
    with pytest.raises(ProgramFileError, match="cannot be read"):
        place.read(found, 1000)


# --- what is no file


def test_pipes_devices_and_folders_are_no_programs(folder):
    os.mkfifo(folder / "pipe.script")
    os.mkfifo(folder / "wait.script")  # beside a program
    (folder / "folder.script").mkdir()
    (folder / "null.script").symlink_to("/dev/null")
    replies, _ = session(
        folder, *(f"load {name}.script" for name in ("pipe", "folder", "null")), "load wait.urp"
    )
    assert replies == [
        "File not found: pipe.script", "File not found: folder.script", "File not found: null.script",
        "Loading program: /programs/wait.urp",
    ]  # fmt: skip


def test_a_pipe_that_is_put_there_after_the_check_does_not_block(folder):
    os.mkfifo(folder / "pipe.script")
    with pytest.raises(ProgramFileError, match=r"pipe\.script cannot be read: it is not a file"):
        ProgramFolder(folder).read(PurePosixPath("pipe.script"), 1000)


# --- budgets and disks


@pytest.mark.parametrize(
    ("below", "beyond"), [("./" * 63, "./" * 64), (" " * 4_087, " " * 4_088)], ids=["parts", "characters"]
)
def test_a_long_path_is_no_file_and_is_not_looked_up(folder, below, beyond):
    place = ProgramFolder(folder)
    assert place.find(f"{below}hello.urp") == PurePosixPath("hello.urp")
    with pytest.raises(FileMissingError, match=r"more than 4096 and 64"):
        place.find(f"{beyond}hello.urp")


def test_reports_are_counted_and_the_next_is_refused(folder, monkeypatch):
    monkeypatch.setattr(report_files, "BUDGETS", replace(BUDGETS, report_files=4))
    place = ProgramFolder(folder)
    assert [flight_report(place, "", FACTS) for _ in range(2)] == ["1", "2"]
    support_file(place, "cell", FACTS)  # with a third report
    for write in (lambda: flight_report(place, "", FACTS), lambda: support_file(place, ".", FACTS)):
        with pytest.raises(ProgramFileError, match="the folder holds 4 reports"):
            write()
    (folder / "flightreports" / "flightreport_1.zip").unlink()
    assert flight_report(place, "", FACTS) == "4"
    assert save_log(place, FACTS) == "/programs/log_history.txt"


def test_the_bytes_of_reports_are_bounded(folder, monkeypatch):
    monkeypatch.setattr(report_files, "BUDGETS", replace(BUDGETS, report_bytes=20_000))
    noise = replace(FACTS, log=os.urandom(2000).hex())

    def write_many():
        for _ in range(20):
            support_file(ProgramFolder(folder), ".", noise)

    with pytest.raises(ProgramFileError, match="may hold 50 with 20000: remove some"):
        write_many()
    assert sum(path.stat().st_size for path in folder.rglob("*.zip")) <= 20_000


def test_the_dashboard_reports_that_no_report_is_written_any_more(folder):
    (folder / "flightreports").mkdir()
    for number in range(BUDGETS.report_files):
        (folder / "flightreports" / f"flightreport_{number}.zip").touch()
    replies, _ = session(folder, "generate flight report", "generate support file .", "running")
    assert all("remove some" in reply for reply in replies[:2])
    assert replies[2] == "Program running: false"
    assert not list(folder.glob("*.zip"))


def test_uploads_have_one_total_with_the_programs_that_are_there(folder, monkeypatch):
    place = ProgramFolder(folder)

    def upload(name, size, is_new=True):
        head = f'--XX\r\nContent-Disposition: form-data; name="file"; filename="{name}"\r\n\r\n'
        body = head.encode() + b"#" * size + b"\r\n--XX--\r\n"
        return write_program(place, "multipart/form-data; boundary=XX", body, is_new, "")

    n_programs = len([path for path in folder.rglob("*") if path.suffix in KINDS])
    total = (n_programs + 3) * 4_096
    monkeypatch.setattr(robot_api_files, "BUDGETS", replace(BUDGETS, uploads_bytes=total))
    assert (upload("one.script", 1), upload("two.script", 8_192)) == ("one", "two")
    with pytest.raises(ProgramFileError, match=f"three.script has 1 bytes, .* {total} are allowed, remove"):
        upload("three.script", 1)
    assert upload("two.script", 4_096, is_new=False) == "two"
    assert upload("three.script", 1) == "three"


def test_a_folder_of_too_many_files_gets_no_reports(folder, monkeypatch):
    monkeypatch.setattr("ur_emulator.program_files.folder.BUDGETS", replace(BUDGETS, folder_files=5))
    with pytest.raises(ProgramFileError, match="too many files"):
        flight_report(ProgramFolder(folder), "", FACTS)


@contextmanager
def small_disk():
    """Files may have 1,000 bytes, as if the disk were full then."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_full_disk_is_one_line_and_leaves_nothing(folder):
    place = ProgramFolder(folder)
    noise = replace(FACTS, log=os.urandom(5000).hex())
    writers = (
        lambda: save_log(place, noise), lambda: flight_report(place, "", noise), lambda: support_file(place, ".", noise)
    )  # fmt: skip
    with small_disk():
        for write in writers:
            with pytest.raises(ProgramFileError, match=r"^\S+ cannot be written: [^/\n]+$"):
                write()
    assert not parts_left(folder)
    assert not list(folder.rglob("*.zip"))


def test_what_a_killed_box_has_left_goes_with_the_next_write(folder):
    (folder / PART_NAME).write_bytes(b"half a report")
    support_file(ProgramFolder(folder), ".", FACTS)
    assert not parts_left(folder)


@pytest.mark.parametrize("line", ["saveLog", "generate flight report", "generate support file cell"])
def test_without_rights_it_is_one_line(folder, line):
    (folder / "flightreports").mkdir()
    for place in ("", "flightreports", "cell"):
        (folder / place / PART_NAME).mkdir()  # as good as no rights, and holds for root as well
    replies, log = session(folder, line)
    assert replies[0] != "Log saved to disk"
    assert "Completed" not in replies[0]
    assert "generated" not in replies[0]
    assert str(folder) not in "\n".join(replies + log)


def test_without_a_temporary_folder_it_is_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "gone"))
    with ControlBox(in_process=True, pace="lockstep", port_base=None) as box, Dashboard(box) as dashboard:
        assert "no temporary folder" in dashboard.ask("generate flight report")
        assert dashboard.ask("running") == "Program running: false"
        assert str(tmp_path) not in "".join(map(str, box.log))


def test_the_temporary_folder_of_a_killed_box_goes_with_the_next_one(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    code = f"import tempfile; tempfile.tempdir = {str(tmp_path)!r}\n" + (
        "import os, signal\nfrom ur_emulator.host.reports.report_files import TemporaryFolder\n"
        "folder = TemporaryFolder()\n(folder.path / 'log_history.txt').touch()\nos.kill(os.getpid(), signal.SIGKILL)"
    )
    subprocess.run([sys.executable, "-c", code], check=False)
    (left,) = tmp_path.iterdir()
    others = [tmp_path / name for name in (f"{left.name}.txt", "ur-emulator-box-reports-mine", "somebody")]
    for path in others:
        path.mkdir()
    living = TemporaryFolder()
    with ControlBox(in_process=True, pace="lockstep", port_base=None):
        assert set(tmp_path.iterdir()) == {living.path, *others}
    living.close()
    assert set(tmp_path.iterdir()) == set(others)


def test_a_folder_that_another_box_removes_before_it_is_locked_is_made_again(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    make, made = tempfile.mkdtemp, []

    def make_and_lose(**options):
        made.append(make(**options))
        if len(made) == 1:
            remove_left_folders()
        return made[-1]

    monkeypatch.setattr("tempfile.mkdtemp", make_and_lose)
    folder = TemporaryFolder()
    remove_left_folders()
    assert [str(folder.path)] == made[1:] == [str(path) for path in tmp_path.iterdir()]
    folder.close()


# --- what is told


def test_no_answer_and_no_log_entry_reports_where_the_folder_is(folder, outside):
    (folder / "link.script").symlink_to(outside / "secret.script")
    (folder / "lost.urp").write_bytes(urp(script_line("x = 1"), installation="gone"))
    (folder / "file.urp").write_bytes(urp('<Script type="File"><file>gone.script</file></Script>'))
    (folder / "cut.urp").write_bytes(urp(script_line("x = 1"))[:-20])
    names = [
        "gone.urp",
        "link.script",
        "../secret.script",
        "lost.urp",
        "file.urp",
        "cut.urp",
        "strange.urp",
        "cell",
        "x" * 900,
    ]
    replies, log = session(
        folder, *(f"load {name}" for name in names), "load installation gone", "load installation odd.installation", "saveLog",
        "generate flight report", "generate support file ..", "generate support file cell",
    )  # fmt: skip
    told = json.dumps([replies, log])
    assert str(folder.parent) not in told
    assert "lies outside of the programs folder" in told


def test_names_stay_those_of_the_wire(folder):
    with pytest.raises(FileMissingError, match=r"^there is no file 'gone\.urp' in the programs folder$"):
        load_program(ProgramFolder(folder), "gone.urp")
