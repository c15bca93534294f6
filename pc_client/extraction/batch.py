"""Many recordings at once, in any `concurrent.futures.Executor`.

    with open_executor() as executor:
        outcomes = extract_many(pen_sources(["drawings.zip", "mine.csv"]), executor)

Files are read here and their bytes handed to the jobs, so a worker on another machine needs no disk of ours.
A recording that cannot be used has an outcome that says so; it does not stop the others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from dataclasses import dataclass, field

from pc_client.errors import ClientError, RecordingError
from pc_client.extraction.extract import ExtractOptions, extract
from pc_client.extraction.files import parse_pen
from pc_client.extraction.results import Row, figures_of, strokes_of
from pc_client.extraction.sources import PenSource, contents
from ur_hil.input_files import MIB

__all__ = ["Job", "Outcome", "extract_many"]

_IN_FLIGHT = 128
"""Jobs handed over and not yet done; enough for many workers."""

_BYTES_IN_FLIGHT = 16 * MIB
"""No further job is handed over while those that are not done hold more [bytes]."""


@dataclass(frozen=True, slots=True)
class Job:
    """One recording to do.

    Attributes:
        name: of the recording.
        content: bytes of its file.
        options: of the extraction.
        time_unit: a key of `files.TIME_UNITS`, or None: from the file.
        with_picture: whether a picture is wanted.
    """

    name: str
    content: bytes
    options: ExtractOptions = field(default_factory=ExtractOptions)
    time_unit: str | None = None
    with_picture: bool = False


@dataclass(frozen=True, slots=True)
class Outcome:
    """The result of one recording.

    Attributes:
        name: of the recording.
        row: its figures (`results.figures_of`), or None when it could not be used.
        strokes: its strokes.
        remarks: what was mended, and what to know about the strokes.
        picture: a PNG file's bytes, where one was wanted and something moves.
        error: one line, when it could not be used.
    """

    name: str
    row: Row | None = None
    strokes: tuple[Row, ...] = ()
    remarks: tuple[str, ...] = ()
    picture: bytes | None = None
    error: str | None = None


def _run_job(job: Job) -> Outcome:
    """Read, extract, and draw where it is wanted."""
    try:
        recording = parse_pen(job.content, job.name, job.time_unit)
        extraction = extract(recording, job.options)
    except ClientError as error:
        return Outcome(job.name, error=str(error))
    picture = None
    if job.with_picture and extraction.parts:
        from pc_client.extraction.figures import draw_extraction

        picture = draw_extraction(extraction)
    return Outcome(
        job.name, figures_of(extraction), tuple(strokes_of(extraction)), extraction.remarks, picture
    )


def extract_many(
    sources: Sequence[PenSource],
    executor: Executor,
    options: ExtractOptions | None = None,
    time_unit: str | None = None,
    n_pictures: int = 0,
    on_outcome: Callable[[Outcome], None] = lambda outcome: None,
) -> list[Outcome]:
    """Extract recordings.

    Args:
        sources: what to extract from, as `sources.pen_sources` finds it in files, folders and .zip archives.
        executor: where.
        options: of each extraction.
        time_unit: a key of `files.TIME_UNITS`, or None: from each file.
        n_pictures: how many of the first recordings get a picture.
        on_outcome: called with every outcome as it comes in, in any order.

    Returns:
        One outcome a recording, in the order of the sources.

    Raises:
        ClientError: the executor broke down.
    """
    outcomes: dict[int, Outcome] = {}
    running: dict[Future[Outcome], tuple[int, Job]] = {}

    def keep(index: int, outcome: Outcome) -> None:
        outcomes[index] = outcome
        on_outcome(outcome)

    def collect(futures: Iterable[Future[Outcome]]) -> None:
        for future in futures:
            index, job = running.pop(future)
            keep(index, _result(future, job.name))

    for index, (source, content) in enumerate(contents(sources)):
        if isinstance(content, RecordingError):
            keep(index, Outcome(source.name, error=str(content)))
            continue
        job = Job(source.name, content, options or ExtractOptions(), time_unit, index < n_pictures)
        running[executor.submit(_run_job, job)] = (index, job)
        while (
            len(running) >= _IN_FLIGHT
            or sum(len(job.content) for _, job in running.values()) > _BYTES_IN_FLIGHT
        ):
            collect(wait(running, return_when=FIRST_COMPLETED).done)
    while running:
        collect(wait(running, return_when=FIRST_COMPLETED).done)
    return [outcomes[index] for index in sorted(outcomes)]


def _result(future: Future[Outcome], name: str) -> Outcome:
    try:
        return future.result()
    except BrokenExecutor as error:
        raise ClientError(f"a worker ended while it extracted {name} ({error}); try fewer workers") from error
    except Exception as error:  # a fault of ours in one recording must not cost the others of the batch
        return Outcome(name, error=f"{name}: the extraction failed ({type(error).__name__}: {error})")
