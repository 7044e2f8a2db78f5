"""The notebooks in examples/: sound files without outputs, and their cells run."""

import json
from pathlib import Path
from typing import Any

import pytest
from command_samples import ROOT

NOTEBOOKS = sorted((ROOT / "examples").glob("*.ipynb"))
every = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
MOST_RUNS = 4


def cells(path: Path) -> list[dict[str, Any]]:
    """The cells of a notebook."""
    return json.loads(path.read_text())["cells"]


def test_there_are_notebooks():
    assert {path.stem for path in NOTEBOOKS} == {"first_run", "monte_carlo", "own_law"}


@every
def test_a_notebook_has_no_outputs(path):
    assert json.loads(path.read_text())["nbformat"] == 4
    code = [cell for cell in cells(path) if cell["cell_type"] == "code"]
    assert code
    assert not any(cell["outputs"] or cell["execution_count"] for cell in code)


@pytest.mark.slow  # simulates all that the notebooks show
@every
def test_the_cells_of_a_notebook_run(path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code = ["".join(cell["source"]) for cell in cells(path) if cell["cell_type"] == "code"]
    text = "\n".join(code).replace("RUNS = 200", f"RUNS = {MOST_RUNS}")
    names: dict[str, Any] = {}
    exec(compile(text, str(path), "exec"), names)  # noqa: S102
    if "run" in names:
        assert names["run"].status == "finished"
        assert "<img " in names["run"]._repr_html_()
    if "many" in names:
        assert list(names["many"]["status"]) == ["finished"] * MOST_RUNS
