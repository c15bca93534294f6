"""The layer table of docs/architecture.md, held by reading every import."""

import ast
import subprocess
import sys
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
OURS = {"ur_hil", "protocol", "urscript", "ur_emulator", "pc_client", "ur_pendant"}
MAY_IMPORT = {
    "ur_hil": {"pydantic", "pydantic_core", "typer"},
    "protocol": {"numpy"},
    "urscript": {"ur_hil", "protocol", "lark", "numpy", "typer", "rich"},
    "ur_emulator": {"ur_hil", "urscript", "protocol", "mujoco", "numpy", "h11", "typer", "rich", "pytest"},
    "pc_client": {
        "ur_hil", "protocol", "numpy", "scipy", "pinocchio", "typer", "rich", "mcap", "matplotlib", "jinja2", "markupsafe", "polars", "distributed", "optuna",
    },
    "ur_pendant": {
        "ur_hil", "protocol", "ur_emulator", "pc_client", "numpy", "pinocchio", "typer", "rich", "viser", "websockets",
    },
}  # fmt: skip
# Modules of the standard library that a layer must not touch, and the folders in which it may.
EFFECTS = {"socket", "threading", "time", "selectors", "select", "subprocess", "asyncio"}
MAY_HAVE_EFFECTS = {
    "protocol": {"__main__.py"},
    "ur_emulator": {"host", "cli.py", "pytest_plugin.py"},
    "pc_client": {
        "driver",
        "experiment",
        "commands",
        "studies/executors.py",
        "studies/sweep/schedule.py",
        "studies/sweep/guard.py",
        "studies/sweep/store.py",
        "cli.py",
        "recording/recorder.py",
        "results/window.py",
    },
    "ur_pendant": {
        "robot.py",
        "hands.py",
        "guiding.py",
        "server.py",
        "panel.py",
        "recordings.py",
        "window.py",
    },
}
# Inside a package: each part imports those before it, also for types only; those on one line import each other.
BOX_ORDER = (
    {"budgets", "errors"},
    {"machine"},
    {"program_files"},
    {"host"},
    {"emulator"},
    {"__main__", "cli", "pytest_plugin", "script_robots", "script_run"},
)
MACHINE_ORDER = (
    {"models"},
    {"kinematics"},
    {"motion"},
    {"plant"},
    {"controller", "tools"},
    {"scripting"},
    {"commands"},
    {"machine"},
    {"records"},
)
HOST_ORDER = (
    {"box_log"},
    {"runtime"},
    {"script_network"},
    {"pacing", "served_box", "steps"},
    {"memory"},
    {"player", "reports"},
    {"ports"},
    {"box_options"},
    {"control_api"},
    {"journal"},
    {"box"},
    {"replay"},
    {"rack"},
    {"box_process"},
)
CONTROLLER_ORDER = (
    {"events"},
    {"arm_in_space", "clock", "interpreter_queue", "pendant", "robot_mode"},
    {"io"},
    {"safety"},
    {"settings"},
    {"arm_dynamics", "client_inputs", "world_model"},
    {"electrics", "status_words"},
    {"snapshot"},
    {"past_cycles"},
    {"compliance", "force_sense"},
    {"state"},
    {"modbus_map", "program_runner"},
    {"safety_system"},
    {"command"},
    {"controller"},
)
LANGUAGE_ORDER = (
    {"dialect", "errors", "programs", "source", "values"},
    {"syntax"},
    {"formatter"},
    {"catalogue"},
    {"builtins"},
    {"names"},
    {"compile"},
    {"run"},
    {"program"},
    {"check"},
    {"recording_host", "robot"},
    {"commands"},
    {"__main__", "cli"},
)
PROTOCOL_ORDER = (
    {
        "errors",
        "frame_buffer",
        "packing",
        "pose",
        "serial_numbers",
        "ur_types",
        "wire_record",
    },
    {"interpreter", "modbus", "robot_api", "robotiq", "script_channel", "velocity_stream", "xmlrpc"},
    {"modbus_rtu"},
    {"realtime"},
    {"dashboard"},
    {"primary"},
    {"rtde"},
    {"as_text"},
    {"__main__"},
)
ORDERS = {
    "ur_emulator": BOX_ORDER,
    "ur_emulator.machine": MACHINE_ORDER,
    "ur_emulator.host": HOST_ORDER,
    "ur_emulator.machine.controller": CONTROLLER_ORDER,
    "urscript": LANGUAGE_ORDER,
    "protocol": PROTOCOL_ORDER,
}
LEVELS = [
    pytest.param(package, order, level, id=f"{package}-{'+'.join(sorted(order[level]))}")
    for package, order in ORDERS.items()
    for level in range(len(order) - 1)  # the last imports all
]


