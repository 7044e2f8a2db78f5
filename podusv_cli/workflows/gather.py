"""What the arguments of `podusv compare` name: runs with distinct labels, claims, a title."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from podusv_cli.comparison.claims import ParsedClaim
from podusv_cli.comparison.measured import FEWEST, PLACE, START, Track
from podusv_cli.comparison.parsing import parse_claims
from podusv_cli.core.earth import Plane
from podusv_cli.core.errors import UsageError
from podusv_cli.core.kernel import Vector
from podusv_cli.findings.finding import unknown_codes
from podusv_cli.scenario.about import identify_of, plane_of
from podusv_cli.scenario.identify import Identify
from podusv_cli.scenario.limits import limits
from podusv_cli.scenario.load import Loaded
from podusv_cli.workflows.execute import examine
from podusv_cli.workflows.measured import is_log, track
from podusv_cli.workflows.members import Member, distinct, number_names
from podusv_cli.workflows.members import from_folder as members_of
from podusv_cli.workflows.request import Request
from podusv_cli.workflows.run import open_scenario

DATED = (9.4e8, 4.2e9)  # s since 1970, of the years 2000 to 2100
BEGIN = 0.0  # s, the first instant of every run


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
    """Open every argument: scenarios, run folders, comparisons and at most one log.

    Raises UsageError, ScenarioError, StorageError.
    """
    if request.overrides and all(item.is_dir() or is_log(item) for item in items):
        given = ", ".join(request.overrides)
        raise UsageError(
            f"--set {given}: --set changes scenarios, and only finished runs are given"
        )
    logs = [item for item in items if is_log(item)]
    others = [item for item in items if item not in logs]
    groups = [_open_members(item, request, alone=len(others) == 1) for item in others]
    return join_members([*groups, *gather_logs(logs, groups, request.align)])


def gather_logs(logs: Sequence[Path], groups: Sequence[Members], align: str = "") -> list[Members]:
    """The log among the arguments, as the last of all runs; none without `logs`.

    `groups` are the other arguments, opened; `align` says how it is moved. Raises UsageError.
    """
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
    if align not in ("", START, PLACE):
        raise UsageError(
            f"--align {align}: unknown; write --align {START} for clock and place, --align {PLACE} "
            "for the place alone, or leave it out"
        )
    members = [member for group in groups for member in group.members]
    # A finished run does not say how fast its boat may go.
    speeds = [member.case.scenario.facts.U if member.case else math.inf for member in members]
    sections = [group.identify for group in groups if group.identify]
    plane = _common_plane(members)
    log = track(logs[0], sections, max(speeds), plane=plane, aligned=align).start_clock_at(BEGIN)
    beside = members[0].about
    _check_common(log, max(member.about.duration for member in members))
    name, text = logs[0].stem, repr(log.signals["x"].tolist())
    own = Member(name, log.about(beside), text, track=log, noticed=log.remarks)
    return [Members(name, [own])]


def _common_plane(members: Sequence[Member]) -> Plane | None:
    """The plane of the runs on earth; None where none has an origin.

    Raises UsageError where origins differ, or only some runs have one.
    """
    planes = {plane: member.label for member in members if (plane := plane_of(member.about))}
    if len(planes) > 1:
        places = "; ".join(f"{label}: {p.lat:g}, {p.lon:g} deg" for p, label in planes.items())
        raise UsageError(
            f"the runs have origins that differ ({places}), so a log lies beside one of them only; "
            "give all the same `origin`"
        )
    unplaced = [member.label for member in members if not plane_of(member.about)]
    if planes and unplaced:
        raise UsageError(
            f"{', '.join(unplaced)}: no `origin`, which other runs have; give all the same `origin`"
        )
    return next(iter(planes), None)


def _check_common(log: Track, duration: float) -> None:
    """Raise UsageError where fewer than FEWEST instants lie within a run of this duration [s]."""
    count, first, last = int(log.common(BEGIN, duration).sum()), log.times[0], log.times[-1]
    if count >= FEWEST:
        return
    hint = _about_unit(log.times - log.shifted, duration) or _about_clock(log, duration)
    raise UsageError(
        f"{log.file}: its times go from {first:.10g} to {last:.10g} s, and the run from 0 to "
        f"{duration:g} s, with {count} common position{'' if count == 1 else 's'}, where {FEWEST} "
        f"are needed; {hint}"
    )


def _about_unit(times: Vector, duration: float) -> str:
    """What to write where the numbers of a clock, `times` (n,), are not in seconds; else "".

    Signs are dates, a span that would fit the run in another unit, and the distance of rows.
    `duration` [s] is that of the run.
    """
    from podusv_cli.identify.logs.checks import FINER, SLOWEST  # h5py is slow to import

    span, step = float(times[-1] - times[0]), float(np.median(np.diff(times)))
    dated = [unit for unit, f in FINER.items() if DATED[0] <= times[0] * f <= DATED[1]]
    # More than a second, so that a unit is not guessed for a log that is too short in any.
    finer = [
        unit
        for unit, f in FINER.items()
        if span * f > 1.0 and (span * f <= duration < span or step * f < SLOWEST <= step)
    ]
    if not (dated or finer):
        return ""
    unit = (dated or finer)[0]
    since = " since 1970" if dated else ""
    asked = f"its times seem to be in {unit}{since}:" if dated else f"if its times are in {unit},"
    late = times[0] * FINER[unit] > duration
    other_clock = f", and --align {START} if that clock is not the run's" if late else ""
    return (
        f'{asked} write time: "COLUMN [{unit}]" under identify.columns, or "time [{unit}]" as the '
        f"name of the column{other_clock}"
    )


def _about_clock(log: Track, duration: float) -> str:
    """What to do where a log in seconds has too few instants within a run of this duration [s]."""
    if (
        not log.aligned
        and replace(log, aligned=START).start_clock_at(BEGIN).common(BEGIN, duration).sum()
        >= FEWEST
    ):
        return (
            f"if its clock is another one, --align {START} takes its first position for the first "
            "instant of the run"
        )
    return "take a run that lasts longer, or a log with more positions"


def join_members(groups: Sequence[Members]) -> Members:
    """All runs and claims of several groups, each run with a label of its own."""
    members = distinct(member for group in groups for member in group.members)
    labels = iter(member.label for member in members)
    # For each group: its claims' names for runs, and the labels these have now.
    # The names come first: `zip` then ends without taking a label of the next group.
    called = [dict(zip(group.names, labels, strict=False)) for group in groups]
    # Cut, as a folder is named after it.
    title = "-".join(dict.fromkeys(group.name for group in groups))[:80]
    return Members(title, members, claims=_label_claims(groups, called))


def _open_members(path: Path, request: Request, *, alone: bool) -> Members:
    """The members of a comparison in a folder or scenario; `alone` if nothing else is given."""
    if path.is_dir():
        return from_folder(path, request.plugins)
    fits = limits(request.allow_large, read_back=True)
    loaded = open_scenario(path, request, (unknown_codes, fits))
    return from_scenario(loaded, alone=alone)


def from_folder(path: Path, files: Sequence[str] = ()) -> Members:
    """The finished runs of a folder; `files` are plug-ins. Raises UsageError, StorageError."""
    members = members_of(path, files)
    called = filter(None, (identify_of(member.about) for member in members))
    labels = [member.label for member in members]
    return Members(path.resolve().name, members, labels, identify=next(called, None))


def from_scenario(loaded: Loaded, *, alone: bool) -> Members:
    """The runs of a scenario, and its claims; `alone` says that nothing else is compared."""
    scenario, singles = loaded.scenario, loaded.scenario.singles()
    # Beside others, a scenario with one law is called by its own name, not its law's.
    labels = list(singles) if alone or scenario.controllers else [scenario.name]
    members = [
        Member(
            label,
            case.about,
            case.resolved_yaml,
            case.scenario.plugged,
            case=case,
            text=loaded.text,
            noticed=examine(case),
        )
        for label, case in zip(labels, loaded.cases.values(), strict=True)
    ]
    claims = parse_claims(loaded)
    return Members(scenario.name, members, list(singles), claims, scenario.identify)


def _label_claims(
    groups: Sequence[Members], called: Sequence[Mapping[str, str]]
) -> list[ParsedClaim]:
    """All claims with the runs' labels; `called` maps a group's names for runs to labels.

    A claim whose name several scenarios use has the scenario's name in front.
    """
    counts = Counter(claim.name for group in groups for claim in group.claims)
    claims = [
        replace(claim.with_labels(labels), name=f"{group.name}.{claim.name}")
        if counts[claim.name] > 1
        else claim.with_labels(labels)
        for group, labels in zip(groups, called, strict=True)
        for claim in group.claims
    ]
    names = number_names(claim.name for claim in claims)
    return [replace(claim, name=name) for claim, name in zip(claims, names, strict=True)]
