"""`podusv sweep merge`: the folders of one study joined into one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

from podusv_cli.core.errors import UsageError
from podusv_cli.storage import files
from podusv_cli.storage.writer import TABLES, sole_writer
from podusv_cli.studies.making import record
from podusv_cli.studies.making.dispatch import StudyTally
from podusv_cli.studies.making.joining import gaps, join, mixture
from podusv_cli.studies.making.sessions import SessionLog
from podusv_cli.studies.making.store import SCENARIO, Store
from podusv_cli.workflows.request import Request
from podusv_cli.workflows.studies import open_store
from podusv_cli.workflows.sweep import Swept, answer_study


def merge(studies: Sequence[Path], out: Path, request: Request) -> Swept:
    """Join the units of several folders of one study, and judge it where it is whole.

    Raises UsageError where one holds another study, and StorageError where two have made the same
    run with other numbers, as machines of another kind do.
    """
    if inside := [study for study in studies if study.resolve() == out.resolve()]:
        raise UsageError(f"--out {out} is one of the studies, {inside[0]}; name another folder")
    started = datetime.now(UTC)
    others = [open_store(study) for study in studies]
    # The largest study has room for the draws of all.
    most = max(others, key=lambda other: other.about.draws)
    store = Store(out, most.about)
    for other in others:
        store.agree(other)
    plugins = record.plugin_files(most.folder, most.about)
    texts = {SCENARIO: files.read_text(most.folder / SCENARIO), **plugins}
    # Both the runs and the tables are written, which other commands lock singly.
    with sole_writer(out), sole_writer(out, TABLES):
        return _join_stores(store, others, texts, started, request)


def _join_stores(
    store: Store,
    others: Sequence[Store],
    texts: Mapping[str, str],
    started: datetime,
    request: Request,
) -> Swept:
    """Write the runs of the others into `store`, and judge the study where it is whole.

    `texts` are its scenario and plug-ins by file.
    """
    out = store.folder
    store.open(started.isoformat(timespec="seconds"), texts)
    session = SessionLog(out, request.argv, started, (), [other.folder for other in others])
    join(store, others)
    # It made no runs itself: they count for the sessions of the folders that are joined.
    session.end(0)
    if mixed := mixture(out):
        request.warn(mixed)
    tally = StudyTally.of(store.covered_draws())
    if tally.made < tally.wanted:
        return Swept(out, tally, missing_runs=tuple(gaps(store)))
    return answer_study(store, store.write_runs(), request)
