"""The committed results of the paper, made anew: no number may move unnoticed."""

import json
from pathlib import Path

import pandas as pd
import pytest

from podusv_cli import workflows

ROOT = Path(__file__).parent.parent
NAMES = ("printed_compare", "figures_compare", "figures_compare_standoff", "corrected_compare")
TIMED = ["law_ns", "law_ns_low", "law_ns_high"]
# Sits on the singularity and chatters; the last bit of the start decides its settled numbers.
CHAOTIC = {"figures_compare": "dsc"}


@pytest.fixture(scope="module", params=NAMES)
def made(request, tmp_path_factory):
    target = tmp_path_factory.mktemp("reproduced") / request.param
    config = ROOT / f"configs/paper/{request.param}.yaml"
    done = workflows.compare([config], workflows.Request(out=target, figures=False))
    return request.param, done.folder


def test_the_committed_table_is_what_comes_out(made):
    name, folder = made
    committed, new = (
        pd.read_csv(where / "comparison.csv", index_col=0).drop(index=TIMED, errors="ignore")
        for where in (ROOT / "results/paper" / name, folder)
    )
    loose = [column for column in new if CHAOTIC.get(name, "-") in column]
    # Machines differ in the last bit of exp and sin; the laws are not chaotic beyond that.
    pd.testing.assert_frame_equal(new.drop(columns=loose), committed.drop(columns=loose), rtol=1e-6)


def test_the_committed_verdicts_are_what_comes_out(made):
    name, folder = made
    committed, new = (
        {
            c["claim"]: c["verdict"]
            for c in json.loads((where / "claims.json").read_text())["claims"]
        }
        for where in (ROOT / "results/paper" / name, folder)
    )
    del committed["C14"], new["C14"]  # a time, measured here and now
    assert new == committed
