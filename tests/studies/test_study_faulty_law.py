"""A law that raises, hangs, never starts or ends its process in some draws: all is told."""

import numpy as np
import pytest
from html_tree import tree
from plugin_samples import LAW
from small_study import TEXT

from podusv_cli.engine.running import thread as march
from podusv_cli.studies.counting.runs import STATUSES
from podusv_cli.studies.making.sessions import sessions
from podusv_cli.workflows import sweep

START = """\
    def start(self, x, target, nominal):
        if x[0] == -2.0:
            os.kill(os.getpid(), signal.SIGKILL)
        if x[0] == -3.0:
            raise KeyError("no gain for this start")
        return np.zeros(1)
"""
HANGING = (
    "        if x[0] < -3.9:\n            while tau[0] > -1e300:\n                tau[0] += 1.0\n"
)
CAUSES = {
    -2.0: ("crashed", "it ended its process, each time that it was made"),
    -3.0: ("crashed", "KeyError: 'no gain for this start'"),
    -4.0: ("hung", "not over after 0.3 s of computing"),
}


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("faulty")
    law = LAW.replace("import numpy as np\n", "import os\nimport signal\n\nimport numpy as np\n")
    plain = law[law.index("    def start") : law.index("    @staticmethod")]
    (folder / "my_law.py").write_text(law.replace(plain, f"{START}\n") + HANGING)
    text = TEXT
    for place, new in (
        ("controllers:\n", "plugins: [my_law.py]\ncontrollers:\n  mine: {kind: cross_track}\n"),
        ("  vary:\n", "  vary:\n    start.x: {choice: [-2, -3, -4, 1, 2, 3, 4]}\n"),
    ):
        text = text.replace(place, new)
    (folder / "faulty.yaml").write_text(text)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(march, "PATIENCE", 0.3)
        request = sweep.Request(
            ("sweep.draws=7", "sweep.seed=14"), folder / "study", workers=1, figures=False
        )
        return sweep.run(folder / "faulty.yaml", request, lambda tally: None)


def test_every_fault_is_that_of_its_run(study):
    runs, place = study.results.runs, study.results.runs.laws.index("mine")
    starts, status = runs.drawn_quantities["start.x"], np.array(STATUSES)[runs.status("mine")[0]]
    assert set(CAUSES) <= set(starts.tolist())  # each happens
    for draw, x in enumerate(starts.tolist()):
        word, cause = CAUSES.get(x, ("finished", ""))
        assert status[draw] == word
        assert cause in runs.causes.get((place, 0, draw), "")
    for law in ("pid", "li"):
        assert set(runs.status(law)[0]) == {0}


def test_how_a_process_ended_is_told(study):
    runs, (session,) = study.results.runs, sessions(study.folder)
    ended = np.flatnonzero(runs.drawn_quantities["start.x"] == -2.0)
    assert set(session["ended"]) == {f"mine[0] draw {draw}" for draw in ended}
    (how,) = set(session["ended"].values())
    assert " -9, 2 " in how


def test_the_exit_code_of_a_report_says_so(podusv, study):
    assert podusv("sweep", "report", study.folder, "--no-figures", "--quiet").code == 3


def test_the_report_tells_them(study):
    page = tree((study.folder / "report.html").read_text())
    (failures,) = page.all("section", id="failures")
    for _, cause in CAUSES.values():
        assert cause in failures.text
    broken = int(study.results.runs.broken("mine").sum())
    assert f"{broken} runs crashed" in page.text
    assert study.results.broken_runs == broken
