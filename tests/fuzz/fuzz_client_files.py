"""What reads files of the client: recordings, movements, settings, pen recordings and archives of them."""

import io
import tempfile
import zipfile
from functools import cache
from pathlib import Path

import fuzz_mutations as mutations
from fuzz_cases import Target
from recording_samples import record_movement

from pc_client.analysis.run import analyse_run
from pc_client.control.controller import Controller
from pc_client.errors import ClientError
from pc_client.kinematics.cell_file import load_cell
from pc_client.movements.files import LIBRARY_FOLDER, load_movement
from pc_client.recording.recording import load_recording
from pc_client.studies.extraction.pen import contents, parse_pen, pen_sources
from pc_client.studies.sweep.config import read_config

ROOT = Path(__file__).parents[2]


def _file(suffix, read):
    """Return a reader of content by a reader of files."""

    def read_content(data, folder):
        path = folder / f"case{suffix}"
        path.write_bytes(data)
        return read(path)

    return read_content


@cache
def _recordings():
    with tempfile.TemporaryDirectory() as folder:
        return tuple(
            record_movement(Path(folder) / f"{k}.mcap", duration=duration, rest=0.05).read_bytes()
            for k, duration in enumerate((0.12, 0.4))
        )


def _report(path):
    analyse_run(load_recording(path))


_PEN = b"0,0,0\n" + b"".join(b"%.3f,%.4f,%.4f\n" % (0.01 * k, 0.001 * k * k, 0.002 * k) for k in range(1, 60))
_SAMPLES = b"x,y,z,t\n" + b"".join(
    b"%.4f,%.4f,0.2,%.2f\n" % (0.2 + 0.001 * k, 0.1, 0.01 * k) for k in range(60)
)


@cache
def _archives():
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in ("a.csv", "sub/b.csv", "read me.md"):
            archive.writestr(name, _PEN)
    return (packed.getvalue(),)


def _read_archive(path):
    errors = []
    for source, content in contents(pen_sources([path])):
        try:
            if isinstance(content, Exception):
                raise content
            parse_pen(content, source.name)
        except ClientError as error:
            errors.append(error)
    if errors:
        raise errors[0]


@cache
def _texts(*paths):
    return tuple(path.read_bytes() for path in paths)


def _movement_samples():
    names = ("paper/lognorm_4_1", "paper/uniform_4_1", "arcs/lognorm_5_2", "arcs/uniform_4_1")
    return _texts(*(LIBRARY_FOLDER / f"{name}.toml" for name in names))


def _read_movement(path):
    movement = load_movement(path)
    movement.sample([0.0, 0.5 * movement.duration, movement.duration])


CLIENT_FILES = {
    "recording": Target(_recordings, mutations.mutate_mcap, _file(".mcap", _report), (ClientError,)),
    "movement": Target(
        _movement_samples, mutations.mutate_toml, _file(".toml", _read_movement), (ClientError,)
    ),
    "samples": Target(
        lambda: (_SAMPLES,), mutations.mutate_table, _file(".csv", _read_movement), (ClientError,)
    ),
    "cell": Target(
        lambda: _texts(ROOT / "examples" / "cell.toml"),
        mutations.mutate_toml,
        _file(".toml", load_cell),
        (ClientError,),
    ),
    "controller": Target(
        lambda: (b'base = "paper"\ngain_p = 10.0\ngain_i = 1.5\nuses_ilc = true\n',),
        mutations.mutate_toml,
        _file(".toml", Controller.from_toml),
        (ClientError,),
    ),
    "sweep": Target(
        lambda: (b'movements = ["uniform_4_1"]\nseeds = [1, 2]\n[controller]\ngain_p = [1.0, 2.0]\n',),
        mutations.mutate_toml,
        _file(".toml", read_config),
        (ClientError,),
    ),
    "pen": Target(
        lambda: (_PEN,), mutations.mutate_table, lambda data, folder: parse_pen(data, "a.csv"), (ClientError,)
    ),
    "archive": Target(_archives, mutations.mutate_zip, _file(".zip", _read_archive), (ClientError,)),
}
