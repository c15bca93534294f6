"""Every example runs, and says what its docstring promises."""

import json
import socket
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.timeout(360)  # on a busy machine
ROOT = Path(__file__).parent.parent
EXAMPLES = ROOT / "examples"


def run(name, *arguments):
    result = subprocess.run(
        [sys.executable, str(EXAMPLES / name), *map(str, arguments)],
        capture_output=True, text=True, cwd=ROOT, timeout=300, check=False,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    return result.stdout


@pytest.mark.parametrize(
    ("name", "arguments", "said"),
    [
        ("01_run_a_program.py", (), "and now at p["),
        ("02_read_the_stream.py", ("--seconds", "0.1"), "q = ["),
        ("03_script_without_a_robot.py", (), "did you mean 'textmsg'?"),
        ("04_plan_a_movement.py", (), "top joint speed"),
        ("06_contact.py", (), "Protective"),
    ],
)
def test_example(name, arguments, said):
    assert said in run(name, *arguments)


def test_the_sample_program_of_polyscope_is_played(ur_box_factory):
    box = ur_box_factory(programs=EXAMPLES / "programs")
    with socket.create_connection((box.host, box.ports.dashboard)) as dashboard:
        answers = dashboard.makefile()
        answers.readline()
        for command, answer in (("load pick.urp", "Loading program: "), ("play", "Starting program")):
            dashboard.sendall(f"{command}\n".encode())
            assert answers.readline().startswith(answer)
        box.wait_until(log="parts: 3")
        state = box.wait_until(program_state="STOPPED", steady=True)
    # Home, as the installation has it; the gripper is off.
    assert state.q == pytest.approx([0.0, -1.5, 1.2, -1.27, -1.57, 0.0], abs=1e-3)
    assert not any(state.digital_outputs["standard"])


@pytest.mark.slow
def test_draw(tmp_path):
    """Without a path it draws what is in the tree."""
    said = run("draw.py", "--out", tmp_path, "--repeat", 1)
    assert said.count("executed, aligned") == 3
    assert (tmp_path / "report.html").exists()
    drawn = json.loads((tmp_path / "draw.json").read_text())["drawings"]
    assert [one["name"] for one in drawn] == ["letter_i", "elle", "signature"]


@pytest.mark.slow
def test_demo_and_plot(tmp_path):
    said = run("demo.py", "--out", tmp_path, "--repeat", 1, "--movements", "lognorm_4_1,uniform_4_1")
    assert f"report: {tmp_path / 'report.html'}" in said
    for words in ("real UR3", "published controller, preview: SIMULATED UR3", "19.02", "29.90"):
        assert words in said
    found = {p.parent.name: json.loads(p.read_text()) for p in tmp_path.rglob("table1.json")}
    assert (found["paper"]["controller"], found["preview"]["controller"]) == ("paper", "preview")
    assert found["p10-i5-a3"]["controller"] == "paper with gain_p 10, gain_i 5"
    assert all(table["simulated"] is True and len(table["rows"]) == 2 for table in found.values())
    page = (tmp_path / "report.html").read_text()
    for table in found.values():
        assert f"{table['mean_snr_db']['lognormal']:.2f}" in page
    figure = tmp_path / "speed.png"
    run("05_plot_a_recording.py", tmp_path / "preview" / "lognorm_4_1_r1.mcap", "--out", figure)
    assert figure.read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_ablation(tmp_path):
    said = run("ablation.py", "--quick", "--out", tmp_path)
    assert len(said.splitlines()) == 1
    assert "| best | lag + gear + learning | typical |" in (tmp_path / "ablation.md").read_text()
    assert (tmp_path / "ablation.png").read_bytes().startswith(b"\x89PNG")


def test_no_example_is_left_out():
    tested = {
        "ablation.py",
        "demo.py",
        "draw.py",
        "01_run_a_program.py",
        "02_read_the_stream.py",
        "03_script_without_a_robot.py",
    }
    tested |= {"04_plan_a_movement.py", "05_plot_a_recording.py", "06_contact.py"}
    assert {path.name for path in EXAMPLES.glob("*.py")} == tested
