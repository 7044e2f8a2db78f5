"""Write what claims said and when they changed: results/claims_log.csv, results/claims_log.md.

    python examples/reproduce/claims_history.py [--judge]

The texts come from this repository's history, the reasons from the CSV file: a change without a
reason is written with an empty cell, to be filled in by hand. With --judge, every text of a claim
that has several is judged on today's runs.
"""

from __future__ import annotations

import csv
import datetime
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby, pairwise
from pathlib import Path
from typing import Any, NamedTuple

import yaml

ROOT = Path(__file__).parents[2]
LOG = ROOT / "results/claims_log.csv"
FOLDERS = ("configs", "podusv_cli/configs")
# A name that changed changes no claim: file, then labels of laws.
MOVED = {r"^(podusv_cli/)?configs/": "", r"^paper/": "mu_2017/"}
RENAMED = {r"\bproposed\b": "adaptive_neural", r"\bli\b": "full_backstepping"}
JUDGED_IN = {
    "mu_2017/claims.yaml": "mu_2017/corrected_compare.yaml",
    "mu_2017/ablation_laws.yaml": "mu_2017/ablation.yaml",
}
HEAD = """\
# Claims and when they changed

A claim that is put as an expression after its runs exist can be bent towards them. \
{changed} of the {claims} claims that the scenarios state have had another text. Of {known} \
changes whose texts could both be judged, {turns} turn the verdict on today's runs.

A claim that was put after its runs existed describes what was seen. Only a run that was not \
seen tests it: other [values](../docs/doubt.md#what-our-verdicts-depend-on), \
[draws](../docs/studies.md#what-the-committed-studies-found).

Every text of every claim, with date, verdict on today's runs and reason: \
[claims_log.csv](claims_log.csv). `examples/reproduce/claims_history.py` makes it from this \
repository's history. Reasons are written by hand, and a test refuses a change without one. \
These changes turn the verdict:

| claim | since | verdict of the old text | of the new one | reason |
|---|---|---|---|---|
"""


class Text(NamedTuple):
    """What decides on a claim, and since when: a row of the log; an empty `expect`: taken out."""

    date: str
    config: str
    claim: str
    expect: str
    given: str = ""
    tolerance: str = ""
    testable: str = "yes"
    verdict: str = ""
    reason: str = ""

    @property
    def key(self) -> tuple[str, str]:
        """Which claim it is of."""
        return self.config, self.claim

    @property
    def decides(self) -> tuple[str, ...]:
        """What a verdict depends on."""
        return self.expect, self.given, self.tolerance, self.testable


def _with(names: dict[str, str], text: str) -> str:
    for old, new in names.items():
        text = re.sub(old, new, text)
    return " ".join(text.split())


def stated(config: str, text: str, date: str = "") -> dict[str, Text]:
    """The claims that the YAML text of a scenario states itself, by name."""
    scenario = yaml.safe_load(text)
    sections = (scenario, scenario.get("sweep")) if isinstance(scenario, dict) else ()
    claims: dict[str, Any] = {}
    for section in sections:
        if not isinstance(section, dict):
            continue
        stated_here = section.get("claims") or {}
        # The first form was a list.
        as_list = isinstance(stated_here, list)
        claims |= {each["id"]: each for each in stated_here} if as_list else stated_here
    return {
        name: Text(
            date,
            config,
            name,
            _with(RENAMED, claim["expect"]),
            _with(RENAMED, claim.get("given", "")),
            str(claim.get("tolerance", "")),
            "no" if claim.get("untestable") else "yes",
        )
        for name, claim in claims.items()
        if "expect" in (claim or ())
    }


def _git(*words: str) -> str:
    return subprocess.run(
        ["git", "-C", ROOT, *words], capture_output=True, text=True, check=True
    ).stdout


