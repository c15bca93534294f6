"""Readers of files and answers: some spoilt ones of each kind, and all that was found so far.

The long run is `python tests/fuzz/campaign.py`.
"""

from pathlib import Path

import pytest
from fuzz_files import TARGETS, run_case, run_cases

CORPUS = Path(__file__).parent / "corpus"
FINDINGS = {
    "answer/deep_array.http": "RecursionError in the worker thread: the program waited for ever",
    "answer/empty_fault.http": "IndexError in the worker thread: the program waited for ever",
    "answer/fault_of_text.http": "TypeError in the worker thread: the program waited for ever",
    "answer/gzip_bomb.http": "0.5 MB became 618 MB",
    "answer/gzip_that_is_cut.http": "EOFError in the worker thread: the program waited for ever",
    "answer/length_beyond_all.http": "OverflowError in the worker thread: the program waited for ever",
    "answer/lines_without_end.http": "a traceback instead of an error of the script",
    "answer/status_with_line_break.http": "the error of the program had two lines, the second empty",
    "answer/struct_without_value.http": "IndexError in the worker thread: the program waited for ever",
    "answer/unknown_encoding.http": "LookupError in the worker thread: the program waited for ever",
    "archive/bomb.zip": "3.1 GB, and a name outside of the folder",
    "installation/entities.installation": "entities that double are what XML bombs are made of",
    "installation/long_port.installation": "the log had all of the port's 5,000 digits",
    "movement/name_leaves_the_folder.toml": "recordings were written beside the folder",
    "movement/shortest_lead.toml": "0 / 0: positions that are no numbers, a warning of numpy",
    "movement/shortest_ramp.toml": "0 / 0: positions that are no numbers, a warning of numpy",
    "movement/stroke_of_ages.toml": "a division by 0: what was added to the time of a stroke vanished",
    "program/deep.urp": "trees of 200,000 levels are handled by functions that call themselves",
    "program/line_break_in_the_installation.urp": "the refusal had two lines",
    "program/long_type.urp": "the log had all of its 5,000,000 characters",
    "program/many_elements.urp": "32 kB became 1.3 GB",
    "program/packed_twice_the_limit.urp": "memory of all that was packed",
    "program/references_in_a_circle.urp": "references that lead to each other",
    "recording/endless_row.mcap": "memory for a row that no file has",
    "recording/length_beyond_all.mcap": "OverflowError of the reader of records",
    "recording/lz4_bomb.mcap": "1.9 GB",
    "recording/nan_time_stamp.mcap": "a traceback, which ended the report of the whole folder",
    "recording/times_go_back.mcap": "ValueError of a spline",
    "samples/endless_speed.csv": "a warning of numpy, ValueError of a spline",
    "samples/shortest_step.csv": "a warning of numpy, ValueError of a spline",
}
"""Files of `corpus/<target>/` that fuzzing and attacks have found, and what each once did.

A new finding of a campaign (out/fuzz/) gets a file, as small as it goes, and a row here once it is mended.
"""


def test_all_findings_are_in_the_corpus():
    assert {str(path.relative_to(CORPUS)) for path in CORPUS.glob("*/*")} == set(FINDINGS)


@pytest.mark.parametrize("name", FINDINGS)
def test_a_finding_does_no_harm_any_more(name, tmp_path):
    path = CORPUS / name
    run_case(TARGETS[path.parent.name], path.read_bytes(), tmp_path)


@pytest.mark.parametrize("n_cases", [50, pytest.param(500, marks=pytest.mark.nightly)])
@pytest.mark.parametrize("name", TARGETS)
def test_spoilt_ones_end_in_one_line(name, n_cases):
    assert list(run_cases(name, TARGETS[name], 0, range(n_cases))) == []


@pytest.mark.parametrize("name", TARGETS)
def test_samples_that_are_not_spoilt_are_taken(name, tmp_path):
    for sample in TARGETS[name].samples()[:3]:
        TARGETS[name].read(sample, tmp_path)
