"""A scenario's numbers verified, and kept in a file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from podusv_cli.config.loading import load
from podusv_cli.config.size import limits
from podusv_cli.errors import UsageError
from podusv_cli.logbook import atomic, jsonfile
from podusv_cli.verification import verify as verification
from podusv_cli.verification.verify import Verified


def verify(
    config: Path, overrides: Sequence[str], tolerance: float, out: Path | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> Verified:  # fmt: skip
    """Verify a scenario's numbers, which `keep` can write to the file `out`.

    Raises UsageError for a run folder, ScenarioError, and StorageError where `out` is no place for
    a file, before anything is computed.
    """
    if (config / "resolved.yaml").is_file():
        raise UsageError(f"{config} is a run folder; verify its resolved.yaml")
    scenario = load(config, overrides, checks=(limits(insist=""),)).scenario
    atomic.check_places([out] if out else [])
    return verification.verify(scenario, tolerance, progress)


def keep(done: Verified, out: Path) -> None:
    """Write a verification as JSON to the file `out`. Raises StorageError."""
    atomic.make_folder(out.parent)
    atomic.write_bytes(out, jsonfile.encode(done.as_json()))
