"""What fuzzing and attacks have found: files of `corpus/<target>/`, and what each once did.

They are replayed by every test run. A new finding of a campaign (out/fuzz/) gets a file, as small as it goes, and a
row here once it is mended.
"""

from pathlib import Path

CORPUS = Path(__file__).parent / "corpus"
FINDINGS = {
    "archive/bomb.zip": "3.1 GB, and a name outside of the folder",
    "movement/name_leaves_the_folder.toml": "recordings were written beside the folder",
    "movement/shortest_lead.toml": "0 / 0: positions that are no numbers, a warning of numpy",
    "movement/shortest_ramp.toml": "0 / 0: positions that are no numbers, a warning of numpy",
    "movement/stroke_of_ages.toml": "a division by 0: what was added to the time of a stroke vanished",
    "recording/endless_row.mcap": "memory for a row that no file has",
    "recording/length_beyond_all.mcap": "OverflowError of the reader of records",
    "recording/lz4_bomb.mcap": "1.9 GB",
    "recording/nan_time_stamp.mcap": "a traceback, which ended the report of the whole folder",
    "recording/times_go_back.mcap": "ValueError of a spline",
    "samples/endless_speed.csv": "a warning of numpy, ValueError of a spline",
    "samples/shortest_step.csv": "a warning of numpy, ValueError of a spline",
}
