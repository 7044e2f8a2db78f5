"""`podusv verify`: what it shows and writes, what it replaces, how it ends."""

import json
from pathlib import Path
from typing import Any

import pytest
from findings_samples import CONFIGS

from podusv_cli.scenario.load import load
from podusv_cli.scenario.model import Scenario
from podusv_cli.verification.verify import verify
from podusv_cli.workflows import verify as verifying

TWO = f"""
extends: {CONFIGS / "corrected.yaml"}
path: {{kind: line}}
actuator: {{kind: ideal}}
start: {{x: -8, y: -4, psi: 0.1, u: 0.4, v: 0.05, r: 0.02}}
simulation: {{step: 0.0025, duration: 2}}
controllers: {{quick: {{k_ze: 0.15}}, slow: {{k_ze: 0.05}}}}
"""


def two() -> Scenario:
    Path("two.yaml").write_text(TWO)
    return load("two.yaml").scenario


@pytest.mark.slow
def test_the_command_shows_tables_and_rankings_and_leaves_nothing(podusv):
    two()
    before = sorted(Path().iterdir())
    said = podusv("verify", "two.yaml")
    assert said.code == 0, said.out
    assert said.err == ""
    lines = said.out.splitlines()
    assert lines[0] == "quick:"
    assert lines[1].split() == [
        *("number", "unit", "0.0025", "s", "0.00125", "s", "0.000625", "s"),
        *("order", "rel.", "error", "verdict"),
    ]  # fmt: skip
    assert "slow:" in lines
    assert "quick, slow; the same at all steps" in said.out
    assert lines[-1] == "converged within 0.01 relative"
    assert sorted(Path().iterdir()) == before


@pytest.mark.slow
def test_only_an_earlier_verification_is_replaced_without_force(podusv, monkeypatch):
    scenario = Path("two.yaml")
    two()
    before = scenario.read_text()
    for place, content in (("two.yaml", before), ("v.json", '{"format": 1}'), ("v.json", "[]")):
        Path(place).write_text(content)
        with monkeypatch.context() as patch:
            patch.setattr(verifying, "verification", None)  # nothing is computed
            said = podusv("verify", "two.yaml", "-q", "--out", place)
        assert (said.code, said.out) == (5, "")
        assert said.err == (
            f"{place} exists and is not a result of podusv verify; --force replaces it, or name "
            "another file\n"
        )
        assert Path(place).read_text() == content
    said = podusv("verify", "two.yaml", "--json", "--out", "v.json", "--force")
    got = json.loads(said.out)
    assert (said.code, json.loads(Path("v.json").read_text())) == (0, got)
    assert (got["converged"], got["steps"]) == (True, [0.0025, 0.00125, 0.000625])
    assert got["rankings"]["iae"]["orders"] == [["quick", "slow"]] * 3
    assert got["runs"]["slow"]["numbers"]["iae"]["converged"] is True
    Path("v.json").write_text(Path("v.json").read_text().replace("0.01", "0.5"))
    for start in ('"tolerance": 0.5', ""):
        assert start in Path("v.json").read_text()
        assert podusv("verify", "two.yaml", "-q", "--out", "v.json").code == 0
        assert json.loads(Path("v.json").read_text())["tolerance"] == 0.01
        Path("v.json").write_text("")


def test_a_file_that_comes_while_it_computes_is_spared_and_the_numbers_are_printed(
    podusv, monkeypatch
):
    def meanwhile(*given: Any) -> Any:
        Path("v.json").write_text("mine")
        return verify(*given)

    two()
    monkeypatch.setattr(verifying.verification, "verify", meanwhile)
    said = podusv("verify", "two.yaml", "--out", "v.json")
    assert said.code == 5
    assert said.out.endswith("converged within 0.01 relative\n")
    assert Path("v.json").read_text() == "mine"


@pytest.mark.slow
def test_what_is_not_converged_ends_with_3_and_is_named(podusv):
    two()
    coarse = podusv("verify", "two.yaml", "--set", "simulation={step: 0.1, duration: 4}")
    assert coarse.code == 3
    assert "diverged at t = " in coarse.out
    end = coarse.out[coarse.out.index("\nnot converged within 0.01 relative\n") :]
    assert "\nquick: status\n" in end
    strict = podusv("verify", "two.yaml", "--tolerance", "1e-9")
    assert strict.code == 3
    assert verify(two(), 1e-9).unconverged.keys() == {"quick", "slow"}
