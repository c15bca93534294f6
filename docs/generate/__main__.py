"""Writes all pages that are made from tables: `make docs`."""

import tomllib
from collections.abc import Callable
from pathlib import Path

import mdformat

from docs.generate import (
    control_page,
    coverage_page,
    dashboard_page,
    gripper_page,
    interpreter_page,
    movements_page,
    port_map_page,
    ports_page,
    primary_page,
    programs_page,
    realtime_page,
    results_page,
    robot_api_page,
    rtde_page,
    scripts_page,
    security_page,
    security_policy,
    states_page,
    theory_page,
)
from docs.generate.sessions import with_sessions

DOCS = Path(__file__).parents[1]
_LAYOUT = tomllib.loads((DOCS.parent / ".mdformat.toml").read_text(encoding="utf-8"))
PAGES: dict[str, Callable[[], str]] = {
    "control.md": control_page.render,
    "movements.md": movements_page.render,
    "programs.md": programs_page.render,
    "results.md": results_page.render,
    "states.md": states_page.render,
    "theory.md": theory_page.render,
    "urscript-coverage.md": coverage_page.render,
    "protocol/README.md": ports_page.render,
    "protocol/dashboard.md": dashboard_page.render,
    "protocol/gripper.md": gripper_page.render,
    "protocol/interpreter.md": interpreter_page.render,
    "protocol/modbus.md": port_map_page.render,
    "protocol/primary.md": primary_page.render,
    "protocol/realtime.md": realtime_page.render,
    "protocol/robot_api.md": robot_api_page.render,
    "protocol/rtde.md": rtde_page.render,
    "protocol/scripts.md": scripts_page.render,
    "security.md": security_page.render,
    "../SECURITY.md": security_policy.render,
}
"""What makes each page, by its path below `docs/`."""


def page(path: str) -> str:
    """Return the text of a page, in the layout of all pages."""
    return mdformat.text(PAGES[path](), options=_LAYOUT, extensions=_LAYOUT["extensions"])


if __name__ == "__main__":
    for path in PAGES:
        (DOCS / path).write_text(page(path), encoding="utf-8")
    for place in DOCS.rglob("*.md"):
        text = place.read_text(encoding="utf-8")
        place.write_text(with_sessions(text), encoding="utf-8")
