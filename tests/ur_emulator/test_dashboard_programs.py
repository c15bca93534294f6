"""Programs from a folder: names and places, script files, what is loaded, External Control."""

import pytest
from box_support import FakeNetwork, MessageReader, connect, listening_socket
from dashboard_support import (
    Dashboard,
    external_control,
    installation,
    pc_with_script,
    script_line,
    urp,
    write_programs,
)

from protocol.primary.messages import KeyMessage, PopupMessage, RuntimeExceptionMessage, TextMessage
from protocol.script_channel import MAX_PROGRAM
from ur_emulator.budgets import BUDGETS
from ur_emulator.emulator import ControlBox
from ur_emulator.errors import EmulatorError, FileMissingError, ProgramFileError
from ur_emulator.host.player.external_control import request_program
from ur_emulator.program_files.folder import ProgramFolder
from ur_emulator.program_files.installation import ExternalControlPc
from ur_emulator.program_files.installation_reader import load_installation
from ur_emulator.program_files.loading import as_one_program, load_program, split_header


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "programs").mkdir()
    (tmp_path / "secret.script").write_text('textmsg("secret")\n')
    return write_programs(tmp_path / "programs")


@pytest.fixture
def box(folder, request):
    robot = getattr(request, "param", "ur3")
    with ControlBox(robot, in_process=True, pace="lockstep", port_base=None, seed=7, programs=folder) as box:
        yield box


@pytest.fixture
def dashboard(box):
    with Dashboard(box) as dashboard:
        yield dashboard


@pytest.fixture
def messages(box):
    """What a client of the primary port gets."""
    with connect(box, "primary") as sock:
        reader = MessageReader(sock)
        reader.next()
        yield reader


# --- names


@pytest.mark.parametrize(
    "name", ["{}", "/programs/{}", "/ursim/programs/{}", '"{}"', "./{}"], ids=lambda name: name.format("name")
)
def test_names_of_programs(folder, name):
    path = "cell/count me.script"
    found = ProgramFolder(folder).find(name.format(path))
    assert (str(found), ProgramFolder.wire_path(found)) == (path, f"/programs/{path}")


@pytest.mark.parametrize(
    "name",
    [
        "../secret.script", "/programs/../secret.script", "cell/../../secret.script", "cell/../hello.urp", "/etc/passwd",
        "/programsx/hello.urp", "/hello.urp", "link.script", "circle", "", ".", "cell", "a\0b", "x" * 5000, "no.urp", "~/x",
        "..\\secret.script", "/ursim/hello.urp",
    ],
)  # fmt: skip
def test_names_that_lead_nowhere_or_out(folder, name):
    (folder / "link.script").symlink_to(folder.parent / "secret.script")
    (folder / "circle").symlink_to(folder / "circle")
    with pytest.raises(FileMissingError):
        ProgramFolder(folder).find(name)


def test_a_box_without_folder_has_no_programs():
    with ControlBox(pace="lockstep", port_base=None) as box, Dashboard(box) as dashboard:
        assert dashboard.ask_all("load hello.urp", "play", "load installation default.installation") == [
            "File not found: hello.urp",
            "Failed to execute: play",
            "Loading installation: /programs/default.installation",
        ]
        assert any("give it --programs DIR" in entry.text for entry in box.log)


def test_a_folder_that_does_not_exist_is_refused(tmp_path):
    with pytest.raises(EmulatorError, match="no such folder, make it first"):
        ControlBox(programs=tmp_path / "nowhere")


# --- script files


@pytest.mark.parametrize(
    ("text", "program"),
    [
        ("def p():\n  sync()\nend\n", "def p():\n  sync()\nend"),
        ("# made by hand\n\ndef p():\n  sync()\nend", "def p():\n  sync()\nend"),
        ("sync()\nsync()\n", "def name():\nsync()\nsync()\nend"),
        ("def p():\n  sync()\nend\np()\n", "def name():\ndef p():\n  sync()\nend\np()\nend"),
        ("sec s():\n  sync()\nend\n", "def name():\nsec s():\n  sync()\nend\nend"),
        ("", "def name():\n\nend"),
    ],
    ids=["def", "def after comments", "statements", "def and call", "sec", "empty"],
)
def test_a_script_file_is_one_program(text, program):
    assert as_one_program(text, "name") == program


@pytest.mark.parametrize(
    ("name", "data", "problem"),
    [
        ("p.script", b"x = 1\0", "is not text"),
        ("p.script", "x = 1".encode("utf-16"), "is UTF-16 text: a controller reads UTF-8, save it as that"),
        ("p.script", b"#" * (5 << 20), "more than 4194304 bytes"),
        (
            "notes.txt",
            b"x = 1",
            r"notes\.txt is not a program: its name must end in \.urp, \.script or \.urpx",
        ),
    ],
    ids=["zeros", "utf-16", "long", "other kind"],
)
def test_files_that_are_no_programs(tmp_path, name, data, problem):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(ProgramFileError, match=problem):
        load_program(ProgramFolder(tmp_path), name)


