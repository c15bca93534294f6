"""Table I in its three forms, and the report."""

from __future__ import annotations

import base64
import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from page_support import check_needs_nothing, own_text
from recording_samples import SIGNALS, append_rows, provenance, record_movement
from rich.console import Console

from pc_client.analysis.report import build_report
from pc_client.analysis.run import MeasuredRun, analyse_run
from pc_client.analysis.table import PAPER_SNR_DB, Table, build_table
from pc_client.errors import RecordingError
from pc_client.recording.recorder import Recorder
from pc_client.recording.recording import load_recording


def record(
    folder: Path, movement: str, repetition: int, *, rest: float = 0.8, aborted: str = "", **changes: object
) -> Path:
    kind = "uniform" if movement.startswith("uniform") else "lognormal"
    prov = provenance(movement=movement, kind=kind, repetition=repetition, **changes)
    path = folder / f"{movement}_r{repetition}.mcap"
    faults = {"lag": 0.01 * repetition, "noise": 5e-6, "seed": repetition}
    return record_movement(path, **faults, rest=rest, prov=prov, aborted=aborted)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[MeasuredRun]:
    folder = tmp_path_factory.mktemp("runs")
    names = ["lognorm_5_1", "zigzag", "uniform_5_1", "lognorm_4_1", "uniform_4_2"]
    paths = [record(folder, name, k) for name in names for k in (2, 1, 3)]
    return [analyse_run(load_recording(path)) for path in paths]


@pytest.fixture
def table(runs: list[MeasuredRun]) -> Table:
    return build_table(runs)


def test_the_papers_means() -> None:
    uniform = [v for name, v in PAPER_SNR_DB.items() if name.startswith("uniform")]
    lognormal = [v for name, v in PAPER_SNR_DB.items() if name.startswith("lognorm")]
    assert sum(uniform) / 5 == pytest.approx(19.34, abs=0.005)
    assert sum(lognormal) / 5 == pytest.approx(22.16, abs=0.005)


def test_rows_stand_in_the_papers_order_and_repetitions_in_theirs(table: Table) -> None:
    assert table.frame["name"].to_list() == list(table.runs)
    assert list(table.runs) == [
        "uniform_4_2",
        "uniform_5_1",
        "lognorm_4_1",
        "lognorm_5_1",
        "zigzag",
    ]
    for row in table.frame.to_dicts():
        assert [run.provenance.repetition for run in table.runs[row["name"]]] == [1, 2, 3]
        assert row["snr_db"] == sorted(row["snr_db"], reverse=True)  # the lag grows with the repetition
        assert row["lag_ms"] == pytest.approx(20.0, abs=0.5)


def test_json_is_what_others_rely_on(table: Table) -> None:
    data = json.loads(json.dumps(table.to_json(), allow_nan=False))
    assert {k: data[k] for k in ("controller", "robot", "seed", "pace", "simulated")} == {
        "controller": "preview",
        "robot": "UR3 3.15.8",
        "seed": 7,
        "pace": "lockstep",
        "simulated": True,
    }
    for row in data["rows"]:
        assert set(row) >= {
            "name",
            "kind",
            "snr_db",
            "mean_snr_db",
            "paper_snr_db",
            "max_position_error_mm",
            "lag_ms",
        }
        assert len(row["snr_db"]) == 3
        assert row["mean_snr_db"] == pytest.approx(sum(row["snr_db"]) / 3, abs=1e-5)
        assert row["paper_snr_db"] == PAPER_SNR_DB.get(row["name"])
        assert row["kind"] in {"uniform", "lognormal"}
    assert set(data["mean_snr_db"]) == {"uniform", "lognormal"}
    uniform = [row["mean_snr_db"] for row in data["rows"] if row["kind"] == "uniform"]
    assert data["mean_snr_db"]["uniform"] == pytest.approx(sum(uniform) / 2, abs=1e-5)


def test_a_kind_without_rows_has_no_mean(runs: list[MeasuredRun]) -> None:
    table = build_table([run for run in runs if run.provenance.kind == "uniform"])
    assert table.to_json()["mean_snr_db"]["lognormal"] is None


def test_no_error_at_all_is_null_in_json(tmp_path: Path) -> None:
    table = build_table([analyse_run(load_recording(record_movement(tmp_path / "a.mcap")))])
    assert table.to_json()["rows"][0]["snr_db"] == [None]


def test_markdown(table: Table) -> None:
    lines = table.to_markdown().splitlines()
    assert lines[0] == "# Table I: SIMULATED UR3 3.15.8, seed 7, controller preview"
    rows = [line for line in lines if line.startswith("|")]
    assert len({line.count("|") for line in rows}) == 1
    assert len(rows) == 2 + 5 + 2  # head, movements, means
    mean = next(line for line in rows if line.startswith("| mean uniform"))
    assert f"| {(17.58 + 21.44) / 2:.2f} |" in mean


