"""Readers of files and answers: some hundred spoilt ones of each kind, and all that was found so far.

The long run is `python tests/fuzz/campaign.py`.
"""

import pytest
from fuzz_cases import run_case, run_cases
from fuzz_findings import CORPUS, FINDINGS
from fuzz_targets import TARGETS


def test_all_findings_are_in_the_corpus():
    assert {str(path.relative_to(CORPUS)) for path in CORPUS.glob("*/*")} == set(FINDINGS)


@pytest.mark.parametrize("name", FINDINGS)
def test_a_finding_does_no_harm_any_more(name, tmp_path):
    path = CORPUS / name
    run_case(TARGETS[path.parent.name], path.read_bytes(), tmp_path)


@pytest.mark.parametrize("name", TARGETS)
def test_spoilt_ones_end_in_one_line(name):
    assert list(run_cases(name, TARGETS[name], 0, range(400))) == []


@pytest.mark.parametrize("name", TARGETS)
def test_samples_that_are_not_spoilt_are_taken(name, tmp_path):
    for sample in TARGETS[name].samples()[:3]:
        TARGETS[name].read(sample, tmp_path)
