"""Rooms of podusv_cli that need little of each other: each such arrow is meant, with a reason."""

from __future__ import annotations

from pathlib import Path

from command_samples import ROOT
from room_arrows import room_arrows

FEW = 2  # names; an arrow with so few is thin, and may be a thing that lies in the wrong room
# Why a room needs one or two names of another one.
MEANT = {
    "cli -> export": "--check steps a law that lies in a folder; no scenario has part in it",
    "cli -> figures": "names of figures are listed, explained and completed",
    "cli -> findings": "codes of findings are listed, explained and completed",
    "cli -> metrics": "names of metrics are listed, explained and completed",
    "cli -> theory": "the table of margins shows the margins of theory as they are",
    "comparison -> process": "what of a comparison cannot be made is missing, and said so",
    "doubt -> expressions": "claims in a world have the verdicts and numbers of all claims",
    "doubt -> storage": "its folder appears whole, with tables that no spreadsheet executes",
    "export -> scenario": "a law is exported as a scenario has it",
    "interface -> doubt": "the same checks and the same table as those of the command",
    "interface -> findings": "codes in `silence` are checked where Python loads a scenario, too",
    "interface -> metrics": "a notebook shows metrics with their units",
    "interface -> verification": "verification in Python writes nothing, and so has no pipeline",
    "optimum -> components": "collocation has the right-hand side of the vessel itself",
    "optimum -> engine": "a problem is that of a closed loop, and begins in its state",
    "optimum -> process": "IPOPT is ended by Ctrl-C",
    "optimum -> scenario": "a problem is that of a scenario",
    "pages -> core": "text is escaped and units are raised as everywhere",
    "studies -> components": "gains are fields of a law",
    "studies -> metrics": "objectives and laws of a study are held against the metrics' kinds",
    "verification -> core": "how a run ended, and its last position",
    "verification -> engine": "a run is repeated with smaller steps, in the loop's own march",
    "verification -> scenario": "steps are halved of the runs of a scenario",
}


def test_every_thin_arrow_between_rooms_is_meant() -> None:
    arrows = room_arrows(ROOT / "podusv_cli")
    thin = {arrow: sorted(names) for arrow, names in arrows.items() if len(names) <= FEW}
    new = [f"{arrow} carries {', '.join(thin[arrow])}" for arrow in thin.keys() - MEANT.keys()]
    assert not new, (
        f"{'; '.join(new)}: a thing for one other room may lie in the wrong one; move it, or give "
        "the reason in MEANT"
    )
    gone = sorted(MEANT.keys() - thin.keys())
    assert not gone, f"{', '.join(gone)}: no thin arrow any more; remove it from MEANT"


def test_names_are_counted_as_they_are_used(tmp_path: Path) -> None:
    """Of a module those that are used, of `__init__` its own, and each once."""
    files = {
        "a/__init__.py": "",
        "a/one.py": "from p.b import two\nfrom p.b.two import g\ndef f(): return two.f(two.f)",
        "a/other.py": "import p\nfrom p import VERSION\nfrom p.b import LIMIT\nfrom p.a import one",
        "b/__init__.py": "LIMIT = 1",
        "b/two.py": "import math\ndef g(): ...\ndef f(x): from p.c.three import Three as T",
        "c/three.py": "class Three: ...",
        "docs/page.py": "from p.a.one import f",
        "top.py": "from p.a.one import f",
    }
    for name, text in files.items():
        (tmp_path / "p" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "p" / name).write_text(text)
    assert room_arrows(tmp_path / "p") == {
        "a -> b": {"b.two.f", "b.two.g", "b.LIMIT"},
        "b -> c": {"c.three.Three"},
    }
