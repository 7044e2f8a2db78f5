"""The folder of a search: what it is, and the scenario with the gains that were found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, PositiveInt

from podusv_cli.core import json_text
from podusv_cli.core.errors import UsageError
from podusv_cli.scenario.plugins import FOLDER
from podusv_cli.scenario.resolved import yaml_text
from podusv_cli.scenario.sections import LONGEST_NAME
from podusv_cli.scenario.tune import Tune
from podusv_cli.storage import files, json_files, manifest
from podusv_cli.studies.making.plan import disagreements
from podusv_cli.studies.making.store import SCENARIO
from podusv_cli.studies.tuning import sampler, trials, validation
from podusv_cli.studies.tuning.plan import TunePlan
from podusv_cli.studies.tuning.results import SearchResults

TUNE, TUNED = "tune.json", "tuned.yaml"
UNFINISHED = (SCENARIO, TUNED, trials.FOLDER, validation.FOLDER, FOLDER, "provenance.json")
FORMAT = 3


def check(folder: Path) -> None:
    """Raise UsageError where this is no folder of a search, or one without its scenario."""
    if not (folder / TUNE).is_file():
        raise UsageError(f"{folder} is not the folder of a search: it has no {TUNE}")
    if not (folder / SCENARIO).is_file():
        raise UsageError(
            f"{folder} was interrupted before it had its {SCENARIO}; give the scenario of the "
            f"search: podusv tune CONFIG --out {folder}"
        )


class TuneCall(BaseModel):
    """What one `podusv tune` asked for."""

    model_config = ConfigDict(strict=True, frozen=True)
    budget: PositiveInt
    repeats: PositiveInt
    validate_: PositiveInt = Field(alias="validate")
    started: str


class TuneRecord(BaseModel):
    """What is read of tune.json; there is more."""

    model_config = ConfigDict(strict=True, frozen=True)
    identity: dict[str, Any]
    idle: dict[str, list[str]]
    history: list[TuneCall]


def read_known(folder: Path, plan: TunePlan) -> TuneRecord | None:
    """What tune.json says of this very search; None where the folder is missing or empty.

    Raises UsageError where the folder holds something else, naming what is different.
    """
    if not (folder / TUNE).exists():
        if not files.is_empty(folder):
            raise UsageError(f"{folder} is no search and not empty; name another with --out")
        return None
    noted = json_files.read_as(folder / TUNE, TuneRecord)
    if different := disagreements(noted.identity, _identity(plan)):
        raise UsageError(
            f"{folder} holds another search: {different}; name another folder with --out, or begin "
            "anew with --force"
        )
    _as_much(folder, _read_asked(noted), plan.tune)
    return noted


def clear(folder: Path) -> None:
    """Remove the search that is there. Raises UsageError where there is something else, too."""
    manifest.remove(folder, "search", TUNE, UNFINISHED)


def _read_asked(noted: TuneRecord | None) -> list[dict[str, Any]]:
    return [call.model_dump(by_alias=True) for call in noted.history] if noted else []


def write(
    folder: Path, plan: TunePlan, noted: TuneRecord | None, started: str, texts: Mapping[str, str]
) -> None:
    """Note in tune.json what is asked for, after the earlier calls in `noted`.

    `started` is the time of this call in ISO 8601. `texts` has the scenario and its plug-ins by the
    names of their files. Raises StorageError.
    """
    content = json_text.encode(_content(plan, _read_asked(noted), started))
    # With a larger budget in tune.json than in the scenario, the search could not be continued. And
    # without tune.json, a folder that is not empty is no search.
    if noted:
        files.write_texts(folder, texts)
    files.make_folder(folder)
    files.write_bytes(folder / TUNE, content)
    files.make_folder(folder / trials.FOLDER)
    if not noted:
        files.write_texts(folder, texts)


def _identity(plan: TunePlan) -> dict[str, Any]:
    identity = {"format of tune.json": FORMAT, "optuna": sampler.version(), **plan.identity}
    return json_text.plain(identity)


def _content(plan: TunePlan, history: Sequence[Any], started: str) -> dict[str, Any]:
    """What tune.json says: the search, its identity, and all calls.

    `history` are the earlier ones.
    """
    tune = plan.tune
    asked = {
        "budget": tune.budget,
        "repeats": tune.repeats,
        "validate": tune.validate,
        "started": started,
    }
    return {
        "format": FORMAT,
        "name": plan.scenario.name,
        "laws": list(plan.laws),
        "gains": {law: [gain.key for gain in gains] for law, gains in plan.gains.items()},
        "idle": {law: list(keys) for law, keys in plan.idle.items()},
        "identity": _identity(plan),
        "history": [*history, asked],
    }


def _as_much(folder: Path, history: Sequence[Mapping[str, Any]], tune: Tune) -> None:
    """Raise UsageError where less is asked for than `history`, since runs would be thrown away."""
    for key, unit in (("budget", "runs"), ("repeats", "searches"), ("validate", "fresh draws")):
        there = max((call[key] for call in history), default=0)
        if getattr(tune, key) < there:
            raise UsageError(
                f"{folder} has {key}: {there} ({unit}); ask for as many or more, name another "
                "folder with --out, or begin anew with --force"
            )


def tuned_yaml(results: SearchResults) -> bytes:
    """The scenario with the gains that were found, for `compare` and `sweep`."""
    plan, scenario = results.plan, results.plan.scenario
    several = bool(scenario.controllers)
    laws = {
        law: ({} if several else {"kind": own.label})
        | (dict(results.winner(law).gains) if law in results.winners else {})
        for law, own in plan.laws.items()
    }
    end = "-tuned"
    tuned = {
        "extends": SCENARIO,
        # A name has a greatest length, which the ending must not exceed.
        "name": f"{scenario.name[: LONGEST_NAME - len(end)]}{end}",
        "description": _tell_results(results),
        "controllers": {law: content for law, content in laws.items() if content},
        "tune": None,
    }
    return f"# The gains that podusv tune found.\n{yaml_text(tuned)}".encode()


def _tell_results(results: SearchResults) -> str:
    """The sentence at the head of tuned.yaml: what was minimised, with how many runs and draws."""
    tune = results.plan.tune
    searches: Sequence[str] = [f"{tune.budget} runs", f"{tune.train} draws"]
    what = tune.objective
    return f"Gains that podusv tune found for least {what} ({', '.join(searches)})."
