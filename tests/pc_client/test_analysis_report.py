"""Table I in its three forms, the page of one experiment, and that of several."""

from __future__ import annotations

import base64
import json
import re
import sys
import xml.etree.ElementTree as ET
from dataclasses import asdict, replace
from html import escape
from pathlib import Path
from typing import Any

import polars as pl
import pytest
from page_support import check_needs_nothing, own_text
from recording_samples import SIGNALS, append_rows, provenance, record_movement
from rich.console import Console

from pc_client import cli
from pc_client.analysis.figures import speeds_figure
from pc_client.analysis.report import Report, build_report, build_side_by_side, build_tables
from pc_client.analysis.run import MeasuredRun, analyse_run
from pc_client.analysis.table import PAPER_SNR_DB, Table, build_table, papers_finding, side_by_side
from pc_client.control.controller import CONTROLLERS, Controller
from pc_client.errors import RecordingError
from pc_client.recording.recorder import Recorder
from pc_client.recording.recording import load_recording


@pytest.fixture
def drawn() -> None:
    """The figures of a page are drawn."""


@pytest.fixture(autouse=True)
def not_drawn(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """The others are empty: they take as long as all else."""
    if "drawn" not in request.fixturenames:
        monkeypatch.setattr("pc_client.results.figures.svg_text", lambda figure: "<svg/>")


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


def test_rows_stand_in_the_papers_order_and_repetitions_in_theirs(table: Table) -> None:
    names = ["uniform_4_2", "uniform_5_1", "lognorm_4_1", "lognorm_5_1", "zigzag"]
    assert table.frame["name"].to_list() == list(table.runs) == names
    for row in table.frame.to_dicts():
        assert [run.provenance.repetition for run in table.runs[row["name"]]] == [1, 2, 3]
        assert row["snr_db"] == sorted(row["snr_db"], reverse=True)  # the lag grows with the repetition
        assert row["lag_ms"] == pytest.approx(20.0, abs=0.5)


def test_json_is_what_others_rely_on(table: Table) -> None:
    data = json.loads(json.dumps(table.to_json(), allow_nan=False))
    facts = {"controller": "preview", "robot": "UR3 3.15.8", "seed": 7, "pace": "lockstep", "simulated": True}
    assert data.items() >= facts.items()
    for row in data["rows"]:
        assert {"kind", "max_position_error_mm", "lag_ms", "noise_floor_db"} <= set(row)
        assert row["mean_snr_db"] == pytest.approx(sum(row["snr_db"]) / 3, abs=1e-5)
        assert row["paper_snr_db"] == PAPER_SNR_DB.get(row["name"])
    uniform = [row["mean_snr_db"] for row in data["rows"] if row["kind"] == "uniform"]
    assert data["mean_snr_db"]["uniform"] == pytest.approx(sum(uniform) / 2, abs=1e-5)
    only_uniform = build_table([run for run in table.all_runs if run.provenance.kind == "uniform"])
    assert only_uniform.to_json()["mean_snr_db"]["lognormal"] is None


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


@pytest.mark.parametrize(
    "change",
    [{"controller": "paper"}, {"seed": 8}, {"simulated": False}, {"firmware": "3.14.3"}, {"serial": "2"}],
)
def test_different_experiments_do_not_mix(
    tmp_path: Path, runs: list[MeasuredRun], change: dict[str, object]
) -> None:
    stranger = analyse_run(load_recording(record(tmp_path, "lognorm_5_2", 1, **change)))
    with pytest.raises(RecordingError, match=r"lognorm_5_2_r1\.mcap is of another experiment"):
        build_table([*runs, stranger])


def figures_of(html: str) -> list[str]:
    return [
        base64.b64decode(data).decode() for data in re.findall(r'"data:image/svg\+xml;base64,([^"]+)"', html)
    ]


@pytest.mark.usefixtures("drawn")
def test_report_is_one_page_that_needs_nothing_else(tmp_path: Path) -> None:
    for movement in ("uniform_4_1", "lognorm_4_1"):
        for k in (1, 2, 3):
            record(tmp_path, movement, k)
    report = build_report(tmp_path)
    assert [p.name for p in report.paths] == ["table1.json", "table1.md", "report.html"]
    html = report.paths[2].read_text()
    check_needs_nothing(html)
    assert re.findall(r'href="(?!#)', own_text(html)) == []
    assert len(html) < 3_000_000
    figures = figures_of(html)
    assert len(figures) == 5
    of_movements = [svg for svg in figures if "<!-- TCP path and target points, base frame -->" in svg]
    for svg in of_movements:
        assert all(f"<!-- {name} -->" in svg for name in ("desired", "base", "wrist 3"))
        assert svg.count("<!-- actual r") == 3
    assert len(of_movements) == 2
    for svg in figures:
        assert "<!-- SIMULATED -->" in svg  # the text as drawn
        assert re.findall(r'(?:xlink:)?href="(?!#)', svg) == []
    assert "no cell file: bare arm on a plane z = 0" in html
    assert str(tmp_path) not in html
    assert json.loads(report.paths[0].read_text()) == report.table.to_json()
    again = build_report(tmp_path, Console(quiet=True))
    assert again.paths[2].read_text() == html


@pytest.mark.usefixtures("drawn")
@pytest.mark.parametrize(
    ("simulated", "mark", "arm"),
    [
        (True, "SIMULATED", "SIMULATED UR3 3.15.8"),
        (None, "NOT KNOWN whether real or simulated", "NOT KNOWN whether real or simulated: UR3 3.15.8"),
        (False, "", "UR3 3.15.8"),
    ],
)
def test_page_and_every_figure_say_whose_data_they_are(
    tmp_path: Path, simulated: bool | None, mark: str, arm: str
) -> None:
    record(tmp_path, "lognorm_4_1", 1, simulated=simulated, seed=None, serial="unknown")
    report = build_report(tmp_path)
    html = report.paths[2].read_text()
    assert ("measured on a real arm" in html) == (simulated is False)
    assert html.count(mark) >= 3  # title, banner, movement, provenance
    for said in ("SIMULATED", "NOT KNOWN"):
        is_said = mark.startswith(said)
        assert (said in html) == is_said
        assert all((said in svg) == is_said for svg in figures_of(html))
    assert report.table.to_json()["simulated"] is simulated
    assert report.table.title == f"Table I: {arm}, controller preview"
    # Figures are wider than a narrow screen: their own mark is out of sight there, at the right.
    style = re.findall(r"<style>.*?</style>", html, re.DOTALL)[0]
    narrow = style.partition("@media screen and (max-width")[2]
    assert ('content: "SIMULATED"; position: sticky; left: 0' in narrow) == (simulated is True)


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


@pytest.mark.usefixtures("drawn")
def test_one_own_movement_is_not_set_beside_the_paper_and_has_no_means(tmp_path: Path) -> None:
    record(tmp_path, "wave", 1, rest=0.2)
    report = build_report(tmp_path)
    html = own_text(report.paths[2].read_text())
    assert heads(html)[:4] == ["movement", "SNR", "position error", "path error"]
    body = html.partition("<header>")[2]
    assert not re.search(
        r"[Mm]eans? (SNR|of|over|logn)|Table I|beside the paper|beside that|not in the paper", body
    )
    assert "It is not known here: these recordings hold fewer than 25 control cycles of rest" in html
    assert not any("paper" in svg for svg in figures_of(report.paths[2].read_text()))
    assert report.paths[1].read_text().startswith("# SNR of the TCP speed: SIMULATED")
    record(tmp_path, "wave", 2)
    html = own_text(build_report(tmp_path).paths[2].read_text())
    assert heads(html)[:5] == ["movement", "r1", "r2", "mean", "noise floor"]
    assert "It is not known here" not in html
    assert "mean lognormal" not in html  # of one movement


def heads(html: str) -> list[str]:
    return re.findall(r"<th>(.*?)(?:<br>.*?)?</th>", html)


@pytest.mark.usefixtures("drawn")
def test_names_from_a_recording_cannot_break_the_page(tmp_path: Path) -> None:
    prov = provenance(movement="<b>evil", serial="<script>")
    record_movement(tmp_path / "evil_r1.mcap", lag=0.01, prov=prov)
    html = build_report(tmp_path).paths[2].read_text()
    assert "<script>" not in own_text(html)
    assert "<b>evil" not in html
    assert len(figures_of(html)) == 4
    assert all(ET.fromstring(svg).tag.endswith("}svg") for svg in figures_of(html))


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


def test_missing_library_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    record(tmp_path, "lognorm_4_1", 1)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(
        RecordingError, match=r"needs matplotlib; install it with: pip install 'ur-hil\[report\]'"
    ):
        build_report(tmp_path)


PAPER, PREVIEW = CONTROLLERS["paper"], CONTROLLERS["preview"]
QUICK = replace(PAPER, gain_p=10.0, gain_i=5.0)
MOVEMENTS = ("uniform_4_1", "lognorm_4_1")


def record_all(
    folder: Path,
    config: Controller,
    movements: tuple[str, ...] = MOVEMENTS,
    duration: float = 2.0,
    **changes: object,
) -> Path:
    folder.mkdir()
    for k, movement in enumerate(movements):
        whose: dict[str, Any] = {
            "movement": movement,
            "target_points": ((0.1 * (k // 2), 0.0, 0.0), (0.1, 0.2, 0.3)),
            "kind": "uniform" if movement.startswith("uniform") else "lognormal",
            "controller": config.title,
            "controller_config": asdict(config),
        }
        prov = provenance(**whose | changes)
        lag = (0.1 + 0.01 * k) / config.gain_p
        record_movement(
            folder / f"{movement}_r1.mcap", lag=lag, noise=5e-6, seed=k, duration=duration, prov=prov
        )
    return folder


@pytest.fixture(scope="module")
def reports(tmp_path_factory: pytest.TempPathFactory) -> list[Report]:
    out = tmp_path_factory.mktemp("demo")
    published = build_report(record_all(out / "published", PAPER))
    others = [build_tables(record_all(out / name, c)) for name, c in (("preview", PREVIEW), ("quick", QUICK))]
    return [published, *others]


def test_other_numbers_of_a_controller_are_no_column_of_their_own(reports: list[Report]) -> None:
    published, preview, quick = (report.table for report in reports)
    shown = side_by_side([published, preview, quick])
    assert shown.columns == (published, preview)
    assert shown.changes_of(published) == [published, quick]
    assert shown.changes_of(preview) == []
    alone = side_by_side([preview, quick])  # nothing to compare its numbers with
    assert (alone.columns, alone.changed) == ((preview, quick), ())


def test_terminal_tables_fit_eighty_columns_and_give_no_differences(
    table: Table, reports: list[Report]
) -> None:
    console, together = Console(width=80), side_by_side([report.table for report in reports])
    with console.capture() as capture:
        console.print(table.to_rich(), together.to_rich())
    text = capture.get()
    assert "…" not in text
    assert "[mm]" in text
    assert together.finding.count("dB (no interval; 1 pair) with") == 2
    assert "published controller, preview: SIMULATED UR3 3.15.8, seed 7" in text
    assert "29.90" in text
    for report in reports[:2]:
        assert f"{report.table.frame['mean_snr_db'][0]:.2f}" in text
    assert not re.search(r"[+]\d", text)


def test_a_movement_that_one_experiment_lacks_is_empty_there(reports: list[Report], tmp_path: Path) -> None:
    more = build_tables(record_all(tmp_path / "more", PREVIEW, ("lognorm_4_1", "zigzag")))
    shown = side_by_side([reports[0].table, more.table])
    assert shown.frame["name"].to_list() == ["uniform_4_1", "lognorm_4_1", "zigzag"]
    assert shown.frame.select(pl.col("^mean_snr_db_.$").is_null()).rows() == [
        (False, True),
        (False, False),
        (True, False),
    ]
    build_side_by_side([reports[0], more], tmp_path / "report.html")


def test_the_page_shows_all_and_needs_nothing_else(reports: list[Report]) -> None:
    out = reports[0].paths[0].parents[1] / "report.html"
    build_side_by_side(reports, out)
    html = out.read_text()
    check_needs_nothing(html)
    text = own_text(html)
    assert re.findall(r'href="([^#][^"]*)"', text) == ["published/report.html"]  # the others have no page
    assert "published controller, preview: SIMULATED UR3 3.15.8, seed 7" in text
    assert "The points of the paper's movements are not published" in text
    assert not re.search(r">\s*[+]\d", text)
    assert "P = 4 1/s" in text
    assert "calibration, not a prediction" in text
    for report in reports:
        assert f"{report.table.mean_of('lognormal'):.2f}" in text
    cells = re.findall(r"<td>(\d+)</td><td>(\d+)</td><td>1</td>", text)
    assert cells == [("4", "2"), ("10", "5")]  # gains and runs of the table of other numbers
    build_side_by_side(reports, out)
    assert out.read_text() == html


def test_the_papers_finding_is_set_beside_ours_with_pairs_and_interval(tmp_path: Path) -> None:
    names = [f"{kind}_{number}" for number in ("4_1", "4_2", "5_1") for kind in ("uniform", "lognorm")]
    tables = [build_tables(record_all(tmp_path / c.name, c, tuple(names))) for c in (PAPER, PREVIEW)]
    shown = build_side_by_side(tables, tmp_path / "report.html")
    assert shown.finding.startswith(papers_finding())
    for report, label in zip(tables, ("published controller", "preview"), strict=True):
        means = dict(report.table.frame.select("name", "mean_snr_db").rows())
        more = sum(means[log] - means[uni] for uni, log in zip(names[::2], names[1::2], strict=True)) / 3
        assert re.search(
            rf"{more:.1f} dB \(95 %: [-\d.]+ to [-\d.]+ dB; 3 pairs, p = [\d.]+\) with {label}", shown.finding
        )
    text = own_text((tmp_path / "report.html").read_text())
    assert escape(shown.finding).replace("&#x27;", "&#39;") in text
    row = r"<td>(lognormal|uniform)</td><td>preview</td><td>published controller</td><td>movement</td><td>3</td>"
    assert len(re.findall(row, text)) == 2
    assert "constant offset between the client" in text
    assert heads(text)[:5] == ["movement", "paper, real UR3", "published controller", "preview", "targets"]
    console = Console(width=200)
    with console.capture() as capture:
        console.print(shown.to_rich())
    assert shown.finding[:60] in capture.get()
    one_kind = build_tables(record_all(tmp_path / "one", PREVIEW, ("lognorm_4_1",)))
    assert side_by_side([one_kind.table]).finding == ""


def test_the_page_says_how_much_of_the_position_error_is_a_constant_offset(tmp_path: Path) -> None:
    record_movement(tmp_path / "a_r1.mcap", offset=(0.003, 0.004, 0.0), noise=1e-7)
    (said,) = side_by_side([build_tables(tmp_path).table]).offsets
    assert said.startswith("preview: 5.0 mm, there the constant offset")
    assert said.endswith("is 5.0 mm; without it and the lag 0.0 mm are left.")


def test_the_same_paths_in_less_time_are_a_row_beside_the_own_pace_with_their_floors(tmp_path: Path) -> None:
    own = build_tables(record_all(tmp_path / "own", PREVIEW))
    fast = build_tables(
        record_all(tmp_path / "fast", PREVIEW, tuple(f"{m}_fast" for m in MOVEMENTS), duration=1.4)
    )
    shown = build_side_by_side([own, fast], tmp_path / "report.html")
    assert (shown.columns, shown.changed) == ((own.table,), (fast.table,))
    other = build_tables(record_all(tmp_path / "other", PREVIEW, ("wave",)))
    assert other.table.duration_in(own.table) is None
    no_points = [
        build_tables(record_all(tmp_path / f"{t}", PREVIEW, duration=t, target_points=())) for t in (2.0, 1.4)
    ]
    assert len(side_by_side([report.table for report in no_points]).columns) == 2
    text = (tmp_path / "report.html").read_text().partition('id="ours"')[2]
    assert "noise floor uniform" in text
    assert re.findall(r"<td>(1|0\.7)</td><td>1</td>", text) == ["1", "0.7"]


@pytest.mark.parametrize(
    ("other", "labels"),
    [
        ({"seed": 8, "serial": "8"}, ["preview, seed 7", "preview, seed 8"]),
        ({"robot_model": "UR3e"}, ["preview, UR3 3.15.8", "preview, UR3e 3.15.8"]),
        ({"pace": "realtime"}, ["preview, lockstep", "preview, realtime"]),
        ({}, ["preview (1)", "preview (2)"]),
    ],
)
def test_experiments_of_one_controller_are_told_apart(
    tmp_path: Path, other: dict[str, object], labels: list[str]
) -> None:
    first = build_tables(record_all(tmp_path / "a", PREVIEW))
    second = build_tables(record_all(tmp_path / "b", PREVIEW, **other))
    shown = side_by_side([first.table, second.table])
    assert shown.labels == labels
    assert [column.header for column in shown.shown()[1] if column.unit == "dB"][1:] == labels


def test_own_movements_are_not_set_beside_the_paper(tmp_path: Path) -> None:
    own = [build_tables(record_all(tmp_path / c.name, c, ("wave", "uniform wave"))) for c in (PAPER, PREVIEW)]
    shown = build_side_by_side(own, tmp_path / "report.html")
    assert shown.finding == ""
    text = own_text((tmp_path / "report.html").read_text()).partition('id="ours"')[0]
    assert "paper's" not in text
    assert "real UR3" not in text


def test_every_movement_has_a_time_axis_with_numbers(reports: list[Report]) -> None:
    experiments = [("a", reports[0].table), ("b", reports[1].table)]
    axes = speeds_figure(list(MOVEMENTS), experiments, "").axes
    assert [one.get_xlabel() for one in axes] == ["time [s]"] * len(MOVEMENTS)
    assert all(one.xaxis.get_tick_params()["labelbottom"] for one in axes)


def test_every_arm_is_named_with_its_mark(reports: list[Report], tmp_path: Path) -> None:
    real = build_tables(record_all(tmp_path / "real", PREVIEW, simulated=False, seed=None))
    old = build_tables(record_all(tmp_path / "old", PREVIEW, simulated=None, seed=None, firmware="3.2.0"))
    shown = build_side_by_side([reports[1], real, old], tmp_path / "report.html")
    assert shown.arms == [
        "preview: SIMULATED UR3 3.15.8, seed 7",
        "preview: UR3 3.15.8",
        "preview: NOT KNOWN whether real or simulated: UR3 3.2.0",
    ]
    html = (tmp_path / "report.html").read_text()
    assert all(arm in html for arm in shown.arms)


def test_nothing_to_show_is_refused() -> None:
    with pytest.raises(RecordingError, match="give at least one folder"):
        side_by_side([])
    with pytest.raises(RecordingError, match="no run"):
        build_table([])


def test_the_command_takes_several_folders(
    reports: list[Report],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr("pc_client.analysis.report.render_page", lambda *_: "")
    folders = [str(report.paths[0].parent) for report in reports[:2]]
    page = tmp_path / "page.html"
    assert cli.run(["report", *folders, "--out", str(page)]) == 0
    out = capsys.readouterr().out
    assert "published" in out
    assert f"report: {page}" in out
    assert page.exists()
    assert cli.run(["report", *folders, "--out", str(page / "page.html")]) == 1
    assert "cannot write" in capsys.readouterr().err
    assert cli.run(["report", folders[0], "--out", str(page)]) == 2
    assert "--out is for several folders" in capsys.readouterr().err