def test_a_script_program_carries_the_name_of_its_file(dashboard, messages):
    assert dashboard.ask("load cell/count me.script") == "Loading program: /programs/cell/count me.script"
    assert dashboard.ask_all("programState", "play") == ["STOPPED count me.script", "Starting program"]
    assert messages.message(KeyMessage).text == "count_me"
    assert messages.message(TextMessage).text == "counted 3"


def test_a_program_that_does_not_compile_is_reported_when_it_is_played(dashboard, messages):
    assert dashboard.ask_all("load broken.script", "play", "programState") == [
        "Loading program: /programs/broken.script", "Failed to execute: play", "STOPPED broken.script",
    ]  # fmt: skip
    told = messages.message(RuntimeExceptionMessage)
    assert (told.line, told.text) == (2, "syntax_error_on_line:2:  x = = 1:")


# --- what is loaded


def test_a_loaded_program_is_in_memory_and_starts_at_the_top_each_time(dashboard, messages, folder):
    dashboard.ask("load hello.urp")
    (folder / "hello.urp").unlink()
    for _ in range(2):
        assert dashboard.ask("play") == "Starting program"
        assert messages.message(TextMessage).text == "hello"
        dashboard.until("programState", "STOPPED hello.urp")


def test_what_is_loaded_stays_when_another_cannot_be_loaded(box, dashboard):
    dashboard.ask("load hello.urp")
    assert dashboard.ask_all("load strange.urp", "load nothing.urp", "get loaded program", "programState") == [
        "Error while loading program: strange.urp", "File not found: nothing.urp",
        "Loaded program: /programs/hello.urp", "STOPPED hello.urp",
    ]  # fmt: skip
    assert any("<PalletWizard> node cannot be turned into a script" in entry.text for entry in box.log)


@pytest.mark.parametrize("state", ["play", "pause"])
def test_nothing_is_loaded_while_a_program_runs(dashboard, state):
    dashboard.ask_all("load wait.urp", "play", state)
    assert dashboard.ask_all("load hello.urp", "load installation other.installation", "get loaded program") == [
        "Error while loading program: hello.urp", "Failed to load installation: other.installation",
        "Loaded program: /programs/wait.urp",
    ]  # fmt: skip


def test_a_program_that_was_sent_shows_the_loaded_name(box, dashboard):
    dashboard.ask("load hello.urp")
    with connect(box, "secondary") as sock:
        sock.sendall(b"def sent():\n  while True:\n    sync()\n  end\nend\n")
        dashboard.until("programState", "PLAYING hello.urp")
    assert dashboard.ask_all("play", "stop", "play") == [
        "Failed to execute: play",
        "Stopped",
        "Starting program",
    ]


# --- installations


@pytest.mark.parametrize(
    ("directory", "attribute", "expected"),
    [
        ("", "cell", "/programs/cell.installation"),
        ("cell", "../cell", "/programs/cell.installation"),
        ("cell", "cell", "/programs/cell.installation"),
        ("cell", "inner", "/programs/cell/inner.installation"),
        ("cell", "default", "/programs/default.installation"),
    ],
)
def test_a_program_brings_its_installation(folder, directory, attribute, expected):
    (folder / "cell.installation").write_bytes(installation("10.0.0.1"))
    (folder / "cell" / "inner.installation").write_bytes(installation("10.0.0.2"))
    (folder / directory / "p.urp").write_bytes(urp("<Halt/>", installation=attribute))
    program = load_program(ProgramFolder(folder), f"{directory}/p.urp".lstrip("/"))
    assert program.installation.wire_path == expected


def test_the_default_installation_of_the_folder_is_read_if_there_is_one(folder):
    files = ProgramFolder(folder)
    assert load_installation(files, "default.installation").pc == ExternalControlPc()
    (folder / "default.installation").write_bytes(installation("10.0.0.1", "50010"))
    assert load_installation(files, "/programs/default.installation").pc == ExternalControlPc(
        "10.0.0.1", 50010
    )
    assert load_program(files, "wait.urp").installation.pc == ExternalControlPc("10.0.0.1", 50010)


@pytest.mark.parametrize("port", ["0", "65536", "9" * 5000])
def test_an_installation_with_a_port_that_is_none(folder, port):
    (folder / "p.installation").write_bytes(installation("h", port))
    with pytest.raises(ProgramFileError, match="of External Control is none of 1 to 65535"):
        load_installation(ProgramFolder(folder), "p.installation")


# --- External Control

SENT = 'textmsg("from the PC")\n'


@pytest.mark.parametrize("box", ["ur3", "ur5e"], indirect=True)
@pytest.mark.parametrize("keep_open", [False, True])
def test_external_control_plays_what_the_pc_sends(dashboard, messages, folder, keep_open):
    with pc_with_script(SENT, keep_open=keep_open) as (port, asked):
        (folder / "pc.urp").write_bytes(
            urp(external_control("127.0.0.1", port) + script_line('textmsg("behind it")'))
        )
        loaded, started = dashboard.ask_all("load pc.urp", "play")
        assert loaded.startswith("Loading program: /programs/pc.urp")
        assert started == "Starting program"
        assert [messages.message(TextMessage).text for _ in range(2)] == ["from the PC", "behind it"]
    assert asked == [b"request_program\n"]


