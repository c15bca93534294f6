"""Recordings of all kinds of recorders: what is understood, what is mended, what is refused."""

from __future__ import annotations

import importlib
import zipfile

import numpy as np
import pytest
from extraction_samples import DRAWINGS

from pc_client.errors import RecordingError
from pc_client.studies.extraction.pen import (
    PenPart,
    PenRecording,
    contents,
    ordered_part,
    parse_pen,
    pen_sources,
    read_recording,
)

OMNIGLOT = "START\n10.5,-20.25,0\n11.5,-21.25,9\n12.5,-22.25,20\nBREAK\n30,-40,400\n31,-40,410\nBREAK\n"


def parse(text, unit=None):
    return parse_pen(text.encode(), "f.txt", unit)


def only(text, unit=None):
    (part,) = parse(text, unit).parts
    return part


def test_omniglot_files():
    recording = parse(OMNIGLOT)
    assert [part.t.tolist() for part in recording.parts] == [
        pytest.approx([0.0, 0.009, 0.020]),
        pytest.approx([0.400, 0.410]),
    ]
    assert recording.parts[0].p.tolist() == [[10.5, -20.25], [11.5, -21.25], [12.5, -22.25]]
    assert recording.remarks == ()


ROWS = [(1.0, 2.0, 3.0, 0.010), (1.5, 2.5, 3.5, 0.018), (2.0, 3.0, 4.0, 0.026)]


@pytest.mark.parametrize(
    ("header", "order", "separator"),
    [
        ("t,x,y", "txy", ","), ("T,X,Y,Z", "txyz", ", "), ("y,t,x", "ytx", ";"), ("timestamp,x,y,z", "txyz", "\t"),
        ("x [mm],y [mm],t [s]", "xyt", ","), ('"time","x","y"', "txy", ","), ("", "xyt", ";"), ("", "xyzt", ","),
    ],
)  # fmt: skip
def test_columns_by_name_and_by_number(header, order, separator):
    lines = [header.replace(",", separator)] if header else []
    lines += [separator.join(str(row["xyzt".index(axis)]) for axis in order) for row in ROWS]
    part = only("\r\n".join(lines))
    dim = 3 if "z" in order else 2
    assert part.t == pytest.approx([0.0, 0.008, 0.016])
    assert part.p == pytest.approx(np.array(ROWS)[:, :dim])


def test_blanks_comments_a_byte_order_mark_and_other_columns():
    text = "\ufeff# a pen\n\nx y pressure t\n1 2 .5 0\n# half way\n2   3 .6 .01\n"
    part = only(text)
    assert part.p.tolist() == [[1.0, 2.0], [2.0, 3.0]]
    assert part.t == pytest.approx([0.0, 0.01])


@pytest.mark.parametrize(
    ("steps", "header", "given", "seconds"),
    [
        (0.4, "t,x,y", None, 0.4), (1.0, "t,x,y", None, 0.001), (8.0, "t,x,y", None, 0.008),
        (8000.0, "t,x,y", None, 0.008), (8e6, "t,x,y", None, 0.008), (0.4, "t_ms,x,y", None, 0.0004),
        (2.0, "time [sec],x,y", None, 2.0), (2.0, "t,x,y", "s", 2.0), (0.008, "t_s,x,y", "ms", 8e-6),
    ],
)  # fmt: skip
def test_the_unit_of_time(steps, header, given, seconds):
    rows = "".join(f"{index * steps},{index},0\n" for index in range(5))
    assert np.diff(only(f"{header}\n{rows}", given).t) == pytest.approx(seconds)


def test_omniglot_files_with_long_steps_are_still_in_milliseconds():
    assert only("START\n0,0,0\n1,1,900\nBREAK\n").t[1] == pytest.approx(0.9)


def test_an_unknown_unit_is_refused():
    with pytest.raises(RecordingError, match="'hours': give one of s, ms, us, ns"):
        parse(OMNIGLOT, "hours")


def test_a_clock_of_this_century_loses_nothing():
    part = only("t,x,y\n1700000000.000,0,0\n1700000000.008,1,0\n1700000000.016,2,0\n")
    assert part.t == pytest.approx([0.0, 0.008, 0.016], abs=1e-6)


@pytest.mark.parametrize(
    ("rows", "t", "x", "remark"),
    [
        ("0,0,0 .01,1,1 .01,3,1 .02,4,2", [0.0, 0.01, 0.02], [0.0, 2.0, 4.0],
         "1 sample with a repeated time stamp merged by their mean"),
        ("0,0,0 .01,1,0 .02,2,0 .005,9,9 .015,9,9 .03,3,0", [0.0, 0.01, 0.02, 0.03], [0.0, 1.0, 2.0, 3.0],
         "2 samples with time running backwards left out"),
        ("0,0,0 .01,nan,0 ,1,1 .02,inf,1 .03,1,NA .04,4,1", [0.0, 0.04], [0.0, 4.0],
         "4 samples that are not numbers left out"),
        ("0,0,0 .01,1,0 .02,1,0 3.5,3,0", [0.0, 0.01, 0.02, 3.5], [0.0, 1.0, 1.0, 3.0],
         "a gap of 3.48 s bridged by a straight line"),
    ],
)  # fmt: skip
def test_defects_are_mended_with_a_remark(rows, t, x, remark):
    recording = parse("t,x,y\n" + rows.replace(" ", "\n"))
    (part,) = recording.parts
    assert part.t == pytest.approx(t)
    assert part.p[:, 0].tolist() == x
    assert recording.remarks == (remark,)


def test_empty_parts_are_nothing_and_one_sample_is_a_recording():
    assert len(parse("START\nBREAK\nBREAK\n" + OMNIGLOT + "BREAK\nBREAK\n").parts) == 2
    assert only("x,y,t\n4,5,100\n").t.tolist() == [0.0]


