"""What docs/logs.md shows is run: Python always, Octave where it is installed.

MATLAB's part is not run; `test_storage_hdf5.py` holds the facts about the file that it relies on.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from command_samples import Command
from test_readme import dialogues, podusv, text_of  # noqa: F401  the fixture of docs pages

PAGE = "docs/logs.md"
OCTAVE = shutil.which("octave-cli")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", text_of(PAGE), re.DOTALL)


def make_runs(podusv: Command) -> None:  # noqa: F811
    for words, code, _ in dialogues(PAGE):
        assert podusv(*words, "--no-figures").code == code


def test_the_python_blocks_run(podusv: Command) -> None:  # noqa: F811
    make_runs(podusv)
    known: dict[str, object] = {}
    for block in blocks("python"):
        exec(block, known)  # noqa: S102
    assert len(blocks("python")) == 2
    assert float(known["x"][-1]) == known["run"]["x"][-1]  # type: ignore[index]
    header = Path("both/comparison.csv").read_text().splitlines()[0]
    assert header.startswith("metric,unit,first,other,")


@pytest.mark.slow
@pytest.mark.skipif(OCTAVE is None, reason="needs Octave")
def test_octave_reads_the_same_numbers(podusv: Command) -> None:  # noqa: F811
    import podusv_cli

    make_runs(podusv)
    (block,) = blocks("octave")
    hidden = 'set(0, "defaultfigurevisible", "off");\n' + re.sub(r"^plot.*$", "", block, flags=re.M)
    done = subprocess.run(
        [str(OCTAVE), "--quiet", "--eval", hidden], capture_output=True, text=True
    )
    run = podusv_cli.open_run("first")
    assert done.stdout == f"{run['x'][-1]:.6f} {run.metrics['iae']:.6f}\n", done.stderr