def test_terminal_table_fits_eighty_columns(table: Table) -> None:
    console = Console(width=80)
    with console.capture() as capture:
        console.print(table.to_rich())
    text = capture.get()
    assert "…" not in text
    assert "[mm]" in text
    assert "SIMULATED" in text
    assert not re.search(r"[+]\d", text)  # no differences: the points are not the paper's


@pytest.mark.parametrize(
    "change", [{"controller": "paper"}, {"seed": 8}, {"simulated": False}, {"firmware": "3.14.3"}]
)
def test_different_experiments_do_not_mix(
    tmp_path: Path, runs: list[MeasuredRun], change: dict[str, object]
) -> None:
    stranger = analyse_run(load_recording(record(tmp_path, "lognorm_5_2", 1, **change)))
    with pytest.raises(RecordingError, match=r"lognorm_5_2_r1\.mcap is of another experiment"):
        build_table([*runs, stranger])


def test_a_table_needs_runs() -> None:
    with pytest.raises(RecordingError, match="no run"):
        build_table([])


def zoomed_of(html: str) -> list[dict[str, Any]]:
    return [json.loads(data) for data in re.findall(r'<script type="application/json">(.*?)</script>', html)]


def figures_of(html: str) -> list[str]:
    return [
        base64.b64decode(data).decode() for data in re.findall(r'"data:image/svg\+xml;base64,([^"]+)"', html)
    ]


def test_report_is_one_page_that_needs_nothing_else(tmp_path: Path) -> None:
    for movement in ("uniform_4_1", "lognorm_4_1"):
        for k in (1, 2, 3):
            record(tmp_path, movement, k)
    report = build_report(tmp_path)
    assert [p.name for p in report.paths] == ["table1.json", "table1.md", "report.html"]
    html = report.paths[2].read_text()
    check_needs_nothing(html)
    assert re.findall(r'href="(?!#)', own_text(html)) == []
    assert len(html) < 7_000_000
    zoomed = zoomed_of(html)
    assert len(zoomed) == 2
    for figure in zoomed:
        assert "<b>SIMULATED</b>" in [note["text"] for note in figure["layout"]["annotations"]]
        assert {"desired", "base", "wrist 3"} <= {trace["name"] for trace in figure["data"]}
        assert sum(trace["name"].startswith("actual r") for trace in figure["data"]) == 3
    figures = figures_of(html)
    assert len(figures) == 3
    for svg in figures:
        assert "<!-- SIMULATED -->" in svg  # the text as drawn
        assert re.findall(r'(?:xlink:)?href="(?!#)', svg) == []
    assert "SIMULATED" in html
    assert str(tmp_path) not in html
    assert json.loads(report.paths[0].read_text()) == report.table.to_json()
    again = build_report(tmp_path, Console(quiet=True))
    assert again.paths[2].read_text() == html


def test_report_of_an_arm_that_may_be_a_real_one_says_so(tmp_path: Path) -> None:
    record(tmp_path, "lognorm_4_1", 1, simulated=None, seed=None, serial="unknown")
    report = build_report(tmp_path)
    mark = "NOT KNOWN whether real or simulated"
    html = report.paths[2].read_text()
    assert html.count(mark) >= 3  # title, banner, movement, provenance
    assert "measured on a real arm" not in html
    assert all(f"<!-- {mark} -->" in svg for svg in figures_of(html))
    assert report.table.to_json()["simulated"] is None
    assert report.table.title == f"Table I: {mark}: UR3 3.15.8, controller preview"


MARGINS = {"gain_margin": 8.6, "phase_margin_deg": 73.0, "delay_margin_s": 0.25, "sensitivity_peak": 1.2}
APART = {"dead_time_s": 0.024, "lag_s": 0.008, "joint_spread_s": 0.002}


@pytest.mark.parametrize(("loop", "told"), [(MARGINS, False), ({**MARGINS, **APART}, True)])
def test_only_what_was_identified_is_reported_of_the_loop(
    tmp_path: Path, loop: dict[str, float], told: bool
) -> None:
    record(tmp_path, "lognorm_4_1", 1, loop=loop)
    report = build_report(tmp_path)
    html = report.paths[2].read_text()
    assert ("dead time 24.0 ms, lag 8.0 ms, single joints within 2.0 ms" in html) == told
    assert ("single joints" in html) == told
    assert "gain 8.6, phase 73°" in html
    assert report.table.to_json()["loop"] == loop


def test_report_of_a_real_arm_does_not_say_simulated(tmp_path: Path) -> None:
    record(tmp_path, "lognorm_4_1", 1, simulated=False, seed=None, serial="2016330001")
    html = build_report(tmp_path).paths[2].read_text()
    assert "SIMULATED" not in html
    assert "measured on a real arm" in html
    assert not any("SIMULATED" in svg or "NOT KNOWN" in svg for svg in figures_of(html))
    assert not any("SIMULATED" in json.dumps(figure) for figure in zoomed_of(html))