@cache
def imported_modules(path):
    """Return every imported module or name, in full."""
    found = []
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            here = path.relative_to(ROOT).parent.parts if node.level else ()
            origin = ".".join((*here, node.module) if node.module else here)
            found += [f"{origin}.{alias.name}" for alias in node.names]
    return found


def imports(path):
    return (name.split(".")[0] for name in imported_modules(path))


def modules(package):
    return sorted(folder(package).rglob("*.py"))


def folder(package):
    return ROOT.joinpath(*package.split("."))


@pytest.mark.parametrize("package", sorted(OURS))
def test_packages_import_only_what_their_row_allows(package):
    allowed = MAY_IMPORT[package] | {package} | set(sys.stdlib_module_names)
    wrong = {
        f"{path.relative_to(ROOT)}: {name}"
        for path in modules(package)
        for name in imports(path)
        if name not in allowed
    }
    assert not wrong


@pytest.mark.parametrize("package", ORDERS)
def test_every_part_of_a_package_has_its_place_in_the_order(package):
    parts = {path.relative_to(folder(package)).parts[0].removesuffix(".py") for path in modules(package)}
    assert parts - {"__init__"} == set().union(*ORDERS[package])


@pytest.mark.parametrize(("package", "order", "level"), LEVELS)
def test_the_parts_of_a_package_import_in_one_direction(package, order, level):
    allowed = set().union(*order[: level + 1])
    wrong = {
        f"{path.relative_to(ROOT)}: {module}"
        for path in modules(package)
        if path.relative_to(folder(package)).parts[0].removesuffix(".py") in order[level]
        for module in imported_modules(path)
        if module.startswith(f"{package}.")
        and module.removeprefix(f"{package}.").split(".")[0] not in allowed
    }
    assert not wrong


def test_no_modules_import_each_other_in_a_circle():
    paths = {
        ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
        for package in OURS
        for path in modules(package)
    }

    def module_of(name):  # an imported name is a module, or is in one
        return name if name in paths else name.rpartition(".")[0]

    graph = {name: {module_of(m) for m in imported_modules(path)} - {name} for name, path in paths.items()}
    list(TopologicalSorter(graph).static_order())  # its CycleError names the circle


@pytest.mark.parametrize("package", sorted(OURS))
def test_effects_stay_at_the_rim(package):
    rim = MAY_HAVE_EFFECTS.get(package, set())
    wrong = {
        f"{path.relative_to(ROOT)}: {name}"
        for path in modules(package)
        if rim.isdisjoint(
            (path.relative_to(ROOT / package).parts[0], path.relative_to(ROOT / package).as_posix())
        )
        for name in imports(path)
        if name in EFFECTS
    }
    assert not wrong


@pytest.mark.parametrize(
    ("package", "absent"),
    [
        # Of our own packages the tables above know; these are what libraries load, or what is loaded late.
        (
            "ur_emulator.host.rack",
            {"scipy", "matplotlib", "mcap", "asyncio", "pydantic", "ur_emulator.host.ports.http"},
        ),
        ("ur_emulator.emulator", {"mujoco", "numpy", "lark"}),
        ("ur_emulator.host.runtime.worker", {"mujoco"}),
        ("pc_client.experiment.run", {"ur_emulator", "urscript", "mujoco", "matplotlib"}),
    ],
)
def test_a_fresh_interpreter_loads_nothing_of_the_other_side(package, absent):
    code = f"import sys, {package}; print(*sorted({absent!r} & set(sys.modules)))"
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert result.stdout.strip() == ""
