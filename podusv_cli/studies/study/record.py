"""study.json: what a study is, how many draws were asked for, and what its plug-ins brought."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, PositiveInt, field_validator

from podusv_cli.core.errors import StorageError
from podusv_cli.core.plugins import digest
from podusv_cli.metrics.metric import Accumulator, Metric
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.plugins import BASES, FOLDER, Parts
from podusv_cli.storage import files, json_files
from podusv_cli.storage.run_folder import STUDY

# Stands for what a plug-in's metric gathers during a run; it gathers nothing.
GATHERED = Accumulator(lambda *_: None, lambda _: 0, lambda _: {})


class Asked(BaseModel):
    """What one `podusv sweep run` asked for."""

    model_config = ConfigDict(strict=True, frozen=True)
    draws: PositiveInt
    started: str


class MetricOfPlugin(BaseModel):
    """A metric of a plug-in without its functions; fields as `Metric` has them."""

    model_config = ConfigDict(strict=True, frozen=True)
    unit: str
    meaning: str
    place: int
    happens: bool
    counts_standoff: bool
    symbol: str


class Record(BaseModel):
    """What is read of study.json; only a study with plug-ins has its metrics there."""

    model_config = ConfigDict(strict=True, frozen=True)
    draws: PositiveInt
    identity: dict[str, Any]
    history: list[Asked]
    metrics: list[str] = []
    metrics_of_plugins: dict[str, MetricOfPlugin] = {}

    @field_validator("metrics_of_plugins")
    @classmethod
    def _possible(cls, given: dict[str, MetricOfPlugin]) -> dict[str, MetricOfPlugin]:
        _metrics(given)  # ValueError for a name or unit that no metric has
        return given

    def parts(self) -> Parts:
        """Section, kind and field names of every component that the runs had."""
        return tuple(dict.fromkeys(_parts(self.identity)))

    def foreign(self) -> tuple[Metric, ...]:
        """The metrics of plug-ins, as values that can be told and not gathered."""
        return _metrics(self.metrics_of_plugins)


def _metrics(given: Mapping[str, MetricOfPlugin]) -> tuple[Metric, ...]:
    return tuple(
        Metric(name, accumulator=GATHERED, **one.model_dump()) for name, one in given.items()
    )


def read(folder: Path) -> Record:
    """The record of a study's folder. Raises StorageError."""
    return json_files.read_as(folder / STUDY, Record)


def plugin_files(folder: Path, scenario: Scenario) -> dict[str, str]:
    """The text of each plug-in file in a study's folder, by its name there; none is executed.

    Raises StorageError for a file that is not the one of the study's runs.
    """
    own = {name: one for name, one in scenario.plugins.items() if name.endswith(".py")}
    texts = {name: files.read_text(folder / FOLDER / Path(name).name) for name in own}
    for name, text in texts.items():
        if name != f"{FOLDER}/{Path(name).name}" or digest(text) != own[name].sha256:
            raise StorageError(f"{folder / name} is not the plug-in file of the runs in {folder}")
    return texts


def of_plugins(known: Mapping[str, Metric], own: Mapping[str, Metric]) -> dict[str, Any]:
    """Those known metrics that are not podusv's own, as `MetricOfPlugin` reads them."""
    return {
        name: {fact: getattr(metric, fact) for fact in MetricOfPlugin.model_fields}
        for name, metric in known.items() if name not in own
    }  # fmt: skip


def _parts(identity: Mapping[str, Any]) -> Iterator[tuple[str, str, frozenset[str]]]:
    """Of keys such as `law[0].controller.gain`, and of lists such as `law[0].disturbance`."""
    sections: dict[tuple[str, str], dict[str, Any]] = {}
    for key, content in identity.items():
        run, _, inside = key.partition("].")
        section, _, field = inside.partition(".")
        if section in BASES and field:
            sections.setdefault((run, section), {})[field.partition(".")[0]] = content
        for one in content if section in BASES and isinstance(content, list) and not field else ():
            if isinstance(one, dict):
                yield section, str(one.get("kind")), frozenset(one)
    for (_, section), fields in sections.items():
        yield section, str(fields.get("kind")), frozenset(fields)