def history() -> Iterator[Text]:
    """Every text of every claim in the order of the commits that brought them, then of today."""
    now: dict[str, dict[str, Text]] = {}
    commits = _git("log", "--reverse", "--format=%h %as", "--", *FOLDERS).splitlines()
    for commit, date in map(str.split, commits):
        changed = _git("show", "--name-only", "--no-renames", "--format=", commit, "--", *FOLDERS)
        there = set(_git("ls-tree", "-r", "--name-only", commit, "--", *FOLDERS).splitlines())
        files = [file for file in changed.splitlines() if file.endswith(".yaml")]
        # A file that was moved is taken out under one name and put in under another.
        moved = {_with(MOVED, file): file for file in sorted(files, key=there.__contains__)}
        for config, file in moved.items():
            text = _git("show", f"{commit}:{file}") if file in there else ""
            was, now[config] = now.get(config, {}), stated(config, text, date)
            yield from _differences(was, now[config], date)
    for path in sorted((ROOT / "configs").rglob("*.yaml")):  # what is not committed yet
        config = path.relative_to(ROOT / "configs").as_posix()
        today = stated(config, path.read_text(), datetime.date.today().isoformat())
        yield from _differences(now.get(config, {}), today, datetime.date.today().isoformat())


def _differences(was: dict[str, Text], now: dict[str, Text], date: str) -> Iterator[Text]:
    for name in {**was, **now}:
        if name not in now:
            yield Text(date, was[name].config, name, "")
        elif name not in was or was[name].decides != now[name].decides:
            yield now[name]


def written() -> tuple[Text, ...]:
    """The log as it is."""
    with LOG.open(newline="") as file:
        return tuple(Text(**row) for row in csv.DictReader(file))


def judged(texts: Iterable[Text]) -> dict[Text, str]:
    """The verdict of each text on today's runs of its scenario; nothing where it has none."""
    import podusv

    verdicts: dict[Text, str] = {}
    for config, of_config in groupby(sorted(texts), key=lambda text: text.config):
        named = {f"{text.claim}_{n}": text for n, text in enumerate(of_config)}
        scenario = podusv.load(ROOT / "configs" / JUDGED_IN.get(config, config))
        claims = {name: _claim(text) for name, text in named.items()}
        with tempfile.TemporaryDirectory() as out:
            compared = podusv.compare(
                scenario, {"claims": claims}, out=f"{out}/judged", figures=False
            )
        verdicts |= {
            text: str(compared.claims.loc[name, "verdict"]) for name, text in named.items()
        }
    return verdicts


def _claim(text: Text) -> dict[str, Any]:
    tolerance = {"tolerance": float(text.tolerance)} if text.tolerance else {}
    untestable = {"untestable": "as the scenario says"} if text.testable == "no" else {}
    return {
        "says": text.claim,
        "expect": text.expect,
        "given": text.given,
        **tolerance,
        **untestable,
    }


def of_several(texts: Sequence[Text]) -> list[list[Text]]:
    """The claims that had more than one text."""
    by_claim: dict[tuple[str, str], list[Text]] = {}
    for text in texts:
        by_claim.setdefault(text.key, []).append(text)
    return [of_claim for of_claim in by_claim.values() if len(of_claim) > 1]


def page(texts: Sequence[Text]) -> str:
    """results/claims_log.md: how many texts changed, and the changes that turn a verdict."""
    changed = of_several(texts)
    pairs = [pair for of_claim in changed for pair in pairwise(of_claim)]
    known = [(old, new) for old, new in pairs if old.verdict and new.verdict]
    turns = [(old, new) for old, new in known if old.verdict != new.verdict]
    claims = len({text.key for text in texts})
    head = HEAD.format(changed=len(changed), claims=claims, turns=len(turns), known=len(known))
    reasons = ["", *(new.reason for _, new in turns)]
    return head + "".join(_row(*pair, before) for pair, before in zip(turns, reasons, strict=False))


def _row(old: Text, new: Text, before: str) -> str:
    """A change of a text; a reason that the row before gives is not repeated."""
    claim = f"{new.claim} of {new.config}"
    reason = "the same" if new.reason == before else new.reason
    return f"| {claim} | {new.date} | {old.verdict} | {new.verdict} | {reason} |\n"


def main(*words: str) -> None:
    """Write both files."""
    before = {(*text.key, text.date, *text.decides): text for text in written()}
    texts = []
    for text in history():
        was = before.get((*text.key, text.date, *text.decides), text)
        texts.append(text._replace(verdict=was.verdict, reason=was.reason))
    if "--judge" in words:
        several = [t for of_claim in of_several(texts) for t in of_claim if t.expect]
        verdicts = judged(t for t in several if not t.config.startswith("studies/"))
        texts = [text._replace(verdict=verdicts.get(text, "")) for text in texts]
    with LOG.open("w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(Text._fields)
        table.writerows(texts)
    LOG.with_suffix(".md").write_text(page(texts))


if __name__ == "__main__":
    main(*sys.argv[1:])
