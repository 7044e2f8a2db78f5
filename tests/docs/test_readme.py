"""The scenarios and commands of README and docs pages, run from top to bottom as they stand.

A block whose first line is `# NAME` is a file. In a `console` block `$` precedes a command, which
ends with exit code 0 unless a comment says otherwise; the lines below it are in what it prints,
in this order, and `...` stands for what is left out.
"""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from command_samples import ROOT, Command, commanded

from podusv_cli.engine.running import thread as march
from podusv_cli.storage.run_folder import open_run

PAGES = ("README.md", "docs/write_your_law.md", "docs/vessel.md", "docs/start.md")
LONG = [
    pytest.param(page, marks=pytest.mark.long)
    for page in ("docs/tutorial.md", "docs/papers.md", "docs/station_keeping.md")
]
SLOW = [
    pytest.param(page, marks=pytest.mark.slow)
    for page in (
        "docs/my_boat.md",
        "docs/check_a_paper.md",
        "docs/learning.md",
        "docs/choose_a_law.md",
    )
]
LARGEST = 10.0  # N m; four times the yaw moment that the actuator of README's scenario delivers


def text_of(page: str) -> str:
    return (ROOT / page).read_text()


def blocks(page: str) -> list[tuple[str, str]]:
    """Language and text of every fenced block."""
    return re.findall(r"^```(\w+)\n(.*?)^```", text_of(page), re.M | re.S)


def write_files(page: str) -> None:
    """Every file of a page, into the working folder."""
    for _, text in blocks(page):
        if named := re.match(r"# (\S+\.(?:yaml|py))\n", text):
            Path(named[1]).write_text(text)


def dialogues(page: str) -> Iterator[tuple[list[str], int, str]]:
    """Words, exit code and shown output of every command of a page's console blocks."""
    for language, text in blocks(page):
        if language == "console":
            for part in re.split(r"^\$ ", text, flags=re.M)[1:]:
                command, _, shown = part.partition("\n")
                code = re.search(r"# exit code (\d+)", command)
                yield shlex.split(command, comments=True)[1:], int(code[1]) if code else 0, shown


def pattern(shown: str) -> str:
    """A regular expression for output of these words, however it is wrapped."""
    gaps = [re.escape(" ".join(part.split())) for part in shown.split("...")]
    return " ?.* ?".join(gaps).replace(r"\ ", " ")


def test_pages_that_are_followed_in_one_folder_write_into_folders_of_their_own() -> None:
    named = [
        {words[words.index("--out") + 1] for words, _, _ in dialogues(page) if "--out" in words}
        for page in ("README.md", "docs/tutorial.md")
    ]
    assert all(named)
    assert not set.intersection(*named)


def test_readme_is_read_once() -> None:
    assert len(text_of("README.md").split()) <= 600