def test_one_own_movement_is_not_set_beside_the_paper_and_has_no_means(tmp_path: Path) -> None:
    record(tmp_path, "wave", 1, rest=0.2)
    report = build_report(tmp_path)
    html = own_text(report.paths[2].read_text())
    assert heads(html)[:4] == ["movement", "SNR", "position error", "path error"]
    body = html.partition("<header>")[2]
    assert not re.search(
        r"[Mm]eans? (SNR|of|over|logn)|Table I|beside the paper|beside that|not in the paper", body
    )
    assert "It is not known here: these recordings hold fewer than 30 control cycles of rest" in html
    assert not any("paper" in svg for svg in figures_of(report.paths[2].read_text()))
    assert report.paths[1].read_text().startswith("# SNR of the TCP speed: SIMULATED")
    record(tmp_path, "wave", 2)
    html = own_text(build_report(tmp_path).paths[2].read_text())
    assert heads(html)[:5] == ["movement", "r1", "r2", "mean", "noise floor"]
    assert "It is not known here" not in html
    assert "mean lognormal" not in html  # of one movement


def heads(html: str) -> list[str]:
    return re.findall(r"<th>(.*?)(?:<br>.*?)?</th>", html)


@pytest.mark.parametrize("simulated", [True, False])
def test_on_a_narrow_screen_every_figure_says_what_its_data_are(tmp_path: Path, simulated: bool) -> None:
    """Figures are wider than such a screen: their own mark is out of sight, at the right."""
    record(tmp_path, "wave", 1, simulated=simulated)
    style = re.findall(r"<style>.*?</style>", build_report(tmp_path).paths[2].read_text(), re.DOTALL)[0]
    narrow = style.partition("@media screen and (max-width")[2]
    assert ('content: "SIMULATED"; position: sticky; left: 0' in narrow) == simulated


def test_names_from_a_recording_cannot_break_the_page(tmp_path: Path) -> None:
    prov = provenance(movement="<b>evil", serial="<script>")
    record_movement(tmp_path / "evil_r1.mcap", lag=0.01, prov=prov)
    html = build_report(tmp_path).paths[2].read_text()
    assert "<script>" not in own_text(html)
    assert "<b>evil" not in html
    assert all("<b>evil" not in json.dumps(figure) for figure in zoomed_of(html))


def test_cut_and_aborted_recordings_are_left_out_and_named(tmp_path: Path) -> None:
    record(tmp_path, "lognorm_4_1", 1)
    cut = record(tmp_path, "lognorm_4_1", 2)
    cut.write_bytes(cut.read_bytes()[:-100])
    with Recorder(tmp_path / "lognorm_4_1_r3.mcap", provenance(repetition=3), SIGNALS) as recorder:
        append_rows(recorder, 60)
        recorder.close({"aborted": "RobotStoppedError"})
    with pytest.raises(RecordingError, match=r"r3\.mcap: the run was given up .*: it has no SNR"):
        analyse_run(load_recording(tmp_path / "lognorm_4_1_r3.mcap"))
    (tmp_path / "notes.mcap").write_text("hello")
    report = build_report(tmp_path)
    assert [len(runs) for runs in report.table.runs.values()] == [1]
    assert [line.split(":")[0] for line in report.left_out] == [
        "lognorm_4_1_r2.mcap",
        "lognorm_4_1_r3.mcap",
        "notes.mcap",
    ]
    html = report.paths[2].read_text()
    assert "the run was given up (RobotStoppedError)" in html
    assert str(tmp_path) not in html


def test_a_run_that_was_given_up_is_shown_as_that_outside_of_all_means(tmp_path: Path) -> None:
    whole = record(tmp_path, "lognorm_4_1", 1)
    alone = build_table([analyse_run(load_recording(whole))])
    for movement in ("lognorm_4_1", "lognorm_4_2"):
        record(tmp_path, movement, 2, aborted="DriverError: off its path")
    report = build_report(tmp_path, include_aborted=True)
    assert list(report.table.runs) == ["lognorm_4_1", "lognorm_4_1_r2_given_up", "lognorm_4_2_r2_given_up"]
    assert report.left_out == ()
    assert report.table.mean_of("lognormal") == alone.mean_of("lognormal")
    assert "mean given up" not in report.table.to_markdown()
    text = own_text(report.paths[2].read_text())
    assert "lognorm_4_2_r2_given_up" in text
    assert "SNR, given up" not in text


def test_folders_without_recordings(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="holds no recordings"):
        build_report(tmp_path)
    (tmp_path / "a.mcap").write_text("hello")
    with pytest.raises(RecordingError, match="holds no usable recording"):
        build_report(tmp_path)


@pytest.mark.parametrize("library", ["jinja2", "plotly"])
def test_missing_library_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, library: str
) -> None:
    record(tmp_path, "lognorm_4_1", 1)
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(
        RecordingError, match=rf"needs {library}; install it with: pip install 'ur-hil\[report\]'"
    ):
        build_report(tmp_path)


def test_plotting_is_loaded_only_to_plot() -> None:
    code = (
        "import sys, pc_client.recording.recorder, pc_client.recording.recording, pc_client.analysis.report\n"
        "print([m for m in ('matplotlib', 'plotly', 'jinja2') if m in sys.modules])"
    )
    run = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=Path.cwd()
    )
    assert run.stdout.strip() == "[]"
