"""What the arguments of `podusv compare` name: runs with distinct labels, claims, a title."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from podusv_cli.comparison.claims import Stated, misfits
from podusv_cli.core.errors import UsageError
from podusv_cli.findings.finding import heard, unknown_codes
from podusv_cli.findings.preflight import preflight
from podusv_cli.scenario.limits import limits
from podusv_cli.scenario.load import load
from podusv_cli.scenario.model import Claim
from podusv_cli.workflows.members import Member, comparable, distinct, numbered
from podusv_cli.workflows.run import Request


@dataclass(frozen=True)
class Gathered:
    """The runs to compare, the claims about them, and a title for the comparison."""

    members: Sequence[Member]
    stated: Sequence[Stated]
    title: str


@dataclass(frozen=True)
class _Item:
    """One argument: its runs, what its own claims call them, and these claims."""

    name: str
    members: Sequence[Member]
    names: Sequence[str] = ()
    claims: Mapping[str, Claim] = field(default_factory=dict)


def gather(items: Sequence[Path], request: Request) -> Gathered:
    """Open every argument. Raises UsageError, ScenarioError, StorageError."""
    if request.overrides and all(item.is_dir() for item in items):
        given = ", ".join(request.overrides)
        raise UsageError(
            f"--set {given}: --set changes scenarios, and only finished runs are given"
        )
    found = [_opened(item, request, alone=len(items) == 1) for item in items]
    members = distinct(member for item in found for member in item.members)
    labels = iter(member.label for member in members)
    called = [dict(zip(item.names, labels, strict=False)) for item in found]
    title = "-".join(dict.fromkeys(item.name for item in found))[:80]
    return Gathered(members, _stated(found, called), title)


def _opened(path: Path, request: Request, *, alone: bool) -> _Item:
    if path.is_dir():
        members = comparable(path)
        return _Item(path.resolve().name, members, [member.label for member in members])
    fits = limits(request.allow_large, read_back=True)
    loaded = load(path, request.overrides, checks=(unknown_codes, misfits, fits))
    scenario, singles = loaded.scenario, loaded.scenario.singles()
    labels = list(singles) if alone or scenario.controllers else [scenario.name]
    members = [
        Member(label, single, loaded.text, noticed=heard(preflight(single), single))
        for label, single in zip(labels, singles.values(), strict=True)
    ]
    return _Item(scenario.name, members, list(singles), scenario.claims)


def _stated(found: Sequence[_Item], called: Sequence[Mapping[str, str]]) -> list[Stated]:
    """All claims; names that several scenarios use are preceded by the scenario's name."""
    counts = Counter(name for item in found for name in item.claims)
    stated = [
        Stated(f"{item.name}.{name}" if counts[name] > 1 else name, claim, labels)
        for item, labels in zip(found, called, strict=True)
        for name, claim in item.claims.items()
    ]
    names = numbered(claim.name for claim in stated)
    return [replace(claim, name=name) for claim, name in zip(stated, names, strict=True)]