def test_parts_whose_clock_starts_again_come_one_after_the_other():
    recording = parse("START\n0,0,0\n1,1,10\n2,2,20\nBREAK\n5,5,0\n6,6,10\nBREAK\n")
    assert recording.parts[1].t == pytest.approx([0.12, 0.13])
    assert "1 of 2 parts began before the last ended" in recording.remarks[0]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "no samples"),
        (b"START\nBREAK\n", "no samples"),
        (b"x,y,t\n", "no samples"),
        (b"\x89PNG\r\n\x1a\n\0\0", "no text file"),
        (b"hello world\n1,2,3\n", 'line 1: "hello, world" is neither a sample nor a header'),
        (b"x,t\n1,2\n", "neither a sample nor a header with x, y and t"),
        (b"1,2\n3,4\n", "line 1: 2 columns and no header"),
        (b"x,y,t\n1,2,3\n1,2\n", "line 3: 2 columns after lines of 3"),
        (b"x,y,t\n1,2,3\n1,oops,4\n", 'line 3: "oops" is not a number'),
        (b"x,y,t\n1,2,3\n1,-2e19,4\n", 'line 3: "-2e19" is more than 1e\\+19'),
        (b"x,y,t\nnan,2,3\n1,nan,4\n", "no sample with numbers for all columns"),
        (b"x,y,t_s\n0,0,0\n1,1,1e9\n", "lasts 1e\\+09 s"),
    ],
)
def test_what_makes_no_sense_is_one_line_with_the_file_and_the_place(content, words):
    with pytest.raises(RecordingError, match=words) as caught:
        parse_pen(content, "f.txt")
    assert str(caught.value).startswith("f.txt")
    assert "\n" not in str(caught.value)


def test_a_missing_file(tmp_path):
    with pytest.raises(RecordingError, match=r"nothing\.csv: cannot be read \(No such file"):
        read_recording(tmp_path / "nothing.csv")


def test_parts_are_checked_when_they_are_made():
    with pytest.raises(RecordingError, match="do not rise"):
        PenPart([0.0, 0.0], [[0.0, 0.0], [1.0, 1.0]])
    with pytest.raises(RecordingError, match="NaN"):
        PenPart([0.0, 1.0], [[0.0, np.nan], [1.0, 1.0]])
    with pytest.raises(RecordingError, match="x, y or x, y, z"):
        PenPart([0.0], [[0.0]])
    with pytest.raises(RecordingError, match="flat and others in space"):
        PenRecording("f", (PenPart([0.0], [[0.0, 0.0]]), PenPart([1.0], [[0.0, 0.0, 0.0]])))


def test_nothing_is_left_of_nothing():
    assert ordered_part([], np.zeros((0, 2))) == (None, ())


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "deep").mkdir()
    for name in ("b.txt", "deep/a.CSV", "c.tsv", "notes.md"):
        (tmp_path / name).write_text(OMNIGLOT)
    with zipfile.ZipFile(tmp_path / "all.zip", "w") as archive:
        for name in ("in/b.txt", "in/a.csv", "in/readme.md", "__MACOSX/in/._b.txt"):
            archive.writestr(name, OMNIGLOT)
    return tmp_path


def test_a_folder_is_all_its_recordings(folder):
    names = [source.name for source in pen_sources([folder])]
    assert names == [str(folder / name) for name in ("b.txt", "c.tsv", "deep/a.CSV")]


def test_an_archive_is_all_its_recordings_and_a_file_is_itself_whatever_its_name(folder):
    sources = pen_sources([folder / "gone.txt", folder / "all.zip", str(folder / "notes.md")])
    gone, *found = contents(sources)
    assert [source.name for source, _ in found] == ["in/a.csv", "in/b.txt", str(folder / "notes.md")]
    assert [content for _, content in found] == [OMNIGLOT.encode()] * 3
    assert isinstance(gone[1], RecordingError)  # and does not stop the others


def test_one_recording_is_named_by_its_file_or_its_place_in_an_archive(folder):
    for name in ("b.txt", "all.zip:in/a.csv"):
        assert len(read_recording(folder / name).parts) == 2
    with pytest.raises(RecordingError, match=r"inside\.txt: cannot be unpacked"):
        read_recording(folder / "all.zip:inside.txt")
    for many in (folder, folder / "all.zip"):
        with pytest.raises(RecordingError, match="holds many recordings"):
            read_recording(many)


def test_archives_that_are_none(folder):
    (folder / "bad.zip").write_bytes(b"no zip")
    with zipfile.ZipFile(folder / "empty.zip", "w") as archive:
        archive.writestr("readme.md", "")
    (folder / "none").mkdir()
    for name, words in (
        ("bad.zip", "no .zip archive"), ("gone.zip", "cannot be read"), ("empty.zip", "file in this archive"),
        ("none", "file in this folder"),
    ):  # fmt: skip
        with pytest.raises(RecordingError, match=words):
            pen_sources([folder / name])


def test_the_drawings_of_the_tree_are_found_and_read():
    read = {
        source.name: parse_pen(content, source.name) for source, content in contents(pen_sources([DRAWINGS]))
    }
    marks = {name.rpartition("/")[2]: len(recording.parts) for name, recording in read.items()}
    assert marks == {"elle.txt": 1, "letter_i.txt": 2, "letter_t.txt": 2, "signature.csv": 1, "zigzag.txt": 1}


def test_the_drawings_of_the_tree_are_what_their_program_makes(monkeypatch):
    monkeypatch.syspath_prepend(DRAWINGS)
    made = importlib.import_module("make_drawings").drawings()
    assert made == {
        path.name: path.read_text() for path in DRAWINGS.iterdir() if path.suffix in (".txt", ".csv")
    }