@pytest.fixture
def podusv(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Command:
    """The command line in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return commanded(monkeypatch, capsys)


@pytest.mark.parametrize("page", [*PAGES, *LONG, *SLOW])
def test_commands_of_a_page_print_what_it_shows(page: str, podusv: Command) -> None:
    write_files(page)
    assert len(list(dialogues(page))) > 1
    for words, code, shown in dialogues(page):
        drawing = words[0] in ("run", "compare", "bench") or words[:2] == ["sweep", "run"]
        plain = ["--no-figures"] * (drawing and "--no-figures" not in words)
        said = podusv(*words, *plain)
        printed = " ".join((said.err + said.out).split())
        assert said.code == code, (words, printed)
        assert re.search(pattern(shown), printed), (words, printed)


def test_the_first_scenario_follows_ahead_and_demands_what_is_available(podusv: Command) -> None:
    write_files("README.md")
    assert podusv("run", "mine.yaml", "--out", "x", "--no-figures").code == 0
    run = open_run(Path("x"))
    late = run.recording["time"] > 90.0
    assert run.recording["u"][late].min() > 0.4
    assert np.abs(run.recording["z_e"][late] - 0.5).max() < 0.05
    assert run.metrics["peak_tau_r"] < LARGEST


MISTAKES = {  # what is replaced in the page's law
    "a signal is not declared as one": ("= (HEADING_ERROR,)", '= ("heading_error",)'),
    "a rate or a signal is not written": ("rate[0] = k.K_i * missing", "pass"),
    "more written than declared": ("signals[0] =", "signals[1] ="),
    "`start` and `slots` disagree": (
        "    def slots(self)",
        "    def start(self, x, target, nominal): return np.zeros(2)\n    def slots(self)",
    ),
    "an unknown constant": ("k.K_u *", "k.K_w *"),
    "a default that is no number, or out of range": (
        "K_u: float = value(20.0",
        'K_u: float = value("much"',
    ),
    "text or another value that is no number is written": (
        "tau[0] = k.K_u * missing + memory[0]",
        'tau[0] = "much"',
    ),
    "numpy works on a vector in the kernel": (
        "tau[0] = k.K_u * missing + memory[0]",
        "tau[0] = np.dot(x, x)",
    ),
    "a slice, a list, `len`, `print` or `raise` is in the kernel": (
        "tau[0] = k.K_u * missing + memory[0]",
        "print(x[0]); tau[0] = 0.0",
    ),
    "`@kernel` is missing": ("    @kernel\n    def law", "    def law"),
    "a variable is read that a branch need not have set": (
        "tau[0] = k.K_u * missing + memory[0]",
        "if t < 9.0:\n            late = 1.0\n        tau[0] = late * missing",
    ),
    "an index counts from the end": ("tau[0] = k.K_u * missing", "tau[0] = x[-1]"),
    "an argument is written that may only be read": ("tau[0] =", "tau[0] = x[3] ="),
    "an endless loop": ("rate[0] = k.K_i * missing", "while True:\n            pass"),
    "a `kind` that exists": ('"pursuit"', '"pid"'),
    "a signal named as one of the closed loop's": ('"heading_error", "rad"', '"psi", "rad"'),
    "the file is no Python": ("tau[0] =", "tau[0] = ="),
    "the file raises when it is imported": ("TRIM = Signal(", "TRIM = Sgnal("),
}

LAW = "law pursuit (pursuit.py, line 25)"
KERNEL = "kernel Pursuit.law (pursuit.py, line 49) cannot become machine code: "
PLUGIN = "laws.yaml:3:11: plugins: pursuit.py cannot be imported: "
MESSAGES = {  # of the mistakes that the page does not show
    "a signal is not declared as one": (
        f"{LAW}: it declares 'heading_error', which is no Signal; write "
        'Signal("heading_error", unit, meaning)'
    ),
    "more written than declared": (
        f"{LAW}, evaluated once before the run: IndexError: index 1 is out of bounds for "
        "axis 0 with size 1 (pursuit.py, line 64)"
    ),
    "`start` and `slots` disagree": (
        f"{LAW}: it starts with a memory of shape (2,), its slots are (1,)"
    ),
    "a default that is no number, or out of range": (
        f"laws.yaml:6:12: controllers.pursuit: {LAW}: its default K_u = 'much': Input "
        "should be a valid number"
    ),
    "text or another value that is no number is written": (
        f"{KERNEL}Cannot cast ... to float64 ..."
    ),
    "a slice, a list, `len`, `print` or `raise` is in the kernel": (
        f"{KERNEL}pursuit.py, line 61: print: declare a signal and write the number into it"
    ),
    "`@kernel` is missing": (
        "kernel Pursuit.law (...) cannot become machine code: law is no kernel; write "
        "@kernel above it"
    ),
    "an index counts from the end": (
        "kernel Pursuit.law (pursuit.py, line 61): x[-1] counts from the end, and a "
        "kernel does not know where a vector ends; count from the front"
    ),
    "an endless loop": (
        f"{LAW}, evaluated once before the run: it is not over after 10 s of computing"
    ),
    "a signal named as one of the closed loop's": (
        f"{LAW}: it logs 'psi', ... and the closed loop logs ... under this name; give one"
        " of them another name"
    ),
    "the file is no Python": (f"{PLUGIN}SyntaxError: invalid syntax (pursuit.py, line 61)"),
    "the file raises when it is imported": (
        f"{PLUGIN}NameError: name 'Sgnal' is not defined (pursuit.py, line 22)"
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_in_a_law_gets_the_message_of_the_page(
    mistake: str, podusv: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(march, "PATIENCE", 0.3)
    page = "docs/write_your_law.md"
    write_files(page)
    law, (right, wrong) = Path("pursuit.py"), MISTAKES[mistake]
    assert right in law.read_text()
    numbered = law.read_text().replace("import math\n", "import math, numpy as np\n")
    law.write_text(numbered.replace(right, wrong))
    said = podusv("compare", "laws.yaml", "--set", "simulation.duration=1", "--no-figures")
    shown = dict(re.findall(r"^\| (.*?) \| `(.*)` \|$", text_of(page), re.MULTILINE))
    message = (MESSAGES | shown)[mistake].replace(" 10 s of computing", " 0.3 s of computing")
    assert re.search(pattern(message), " ".join((said.err + said.out).split())), said.err
    assert said.code in (2, 3)


# --- what docs/logs.md shows is run

PAGE = "docs/logs.md"
OCTAVE = shutil.which("octave-cli")


def logs_blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", text_of(PAGE), re.DOTALL)


def make_runs(podusv: Command) -> None:
    for words, code, _ in dialogues(PAGE):
        assert podusv(*words, "--no-figures").code == code


def test_the_python_blocks_run(podusv: Command) -> None:
    make_runs(podusv)
    known: dict[str, object] = {}
    for block in logs_blocks("python"):
        exec(block, known)  # noqa: S102
    assert len(logs_blocks("python")) == 2
    assert float(known["x"][-1]) == known["run"]["x"][-1]  # type: ignore[index]
    header = Path("both/comparison.csv").read_text().splitlines()[0]
    assert header.startswith("metric,unit,first,other,")


@pytest.mark.slow
@pytest.mark.skipif(OCTAVE is None, reason="needs Octave")
def test_octave_reads_the_same_numbers(podusv: Command) -> None:
    import podusv as podusv_package

    make_runs(podusv)
    (block,) = logs_blocks("octave")
    hidden = 'set(0, "defaultfigurevisible", "off");\n' + re.sub(r"^plot.*$", "", block, flags=re.M)
    done = subprocess.run(
        [str(OCTAVE), "--quiet", "--eval", hidden], capture_output=True, text=True
    )
    run = podusv_package.open_run("first")
    assert done.stdout == f"{run['x'][-1]:.6f} {run.metrics['iae']:.6f}\n", done.stderr
