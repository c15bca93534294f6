"""The page of a sweep: ranking, plots, what is not done. One file that needs no network and holds no date."""

from __future__ import annotations

import polars as pl

from pc_client.control.controller import FIELDS
from pc_client.results.pages import picture, render
from pc_client.results.tables import to_html
from pc_client.sweep.columns import origin_of_rows
from pc_client.sweep.ranking import RANKING, rank_settings, spans_grid, varying

_TEMPLATE = "sweep/sweep.html.j2"
_MOST_SETTINGS = 25
"""Settings in the ranking; the table has all."""

_MOST_ERRORS = 50


def render_page(name: str, table: pl.DataFrame) -> str:
    """Return the text of `sweep.html`.

    Args:
        name: of the sweep.
        table: of the sweep, at least one row.

    Raises:
        ModuleNotFoundError: matplotlib or jinja2 is not installed (extra `report`).
    """
    from pc_client.results.static import draw
    from pc_client.sweep import figures

    rows = table.to_dicts()
    axes = varying(table)
    done = [row for row in rows if row["status"] == "done" and row["snr_db"] is not None]
    pair = map_axes(table)
    settings = rank_settings(table)
    connect = spans_grid(table)
    # Repetitions are no axis of the sweep, but a controller may learn from one to the next.
    plotted = [axis for axis in (*axes, "repetition") if len({row[axis] for row in done}) > 1]
    return render(
        _TEMPLATE,
        name=name,
        axes={axis: len({row[axis] for row in rows}) for axis in axes},
        n_runs=sum(row["status"] == "done" for row in rows),
        n_cases=len({row["case"] for row in rows}),
        origin=origin_of_rows(rows),
        settings=to_html(settings.head(_MOST_SETTINGS), RANKING),
        n_settings=len(settings),
        n_shown=min(len(settings), _MOST_SETTINGS),
        map_figure=picture(figures.map_figure(rows, *pair), "Mean SNR over two settings of the controller")
        if pair and done
        else None,
        axis_figures=[
            picture(
                draw(figures.axis_sheet(done, axis, connect=connect or axis == "repetition")),
                f"SNR over {axis}",
            )
            for axis in plotted
        ],
        not_done=[row for row in rows if row["status"] != "done"][:_MOST_ERRORS],
        n_not_done=sum(row["status"] != "done" for row in rows),
    )


def map_axes(table: pl.DataFrame) -> tuple[str, str] | None:
    """The axes of the map: both gains if they vary, else the controller's first two numbers that do."""
    numbers = [axis for axis in varying(table) if axis in FIELDS and FIELDS[axis].kind is float]
    numbers.sort(key=lambda axis: axis not in ("gain_p", "gain_i"))
    return (numbers[0], numbers[1]) if len(numbers) > 1 else None
