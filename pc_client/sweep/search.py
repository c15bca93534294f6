"""The table [search] of a sweep: optuna chooses settings, in batches, from the results so far."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated

import polars as pl

from pc_client.control.controller import FIELDS, Controller
from pc_client.sweep.ranking import judge
from pc_client.sweep.settings import Axis, Range
from ur_hil.records import record, whole, word

if TYPE_CHECKING:
    from optuna.distributions import BaseDistribution
    from optuna.samplers import BaseSampler

_MOST_TRIALS = 100_000

_KEY = ("controller", *FIELDS)
"""The columns that distinguish all settings."""


@record
class Search:
    """How the best setting is searched.

    The settings depend on these fields, on the results and on the version of optuna, not on how many workers
    there are.

    Attributes:
        trials: settings to try.
        batch: settings that are chosen together, before any of them has a result.
        sampler: "tpe": optuna's tree-structured Parzen estimator; "random": without regard to the results.
        seed: of the sampler.
    """

    trials: Annotated[int, whole(1, _MOST_TRIALS)]
    batch: Annotated[int, whole(1, 1000)] = 8
    sampler: Annotated[str, word(("tpe", "random"))] = "tpe"
    seed: Annotated[int, whole(0, 2**32 - 1)] = 0


def searched(
    bases: Sequence[Controller],
    axes: Mapping[str, Axis],
    search: Search,
    results: Callable[[], pl.DataFrame],
) -> Iterator[list[Controller]]:
    """The settings of a search, batch by batch.

    Nothing of the search itself is stored: with the same results the sampler proposes the same settings. A
    search that was interrupted therefore goes on as if it had not been.

    Args:
        bases: named controllers to choose from.
        axes: values of their fields to choose from.
        search: how many, and how they are chosen.
        results: gives the table of the batch before, when its cases are settled.

    Raises:
        ModuleNotFoundError: optuna is not installed (extra `search`).
    """
    import optuna

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    samplers: dict[str, type[BaseSampler]] = {
        "tpe": optuna.samplers.TPESampler,
        "random": optuna.samplers.RandomSampler,
    }
    study = optuna.create_study(direction="maximize", sampler=samplers[search.sampler](seed=search.seed))  # type: ignore[call-arg]
    named = {base.name: base for base in bases}
    space: dict[str, BaseDistribution] = {"controller": _distribution(tuple(named))}
    space |= {name: _distribution(axis) for name, axis in axes.items()}
    for first in range(0, search.trials, search.batch):
        trials = [study.ask(space) for _ in range(min(search.batch, search.trials - first))]
        settings = []
        for trial in trials:
            values = dict(trial.params)
            settings.append(dataclasses.replace(named[values.pop("controller")], **values))
        yield settings
        judged = judge(results(), _KEY).rows_by_key(_KEY, named=True, unique=True)
        for trial, setting in zip(trials, settings, strict=True):
            found = judged[(setting.name, *(getattr(setting, name) for name in FIELDS))]
            if found["complete"]:
                study.tell(trial, found["mean_snr_db"])
            else:  # a refused setting is worse than any that ran; a failed one says nothing about itself
                state = optuna.trial.TrialState
                study.tell(trial, state=state.FAIL if found["n_failed"] else state.PRUNED)


def _distribution(axis: Axis | tuple[str, ...]) -> BaseDistribution:
    from optuna.distributions import CategoricalDistribution, FloatDistribution

    if isinstance(axis, Range):
        return FloatDistribution(axis.low, axis.high, log=axis.log)
    return CategoricalDistribution(axis)
