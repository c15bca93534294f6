"""Pictures of extractions are made of anything that moves."""

from __future__ import annotations

import io

import numpy as np
import pytest
from extraction_samples import own_strokes, recorded
from matplotlib.image import imread

from pc_client.studies.extraction.batch import table_of
from pc_client.studies.extraction.extract import extract
from pc_client.studies.extraction.figures import draw_extraction, draw_overview
from pc_client.studies.extraction.pen import PenPart, PenRecording


def ink(png):
    """Share of pixels that are not white."""
    return float(np.mean(imread(io.BytesIO(png))[..., :3].min(axis=2) < 0.9))


@pytest.mark.parametrize("dim", [2, 3])
def test_a_recording(dim, caplog):
    (part,) = recorded(own_strokes(0, dim, n=2), dim).parts
    dot = PenPart([9.0], [[0.0] * dim])
    assert ink(draw_extraction(extract(PenRecording("folder/own.csv", (part, dot))))) > 0.02
    assert caplog.text == ""  # nothing that matplotlib complains about


@pytest.mark.parametrize("n", [0, 1, 40])
def test_a_batch(n):
    rows = [
        {
            "file": f"{i}.txt",
            "snr_v_db": 20.0 + i,
            "snr_t_db": 30.0 + i,
            "n_strokes": 5 + i,
            "n_speed_peaks": 6,
        }
        for i in range(n)
    ]
    empty = ink(draw_overview(table_of([{"file": "dot", "n_strokes": 0, "n_speed_peaks": 0}])))
    assert (ink(draw_overview(table_of(rows))) > empty + 0.01) is (n > 0)
