"""What the arguments of `podusv compare` name: runs with distinct labels, claims, a title."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from podusv_cli.comparison.claims import ParsedClaim
from podusv_cli.comparison.measured import FEWEST, Track
from podusv_cli.comparison.parsing import parse_claims
from podusv_cli.core import units
from podusv_cli.core.errors import UsageError
from podusv_cli.findings.finding import Case, unknown_codes
from podusv_cli.scenario.identify import Identify
from podusv_cli.scenario.limits import limits
from podusv_cli.scenario.load import Loaded
from podusv_cli.workflows.execute import examined
from podusv_cli.workflows.measured import is_log, track
from podusv_cli.workflows.members import Member, distinct, numbered
from podusv_cli.workflows.members import from_folder as members_of
from podusv_cli.workflows.request import Request
from podusv_cli.workflows.run import opened

START = "start"  # of a run, to which a log may be moved
DATED = (9.4e8, 4.2e9)  # s since 1970, of the years 2000 to 2100
FINER = {unit: float(factor) for unit, factor in units.UNITS["s"].items() if factor < 1}


@dataclass(frozen=True)
class Members:
    """The runs of one argument, or of all: a name, what their claims call them, and these claims.

    `names` are empty where the claims call them by their labels.
    """

    name: str
    members: Sequence[Member]
    names: Sequence[str] = ()
    claims: Sequence[ParsedClaim] = ()
    identify: Identify | None = None  # what columns of logs are called


def gather(items: Sequence[Path], request: Request) -> Members:
    """Open every argument. Raises UsageError, ScenarioError, StorageError."""
    if request.overrides and all(item.is_dir() or is_log(item) for item in items):
        given = ", ".join(request.overrides)
        raise UsageError(
            f"--set {given}: --set changes scenarios, and only finished runs are given"
        )
    logs = [item for item in items if is_log(item)]
    others = [item for item in items if item not in logs]
    groups = [_opened(item, request, alone=len(others) == 1) for item in others]
    return gathered([*groups, *measured(logs, groups, request.align)])


def measured(logs: Sequence[Path], groups: Sequence[Members], align: str = "") -> list[Members]:
    """A log among the arguments as the last of all runs. Raises UsageError."""
    if not logs:
        if align:
            raise UsageError(f"--align {align}: no log is given that could be moved; name one")
        return []
    if len(logs) > 1 or not groups:
        given = ", ".join(map(str, logs))
        raise UsageError(
            f"{given}: runs are compared with one log at a time; name one, and a scenario or a run "
            "beside it"
        )
    if align not in ("", START):
        raise UsageError(f"--align {align}: unknown; write --align {START}, or leave it out")
    members = [member for group in groups for member in group.members]
    speeds = [member.case.scenario.facts.U if member.case else math.inf for member in members]
    sections = [group.identify for group in groups if group.identify]
    log = track(logs[0], sections, max(speeds), at_start=align == START)
    beside = members[0].about
    _check_common(log, max(member.about.duration for member in members))
    name, text = logs[0].stem, repr(log.signals["x"].tolist())
    own = Member(name, log.about(beside), text, track=log, noticed=log.remarks)
    return [Members(name, [own])]


def _check_common(log: Track, duration: float) -> None:
    """Raises UsageError where too few instants are common with a run of this duration [s]."""
    count, first, last = int(log.common(0.0, duration).sum()), log.times[0], log.times[-1]
    if count >= FEWEST:
        return
    span = last - first
    finer = [unit for unit, f in FINER.items() if last * f <= duration < span and span * f > 1.0]
    dated = [unit for unit, f in FINER.items() if DATED[0] <= first * f <= DATED[1]]
    from_begin = "count the log's time from where the run begins"
    hint = (
        f'if its times are in {finer[0]}, write time: "COLUMN [{finer[0]}]" under '
        f'identify.columns, or "time [{finer[0]}]" as the name of the column'
        if finer
        else from_begin
    )
    if dated:
        hint = (
            f'its times seem to be in {dated[0]} since 1970: write time: "COLUMN [{dated[0]}]" '
            f"under identify.columns, and {from_begin}"
        )
    raise UsageError(
        f"{log.file}: its times go from {first:.10g} to {last:.10g} s, and the run from 0 to "
        f"{duration:g} s, with {count} common positions, where {FEWEST} are needed; {hint}"
    )


def gathered(groups: Sequence[Members]) -> Members:
    """All of several, each run with a label of its own, and with the claims about them."""
    members = distinct(member for group in groups for member in group.members)
    labels = iter(member.label for member in members)
    called = [dict(zip(group.names, labels, strict=False)) for group in groups]
    title = "-".join(dict.fromkeys(group.name for group in groups))[:80]
    return Members(title, members, claims=_labelled(groups, called))


def _opened(path: Path, request: Request, *, alone: bool) -> Members:
    if path.is_dir():
        return from_folder(path, request.plugins)
    fits = limits(request.allow_large, read_back=True)
    loaded = opened(path, request, (unknown_codes, fits))
    return from_scenario(loaded, alone=alone)


def from_folder(path: Path, files: Sequence[str] = ()) -> Members:
    """The finished runs of a folder; `files` are plug-ins. Raises UsageError, StorageError."""
    members = members_of(path, files)
    return Members(path.resolve().name, members, [member.label for member in members])


def from_scenario(loaded: Loaded, *, alone: bool) -> Members:
    """The runs of a scenario, and its claims; `alone` says that nothing else is compared."""
    scenario, singles = loaded.scenario, loaded.scenario.singles()
    labels = list(singles) if alone or scenario.controllers else [scenario.name]
    cases = [Case(single, loaded.plans[label]) for label, single in singles.items()]
    members = [
        Member(
            label, case.about, case.resolved_yaml, case.scenario.plugged,
            case=case, text=loaded.text, noticed=examined(case),
        )
        for label, case in zip(labels, cases, strict=True)
    ]  # fmt: skip
    claims = parse_claims(loaded)
    return Members(scenario.name, members, list(singles), claims, scenario.identify)


def _labelled(groups: Sequence[Members], called: Sequence[Mapping[str, str]]) -> list[ParsedClaim]:
    """All claims; names that several scenarios use are preceded by the scenario's name."""
    counts = Counter(claim.name for group in groups for claim in group.claims)
    claims = [
        replace(claim.with_labels(labels), name=f"{group.name}.{claim.name}")
        if counts[claim.name] > 1
        else claim.with_labels(labels)
        for group, labels in zip(groups, called, strict=True)
        for claim in group.claims
    ]
    names = numbered(claim.name for claim in claims)
    return [replace(claim, name=name) for claim, name in zip(claims, names, strict=True)]