def test_external_control_asks_each_time_it_is_played(dashboard, messages, folder):
    with pc_with_script(SENT, 'textmsg("again")\n') as (port, asked):
        (folder / "pc.urp").write_bytes(urp(external_control("127.0.0.1", port)))
        dashboard.ask_all("load pc.urp", "play")
        assert messages.message(TextMessage).text == "from the PC"
        dashboard.until("programState", "STOPPED pc.urp")
        dashboard.ask("play")
        assert messages.message(TextMessage).text == "again"
    assert len(asked) == 2


@pytest.mark.parametrize("where", ["installation", "installation loaded later", "client"])
def test_where_external_control_finds_its_pc(dashboard, messages, folder, where):
    """The node names a PC, or the installation does, or it is the one that plays the program."""
    with pc_with_script(SENT) as (port, _):
        node, in_program = external_control(), installation()
        if where == "installation":
            in_program = installation("127.0.0.1", port)
        elif where == "client":
            node = external_control("", port)
        (folder / "pc.installation").write_bytes(in_program)
        (folder / "late.installation").write_bytes(installation("127.0.0.1", port))
        (folder / "pc.urp").write_bytes(urp(node, installation="pc"))
        dashboard.ask("load pc.urp")
        if where == "installation loaded later":
            dashboard.ask("load installation late.installation")
        assert dashboard.ask("play") == "Starting program"
        assert messages.message(TextMessage).text == "from the PC"


def test_two_nodes_share_the_header(dashboard, messages, folder):
    sent = "# HEADER_BEGIN\nglobal n = 0\ndef count():\n  n = n + 1\nend\n# HEADER_END\ncount()\ntextmsg(n)\n"
    with pc_with_script(sent) as (port, asked):
        (folder / "pc.urp").write_bytes(urp(external_control("127.0.0.1", port) * 2))
        dashboard.ask_all("load pc.urp", "play")
        assert [messages.message(TextMessage).text for _ in range(2)] == ["1", "2"]
    assert len(asked) == 1


@pytest.mark.parametrize("text", ["a\nb", "# HEADER_END\na\n# HEADER_BEGIN", "# HEADER_BEGIN\na"])
def test_a_program_without_a_whole_header_is_not_split(text):
    assert split_header(text) == ([], text.split("\n"))


@pytest.mark.parametrize(("sent", "problem"), [(None, "cannot be reached"), ("", "sends nothing")])
def test_a_pc_that_does_not_answer_gives_a_program_that_says_so(dashboard, messages, folder, sent, problem):
    with pc_with_script(*([] if sent is None else [sent])) as (port, _):
        if sent is None:
            with listening_socket() as closed:
                port = closed.getsockname()[1]
        (folder / "pc.urp").write_bytes(urp(external_control("127.0.0.1", port)))
        assert dashboard.ask_all("load pc.urp", "play")[1] == "Starting program"
        popup = messages.message(PopupMessage)
        assert problem in popup.text
        assert (popup.is_error, popup.is_blocking) == (True, True)
        assert dashboard.ask_all("programState", "close popup")[0] == "PLAYING pc.urp"
        dashboard.until("programState", "STOPPED pc.urp")


def test_a_pc_that_sends_nonsense_is_informed_on_the_primary_port(dashboard, messages, folder):
    with pc_with_script("x = = 1\n") as (port, _):
        (folder / "pc.urp").write_bytes(urp(external_control("127.0.0.1", port)))
        assert dashboard.ask_all("load pc.urp", "play", "running") == [
            "Loading program: /programs/pc.urp", "Failed to execute: play", "Program running: false",
        ]  # fmt: skip
        assert "syntax_error_on_line" in messages.message(RuntimeExceptionMessage).text


def request(sends, step=1.0):
    """Play with a PC that sends `sends(n)` in step n; return the text, the number of steps and the socket."""
    network, time = FakeNetwork(), [0.0]
    steps = request_program(network, ExternalControlPc("10.0.0.9", 50002), lambda: time[0])
    n_steps = 0
    while True:
        try:
            next(steps)
        except StopIteration as end:
            return end.value, n_steps, network.sockets[0]
        network.sockets[0].inbox += sends(n_steps)
        n_steps += 1
        time[0] += step


@pytest.mark.parametrize(
    ("sends", "step", "words"),
    [
        (lambda n: b"x" * (1 << 20), 0.01, f"it sends more than {MAX_PROGRAM} bytes"),
        (lambda n: b"x", 1.0, "within 30 s"),
        (lambda n: b"x\n", 0.09, "within 30 s"),
        (lambda n: b"", 1.0, "it sends nothing"),
    ],
    ids=["endless", "slow without an end of line", "slow lines", "nothing"],
)
def test_a_pc_that_does_not_come_to_an_end(sends, step, words):
    text, n_steps, sock = request(sends, step)
    assert words in text
    assert text.count("\n") == 2
    assert n_steps * step <= BUDGETS.external_control_time + 10 * step
    assert not sock.is_open
