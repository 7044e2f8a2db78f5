"""`podusv identify --look LOG`: a page of a log before anything is fitted."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from podusv_cli.components.actuators.base import Actuator
from podusv_cli.core.errors import StorageError
from podusv_cli.findings.finding import unknown_codes
from podusv_cli.identify.logs.formats import contents_of
from podusv_cli.identify.logs.listing import Listing, list_contents
from podusv_cli.process.extras import Extras, Failure
from podusv_cli.storage import files
from podusv_cli.workflows.request import Request
from podusv_cli.workflows.run import open_scenario


@dataclass(frozen=True)
class LookedAt:
    """The page of a log, and what it lists."""

    page: Path
    listing: Listing
    missing: tuple[Failure, ...] = ()

    @property
    def folder(self) -> Path:
        """Where the page is."""
        return self.page.parent

    def as_json(self) -> dict[str, Any]:
        """What `--json` prints."""
        return {**self.listing.as_json(), "page": str(self.page)}


def list_log(log: Path, config: str, request: Request) -> Listing:
    """The columns of a log, for the boat in the scenario `config`, "" for any boat.

    Raises LogFault, StorageError, ScenarioError.
    """
    boat = _actuator_of(config, request)
    return list_contents(contents_of(log), log.name, boat)


def _actuator_of(config: str, request: Request) -> Actuator | None:
    """The actuator of the boat in a scenario; None without one. Raises ScenarioError."""
    if not config:
        return None
    return open_scenario(Path(config), request, (unknown_codes,)).scenario.actuator


def look_at(log: Path, config: str, request: Request) -> LookedAt:
    """Write the page of a log, beside which nothing else is needed; `config` as in `list_log`.

    Raises LogFault for what is no log, StorageError where the page exists and is not replaced.
    """
    boat = _actuator_of(config, request)
    page = request.out or Path(f"{log.stem}_look.html")
    if page.exists() and not request.force:
        raise StorageError(f"{page} exists; name another with --out, or replace it with --force")
    # Read only now: a log may be long, and the page's place may be refused.
    contents = contents_of(log)
    found, extras = list_contents(contents, log.name, boat), Extras()
    from podusv_cli.figures.sketch import render_sketches
    from podusv_cli.identify.look import page_of, sketches_of  # matplotlib is slow to import

    pictures = render_sketches(sketches_of(contents, found), extras)[1] if request.figures else []
    files.make_folder(page.parent)
    files.write_all({page: page_of(log, found, pictures).encode()})
    return LookedAt(page, found, tuple(extras.missing))
