"""Which gains to try next: Optuna, asked in batches; nothing else of podusv imports it.

A search in one go, in parts or with other workers asks for the same gains, because the sampler is
made anew for every batch, with a seed from the batch's number.
"""

from __future__ import annotations

import hashlib
import json
import math
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from podusv_cli.core.errors import UsageError
from podusv_cli.studies.tuning.space import Gain

STARTUP = 8  # trials before TPE takes over from random numbers: the first batch
WORST = 1e30  # what a sampler gets in place of infinity
Values = Sequence[float]


def optuna() -> Any:
    """The module. Raises UsageError where it is not installed."""
    try:
        module = import_module("optuna")
    except ImportError as error:
        raise UsageError("podusv tune needs Optuna: pip install 'podusv[tune]'") from error
    module.logging.set_verbosity(module.logging.ERROR)
    return module


class Sampler:
    """The trials of one search as Optuna sees them, in memory."""

    def __init__(self, gains: Sequence[Gain], seed: Sequence[Any]) -> None:
        """`seed` is what the random numbers depend on, beside the number of a batch.

        The scenario's own gains are queued as the first trial.
        """
        self._optuna, self._gains, self._seed = optuna(), gains, seed
        self._study = self._optuna.create_study()
        self._asked: list[Any] = []
        own = {gain.key: self._first(gain) for gain in gains}
        self._study.enqueue_trial({k: v for k, v in own.items() if v is not None})

    def ask(self, batch: int, count: int) -> list[dict[str, Any]]:
        """The gains of `count` trials of batch number `batch` (from 0).

        The first trial of batch 0 has the gains of the scenario.
        """
        with _quiet():
            self._study.sampler = self._sampler_for(batch)
            self._asked = [self._study.ask() for _ in range(count)]
            asked = [self._suggest(trial) for trial in self._asked]
        if batch == 0:  # the scenario's own may have more digits, or lie outside of the ranges
            asked[0] = {gain.key: gain.own for gain in self._gains}
        return asked

    def tell(self, values: Values, excesses: Sequence[Values]) -> None:
        """Take in the objective of each trial asked last, and its excess of every inequality.

        `values` are (trials,), `excesses` (trials, inequalities); above 0, an inequality does not
        hold.
        """
        with _quiet():
            for trial, number, over in zip(self._asked, values, excesses, strict=True):
                for place, excess in enumerate(over):
                    trial.set_constraint(str(place), _finite(excess))
                self._study.tell(trial, _finite(number))

    def _sampler_for(self, batch: int) -> Any:
        """An Optuna sampler whose seed depends on the search and `batch` only."""
        text = json.dumps([*self._seed, batch])
        # numpy's older generator, which Optuna uses, takes seeds of 32 bits.
        seed = int.from_bytes(hashlib.sha256(text.encode()).digest()[:4], "little")
        samplers = self._optuna.samplers
        # A batch is asked before any of its trials has a value; `constant_liar` keeps them apart.
        return samplers.TPESampler(
            n_startup_trials=STARTUP, multivariate=True, constant_liar=True, seed=seed
        )

    def _suggest(self, trial: Any) -> dict[str, Any]:
        return {gain.key: self._one(trial, gain) for gain in self._gains}

    def _one(self, trial: Any, gain: Gain) -> Any:
        """The value of one gain that Optuna suggests for a trial."""
        if gain.words:
            return trial.suggest_categorical(gain.key, list(gain.words))
        if gain.whole:
            return trial.suggest_int(gain.key, gain.low, gain.high)
        return gain.value(trial.suggest_float(gain.key, gain.low, gain.high, log=gain.log))

    def _first(self, gain: Gain) -> Any:
        """The scenario's value as the first trial; outside of its range, the nearest end."""
        if gain.words:
            return gain.own if gain.in_range(gain.own) else None
        return min(max(gain.own, gain.low), gain.high)


def importances(
    gains: Sequence[Gain], tried: Sequence[Mapping[str, Any]], values: Values
) -> dict[str, float]:
    """How much of an objective's variation over good trials each gain explains, adding up to 1.

    `tried` are the gains and `values` the objectives of all trials. PED-ANOVA (Watanabe et al.,
    IJCAI 2023), of the best tenth of the trials within all. Empty where all values are equal.
    """
    module = optuna()
    kinds = module.distributions
    space = {
        gain.key: kinds.CategoricalDistribution(list(gain.words))
        if gain.words
        else kinds.IntDistribution(int(gain.low), int(gain.high))
        if gain.whole
        else kinds.FloatDistribution(gain.low, gain.high, log=gain.log)
        for gain in gains
    }
    with _quiet():
        study = module.create_study()
        for trial, number in zip(tried, values, strict=True):
            params = {gain.key: trial[gain.key] for gain in gains if gain.in_range(trial[gain.key])}
            # The scenario's own gains may lie outside of the ranges, and failures have no number.
            if len(params) == len(space) and math.isfinite(number):
                study.add_trial(
                    module.trial.create_trial(params=params, distributions=space, value=number)
                )
        if len({trial.value for trial in study.trials}) < 2:
            return {}
        evaluator = module.importance.PedAnovaImportanceEvaluator()
        return dict(module.importance.get_param_importances(study, evaluator=evaluator))


def version() -> str:
    """Optuna's version, on which the trials depend."""
    return str(optuna().__version__)


def _finite(number: float) -> float:
    return min(max(number, -WORST), WORST)


@contextmanager
def _quiet() -> Iterator[None]:
    """Without Optuna's warnings about options that are experimental."""
    with warnings.catch_warnings(action="ignore"):
        yield
