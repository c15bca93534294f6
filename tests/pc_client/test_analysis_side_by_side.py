"""Several experiments in one table and on one page."""

from __future__ import annotations

import re
from dataclasses import asdict, replace
from pathlib import Path

import polars as pl
import pytest
from page_support import check_needs_nothing, own_text
from recording_samples import provenance, record_movement
from rich.console import Console

from pc_client import cli
from pc_client.analysis.figures import speeds_sheet
from pc_client.analysis.report import Report, build_report, build_tables
from pc_client.analysis.side_by_side import build_side_by_side, side_by_side
from pc_client.analysis.table import Table
from pc_client.control.controller import CONTROLLERS, Controller
from pc_client.errors import RecordingError
from pc_client.results.plotly_figures import plotly_figure

PAPER, PREVIEW = CONTROLLERS["paper"], CONTROLLERS["preview"]
QUICK = replace(PAPER, gain_p=10.0, gain_i=5.0)
MOVEMENTS = ("uniform_4_1", "lognorm_4_1")


def record(
    folder: Path, config: Controller, movements: tuple[str, ...] = MOVEMENTS, **changes: object
) -> Path:
    folder.mkdir()
    for movement in movements:
        prov = provenance(
            movement=movement,
            kind="uniform" if movement.startswith("uniform") else "lognormal",
            controller=config.title,
            controller_config=asdict(config),
            **changes,
        )
        record_movement(folder / f"{movement}_r1.mcap", lag=0.1 / config.gain_p, noise=5e-6, prov=prov)
    return folder


@pytest.fixture(scope="module")
def reports(tmp_path_factory: pytest.TempPathFactory) -> list[Report]:
    out = tmp_path_factory.mktemp("demo")
    published = build_report(record(out / "published", PAPER))
    others = [build_tables(record(out / name, c)) for name, c in (("preview", PREVIEW), ("quick", QUICK))]
    return [published, *others]


def test_other_numbers_of_a_controller_are_no_column_of_their_own(reports: list[Report]) -> None:
    published, preview, quick = (report.table for report in reports)
    shown = side_by_side([published, preview, quick])
    assert shown.columns == (published, preview)
    assert shown.changes_of(published) == [published, quick]
    assert shown.changes_of(preview) == []
    alone = side_by_side([preview, quick])  # nothing to compare its numbers with
    assert (alone.columns, alone.changed) == ((preview, quick), ())


def test_terminal_table_fits_eighty_columns_and_gives_no_differences(reports: list[Report]) -> None:
    console = Console(width=80)
    with console.capture() as capture:
        console.print(side_by_side([report.table for report in reports]).to_rich())
    text = capture.get()
    assert "…" not in text
    assert "published controller, preview: SIMULATED UR3 3.15.8, seed 7" in text
    assert "29.90" in text
    for report in reports[:2]:
        assert f"{report.table.frame['mean_snr_db'][0]:.2f}" in text
    assert not re.search(r"[+]\d", text)


def test_a_movement_that_one_experiment_lacks_is_empty_there(reports: list[Report], tmp_path: Path) -> None:
    more = build_tables(record(tmp_path / "more", PREVIEW, ("lognorm_4_1", "zigzag")))
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


def lead(table: Table) -> str:
    means = table.to_json()["mean_snr_db"]
    more = means["lognormal"] - means["uniform"]
    return f"{abs(more):.1f} dB {'better' if more > 0 else 'worse'}"


def test_the_papers_finding_is_set_beside_ours_in_one_sentence(reports: list[Report], tmp_path: Path) -> None:
    published, preview = (report.table for report in reports[:2])
    said = (
        "The paper found lognormal movements reproduced 2.8 dB better than uniform ones (means of the SNR); "
        f"here they are {lead(published)} (published controller), {lead(preview)} (preview)."
    )
    shown = build_side_by_side(reports[:2], tmp_path / "report.html")
    assert shown.finding == said
    assert said in (tmp_path / "report.html").read_text()
    console = Console(width=200)
    with console.capture() as capture:
        console.print(shown.to_rich())
    assert said[:60] in capture.get()
    one_kind = build_tables(record(tmp_path / "one", PREVIEW, ("lognorm_4_1",)))
    assert side_by_side([one_kind.table]).finding == ""


def test_own_movements_are_not_set_beside_the_paper(tmp_path: Path) -> None:
    own = [build_tables(record(tmp_path / c.name, c, ("wave", "uniform wave"))) for c in (PAPER, PREVIEW)]
    shown = build_side_by_side(own, tmp_path / "report.html")
    assert shown.finding == ""
    text = own_text((tmp_path / "report.html").read_text()).partition('id="ours"')[0]
    assert "paper's" not in text
    assert "real UR3" not in text


def test_what_is_compared_stands_together(reports: list[Report], tmp_path: Path) -> None:
    build_side_by_side(reports[:2], tmp_path / "report.html")
    heads = re.findall(r"<th>(.*?)(?:<br>.*?)?</th>", (tmp_path / "report.html").read_text())
    assert heads[:5] == ["movement", "paper, real UR3", "published controller", "preview", "targets"]


def test_every_movement_has_a_time_axis_with_numbers(reports: list[Report]) -> None:
    experiments = [("a", reports[0].table), ("b", reports[1].table)]
    layout = plotly_figure(speeds_sheet(list(MOVEMENTS), experiments, ""))["layout"]
    axes = [axis for name, axis in layout.items() if name.startswith("xaxis")]
    assert len(axes) == len(MOVEMENTS)
    assert all(axis["showticklabels"] and axis["title"]["text"] == "time [s]" for axis in axes)


def test_what_is_ours_is_reported_where_the_published_controller_is_shown(
    reports: list[Report], tmp_path: Path
) -> None:
    build_side_by_side([reports[1]], tmp_path / "report.html")
    assert "published controller is ours" not in (tmp_path / "report.html").read_text()


def test_every_arm_is_named_with_its_mark(reports: list[Report], tmp_path: Path) -> None:
    real = build_tables(record(tmp_path / "real", PREVIEW, simulated=False, seed=None))
    old = build_tables(record(tmp_path / "old", PREVIEW, simulated=None, seed=None, firmware="3.2.0"))
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


def test_the_command_takes_several_folders(
    reports: list[Report], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
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
