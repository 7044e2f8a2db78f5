"""A scenario's numbers verified, and kept in a file."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from hashlib import sha256
from pathlib import Path

import podusv_cli
from podusv_cli.core import json_text
from podusv_cli.core.errors import StorageError, UsageError
from podusv_cli.engine.machine import object_cache
from podusv_cli.findings.finding import unknown_codes
from podusv_cli.process import code_folder
from podusv_cli.scenario.limits import limits
from podusv_cli.scenario.load import load
from podusv_cli.scenario.plugins import of_files
from podusv_cli.scenario.resolved import resolved_yaml
from podusv_cli.storage import files, json_files
from podusv_cli.verification import TOLERANCE
from podusv_cli.verification import verify as verification
from podusv_cli.verification.verify import Verification

RESULT = {"format", "tolerance", "steps", "runs", "converged"}  # keys of what `keep` writes


def verify(
    config: Path,
    overrides: Sequence[str],
    tolerance: float,
    out: Path | None = None,
    progress: Callable[[str, float], None] | None = None,
    *,
    force: bool = False,
    plugins: Sequence[str] = (),
    trust: bool = False,
    warn: Callable[[object], None] = lambda finding: None,
) -> Verification:
    """Verify a scenario's numbers, which `keep` can write to the file `out`.

    `tolerance` is the relative change that counts as converged. Raises UsageError for a run folder,
    ScenarioError, LawError, and StorageError where `out` is no place for a file, or is another file
    and not replaced by `force`, before anything is computed.
    """
    if (config / "resolved.yaml").is_file():
        raise UsageError(f"{config} is a run folder; verify its resolved.yaml")
    checks = (unknown_codes, limits(insist=""))
    scenario = (
        load(config, overrides, checks, plugins, of_files(trust)).warn_of_remarks(warn).scenario
    )
    if out:
        files.check_places([out])
        _spare(out, force)
    done = verification.verify(scenario, tolerance, progress)
    # A looser tolerance than the usual one is no proof for others.
    if not done.unconverged_by_run and tolerance <= TOLERANCE:
        _remember(map(resolved_yaml, scenario.singles().values()))
    return done


def _remember(runs: Iterable[str]) -> None:
    """Keep, beside compiled code, that the numbers of these resolved scenarios have converged."""
    for resolved in runs:
        if mark := _mark(resolved):
            with suppress(OSError):  # a hint is shown once more, no more
                code_folder.write(mark, b"")


def is_verified(resolved: str) -> bool:
    """Whether `verify` has found that the numbers of a resolved scenario have converged."""
    mark = _mark(resolved)
    return bool(mark and mark.exists())


def _mark(resolved: str) -> Path | None:
    """The file whose being there says that this scenario is verified; None without a folder."""
    folder = code_folder.code_folder(object_cache.translators())
    digest = sha256(f"{podusv_cli.__version__}\n{resolved}".encode()).hexdigest()[:16]
    return folder / f"{digest}.verified" if folder else None


def keep(done: Verification, out: Path, *, force: bool = False) -> None:
    """Write a verification as JSON to the file `out`. Raises StorageError, as `verify`."""
    _spare(out, force)
    files.make_folder(out.parent)
    files.write_bytes(out, json_text.encode(done.as_json()))


def _spare(out: Path, force: bool) -> None:
    """Raise StorageError where `out` holds anything but an earlier verification.

    With `force`, any file may be replaced.
    """
    if force or not out.exists() or not out.stat().st_size:
        return
    with suppress(StorageError):
        if json_files.read(out).keys() >= RESULT:
            return
    raise StorageError(
        f"{out} exists and is not a result of podusv verify; --force replaces it, or name another "
        "file"
    )
