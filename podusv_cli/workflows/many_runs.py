"""What `podusv sweep run` and `podusv tune` share: options, scenario, executor, session, ending."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path

from podusv_cli.comparison.parsing import parse_claims
from podusv_cli.core.errors import UsageError
from podusv_cli.core.recording import Status
from podusv_cli.findings.finding import unknown_codes
from podusv_cli.process.extras import Extras
from podusv_cli.scenario import plugins
from podusv_cli.scenario.limits import limits
from podusv_cli.scenario.load import LOOKED_AT, Check, Loaded, Plugged, load, load_stored, tree_yaml
from podusv_cli.scenario.model import Scenario
from podusv_cli.storage import files, manifest
from podusv_cli.studies.making.cluster import executor
from podusv_cli.studies.making.dispatch import Executor
from podusv_cli.studies.making.remote import StudyText
from podusv_cli.studies.making.store import SCENARIO
from podusv_cli.workflows.request import Request

Tell = Callable[..., None]
# A scenario's file, the folder of what is to be continued, or a scenario from Python: that is
# loaded with these checks.
Config = Path | Callable[[Sequence[Check]], Loaded]


def loaded_for(
    key: str, advice: str, config: Config, request: Request, faults: Sequence[Check]
) -> Loaded:
    """The scenario with the key `key`, of a file or of a folder that is to be continued.

    `faults` are checks beside the usual ones. Plug-in files of a folder are executed only where the
    request trusts them. Raises ScenarioError, StorageError for a damaged folder, and UsageError,
    with `advice`, where there is no such key.
    """
    if request.out and request.out.exists() and not request.out.is_dir():
        raise UsageError(f"--out {request.out} is a file; name a folder")
    # A study or search keeps no logs, so those of its runs may be of any size.
    checks = (unknown_codes, limits(allow_large=True), *faults)
    given = request.overrides, checks, request.plugins
    if not isinstance(config, Path):
        loaded = config(checks)
    elif config.is_dir():
        loaded = kept_scenario(config, *given, plugins.of_folder(request.trust))
    else:
        loaded = load(config, *given, plugins.of_files(request.trust))
    loaded.warn_of_remarks(lambda lost: request.warn(lost.removeprefix("warning: ")))
    if getattr(loaded.scenario, key) is None:
        named = config if isinstance(config, Path) else loaded.scenario.name
        raise UsageError(f"{named} has no key `{key}`, {advice}")
    # Claims on single runs are only checked here: nobody judges them in a study.
    parse_claims(loaded)
    return loaded


def folder_of(config: Config) -> Path | None:
    """The folder that is to be continued, None for a new study or search."""
    return config if isinstance(config, Path) and config.is_dir() else None


def kept_scenario(
    folder: Path,
    overrides: Sequence[str] = (),
    checks: Sequence[Check] = (),
    added: Sequence[str] = (),
    plugged: Plugged = LOOKED_AT,
) -> Loaded:
    """The scenario that a folder keeps, with `overrides`; it names no file but its plug-ins.

    `added` are plug-ins of the command line, and `plugged` takes in all of them.
    """
    path = folder / SCENARIO
    return load_stored(files.read_text(path), str(path), overrides, checks, added, plugged)


def scenario_texts(loaded: Loaded) -> dict[str, str]:
    """The scenario and its plug-ins, by the names of their files in the folder."""
    return {SCENARIO: tree_yaml(loaded), **loaded.scenario.plugin_files()}


def compiling(request: Request, law: str) -> Callable[[float], None]:
    """What says how much of a law's march is compiled."""
    return lambda part: request.say(f"compiling {law}, once for all runs to come: {part:.0%}")


def one_by_one(law: str, why: str) -> str:
    """That the runs of a law march one by one, which takes about five times as long."""
    return f"{law}: runs march one by one: {why}"


def executor_for(
    request: Request, folder: Path, scenario: Scenario, seal: str
) -> AbstractContextManager[Executor]:
    """Where the units of a folder are made; `seal` digests the study's identity."""
    recipe = StudyText(files.read_text(folder / SCENARIO), tuple(scenario.plugin_files().items()))
    return executor(request.scheduler, request.workers, recipe, seal)


def refusals_of(executor: Executor) -> tuple[str, ...]:
    """Why workers of a cluster got no units."""
    return tuple(executor.provenance().get("refused", {}).values())


def interruption(kept: str, command: str, folder: Path) -> KeyboardInterrupt:
    """What ends a command that was interrupted: what it leaves there, and how to go on."""
    again = plugins.continue_with(command, folder)
    return KeyboardInterrupt(f"interrupted; {kept} are kept, continue with: {again}")


def finish(
    folder: Path, extras: Extras, whole: str, command: str, status: Status = "finished"
) -> None:
    """Write the manifest, or raise KeyboardInterrupt where figures or logs were interrupted.

    `whole` says what is there all the same, and `command` makes the rest.
    """
    if extras.interrupted:
        rest = plugins.continue_with(command, folder)
        raise KeyboardInterrupt(f"interrupted; {whole} are whole, the rest is made by: {rest}")
    manifest.write(folder, status)
