"""Another package of one of our names is said in one line at import."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.mark.parametrize("package", ["pc_client", "ur_emulator", "urscript"])
@pytest.mark.parametrize("other", ["protocol", "protocol.py"])
def test_another_package_before_ours_is_named(package, other, tmp_path):
    if other.endswith(".py"):
        place = tmp_path / other
    else:
        (tmp_path / other).mkdir()
        place = tmp_path / other / "__init__.py"
    place.touch()
    done = subprocess.run(
        [sys.executable, "-c", f"import {package}"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 1
    last = done.stderr.splitlines()[-1]
    assert f"finds 'protocol' at {place}" in last
    assert "rename the other one" in last
