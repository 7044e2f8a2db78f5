"""Gain conditions in words: what `podusv validate -v` says of the proof."""

from pathlib import Path

import pytest

from podusv_cli.findings.proof import conditions
from podusv_cli.scenario.load import load

CONFIGS = Path(__file__).parent.parent / "configs/paper"


def said(name: str, *sets: str) -> list[str]:
    return list(conditions(load(CONFIGS / f"{name}.yaml", sets).scenario))


@pytest.mark.parametrize(("k_psie", "holds"), [(0.051, True), (0.049, False)])
def test_the_corrected_limit_of_k_psie_is_a_quarter_of_one_over_A(k_psie, holds):
    (line,) = said("corrected", f"controller.k_psie={k_psie}", "controller.A_r=5")
    assert ("all hold; lambda" in line) == holds
    assert (f"k_psie = {k_psie} fails: it must exceed 0.05" in line) != holds


def test_the_printed_sign_asks_for_more_than_the_printed_gains():
    (line,) = said("printed")
    assert "k_ze = 0.1 fails: it must exceed 0.336" in line  # 1/(4 A_u) + 1/(k_ue - 1/2)
    assert "as printed: all hold" in line


def test_every_law_with_a_lyapunov_function_has_its_line():
    assert [line.partition(",")[0] for line in said("corrected_compare")] == [
        "proposed", "dsc", "li",
    ]  # fmt: skip
