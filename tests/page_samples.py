"""A comparison's page with what tests plant in it."""

from comparison_samples import FRAME, about, verdicts

from podusv_cli.comparison import report
from podusv_cli.core.finding import Finding
from podusv_cli.pages.page import Picture

ERRORS = Picture("errors", "x_e & y_e, over <time>", b"<svg/>", "the paper's figure 4")


def page(**parts):
    story = {
        "title": "planted",
        "abouts": {"a": about()},
        "endings": {"a": "", "lost": "killed <9>"},
        "differences": {"start.x": {"a": 1.0, "lost": [1.0, 2.5]}},
        "table": FRAME,
        "noticed": [Finding("crosswise", "controller", "|x| < 1", ("<a>",))],
        "verdicts": verdicts(),
        "theories": {},
        "figures": [ERRORS],
        "provenance": {"git": {"commit": "abc"}},
    }
    return report.page(report.Story(**story | parts))


def theory(bound, holds):
    """A run's theory.json, as far as the report reads it."""
    forms = {name: {"lambda": 0.05, "bound": bound} for name in ("corrected", "printed")}
    return {
        "conditions": [{"name": "k_ze", "value": 0.1, "limit": 0.05, "holds": holds}],
        "assumptions": [{"assumption": "gives what is asked", "holds": holds, "found": 3.0}],
        "windows": {"settled": {**forms, "largest_V": 0.25}},
    }
