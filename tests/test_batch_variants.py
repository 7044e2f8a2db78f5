"""Many runs that differ in some numbers, as docs/performance.md shows them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from conftest import NONLINEAR, corrected

from benchmarks.variants import variants
from podusv_cli.components.controllers.adaptive_neural import AdaptiveNeural
from podusv_cli.components.controllers.network import Network

ROOT = Path(__file__).resolve().parent.parent


def test_the_documented_monte_carlo_runs(capsys: pytest.CaptureFixture[str]) -> None:
    text = (ROOT / "docs" / "performance.md").read_text()
    (code,) = re.findall(r"```python\n(.*?simulate_many.*?)```", text, re.DOTALL)
    few = code.replace("(1000, 6)", "(4, 6)").replace('"configs/', f'"{ROOT}/configs/')
    assert few.count("(4, 6)") == few.count(f"{ROOT}/configs/paper") == 1
    exec(few, {})  # noqa: S102
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "4 of 4 finished"
    low, middle, high = map(float, lines[1].removeprefix("iae [").rstrip("]").split())
    assert 375 < low < middle < high < 395  # as the text says of a thousand


def test_variants_change_what_they_name_and_nothing_else() -> None:
    loop = corrected()
    (one, two) = variants(loop, {"controller.network.spread": [0.5, 0.9], "start.psi": [1, 2]})
    assert isinstance(two.controller, AdaptiveNeural)
    assert two.controller.network == Network(spread=0.9)
    assert two.start == (-10.0, -10.0, 2.0, 0.0, 0.0, 0.0)
    back = variants(one, {"controller.network.spread": [0.7], "start.psi": [0.0]})
    assert back == [loop]
    heavy = variants(loop, {"vessel.m": [30.0]})[0]
    assert (heavy.vessel.m, heavy.nominal) == (30.0, NONLINEAR)


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"controller.k_zee": [1.0]}, "controller.k_zee: no number of this closed loop"),
        ({"controller.network": [1.0]}, "controller.network: no number"),
        ({"controller.k_ze.x": [1.0]}, r"controller.k_ze.x: no number"),
        ({"rudder.k": [1.0]}, "rudder.k: no number"),
        ({"start.z": [1.0]}, "start.z: no number"),
        ({"vessel": [1.0]}, "vessel: no number"),
        ({"controller.k_ze": [-1.0]}, "greater than or equal to 0"),
        ({"vessel.m": [20.0], "start.x": [1.0, 2.0]}, "one number a run"),
        ({}, "one number a run"),
    ],
)
def test_variants_that_cannot_be_are_refused(parameters: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        variants(corrected(), parameters)
