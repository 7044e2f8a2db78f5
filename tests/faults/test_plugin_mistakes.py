"""A mistake in a plug-in's law is refused before the run with file and line, never as a bug."""

import pickle
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest
from plugin_samples import LAW, SCENARIO, put

import podusv as podusv_python
from podusv_cli.core import plugins

# What is written in place of what, and what is said.
MISTAKES = {
    "two kinds": ('["cross_track"] =', '["other"] =', "its kind is no fixed word; write kind: "),
    "other arguments": ("law(t, x, ", "law(t, y, ", "'y' is none of its arguments (allowed: "),
    "no constant": (
        "return PUSH * k.gain",
        "return PUSH * k.gian",
        "no attribute 'gian' (my_law.py, line 22); it has gain, and those of the nominal vessel",
    ),
    "no rate": ("        rate[0] = signals[0]\n", "", "it leaves the rate of drift unwritten"),
    "wrong shape": ("np.zeros(1)", "np.zeros(2)", "a memory of shape (2,), its slots are (1,)"),
    "slots raise": ("return ((DRIFT, 1),)", "return self.nothing", "AttributeError"),
    "no slots": ("return ((DRIFT, 1),)", "return 5", "TypeError"),
    "start raises": ("return np.zeros(1)", "return 1 / 0", "ZeroDivisionError"),
}


COMMANDS = [("validate",), *((name, "--out", "r", "--no-figures") for name in ("run", "compare"))]


@pytest.mark.parametrize("name", MISTAKES)
def test_it_is_refused_before_the_run(podusv, name):
    right, wrong, words = MISTAKES[name]
    assert right in LAW
    for command, *options in COMMANDS:
        said = podusv(command, put(law=LAW.replace(right, wrong)), *options)
        told = " ".join(said.err.split())
        assert said.code == 2, said.err
        assert words in told
        assert "my_law.py, line " in told
        assert "bug" not in told
        assert not Path("r").exists()


PATH = """
from podusv_cli.components.paths.base import Path


class Still(Path):
    kind: Literal["still"] = "still"
    radius: float = value(1.0, "m", "of nothing", gt=0)

    def table(self):
        return np.array([1.0])

    @staticmethod
    @kernel
    def evaluate(t, k, table, target):
        for i in range(6):
            target[i] = k.radius
"""
PATH_MISTAKES = {
    "constant": ("= k.radius", "= k.radios", "'radios' (my_law.py, line 59); it has radius"),
    "numpy": ("= k.radius", "= np.linalg.norm(3.0)", "cannot become machine code"),
    "table": ("np.array([1.0])", "np.array(1 / 0)", "division by zero (my_law.py, line 53)"),
}


@pytest.mark.parametrize("name", PATH_MISTAKES)
def test_a_mistake_in_a_path_is_not_blamed_on_the_law(podusv, name):
    right, wrong, words = PATH_MISTAKES[name]
    scenario = SCENARIO.replace("kind: line", "kind: still")
    for command, *options in COMMANDS:
        said = podusv(command, put(scenario, LAW + PATH.replace(right, wrong)), *options)
        told = " ".join(said.err.split())
        assert said.code == 2, said.err
        assert words in told
        assert "law cross_track" not in told
        assert "bug" not in told


MORE = """
from podusv_cli.core.finding import warn_after_run, warn_before_run
from podusv_cli.figures.sheet import figure
from podusv_cli.metrics.metric import Accumulator, Metric, gathered


@kernel
def watch(t, weight, s, row, k, seen):
    seen[0] = abs(s[1])


def made(name="own", size=lambda layout: 1, constants=lambda layout: {}, result=gathered(0)):
    return Metric(name, "m", "of its own", Accumulator(watch, size, constants), result)


def failing(*seen):
    yield 1 / 0


"""
# What else a plug-in has, the exit code, and what is said.
OTHERS = {
    "result": ("m = made(result=lambda seen, step: 1 / 0)", 0, "own could not be made: Zero"),
    "text": ("m = made(result=lambda seen, step: 'a')", 0, "metric own could not be made: ValueE"),
    "size": ("m = made(size=lambda layout: layout.no)", 2, "metric own, its accumulator"),
    "constants": ("m = made(constants=lambda layout: 5)", 2, "metric own, its accumulator, asked"),
    "constant": ("m = made(constants=lambda layout: {'standoff': 7.0})", 2, "another constant"),
    "word": ("m = made('a b')", 2, "the name of a metric is at most 64 letters, digits and '_'"),
    "metric": ("m = made('iae')", 2, "my_law.py: podusv_cli.metrics.distance has the name 'iae'"),
    "figure": ("f = figure('pods', caption='', signals=('x',))(failing)", 2, "has the name 'pods'"),
    "before": ("f = warn_before_run('a', about='path', meaning='m')(failing)", 0, "looked for: Z"),
    "after": ("f = warn_after_run('a', about='path', meaning='m')(failing)", 0, "looked for: Z"),
    "about": ("f = warn_after_run('a', about='pth', meaning='m')(failing)", 2, "mean 'path'"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", OTHERS)
def test_mistakes_in_metrics_figures_and_findings_cost_no_run(podusv, name):
    text, code, words = OTHERS[name]
    said = podusv("run", put(law=LAW + MORE + text + "\n"), "--out", "r", "--no-figures")
    assert said.code == code, said.err
    assert words in " ".join(said.err.split())
    assert "bug" not in said.err
    assert Path("r/log.h5").exists() == (code == 0)
    assert podusv("validate", "a.yaml").code == code
    if code == 0:
        assert '"iae"' in Path("r/metrics.json").read_text()


@pytest.mark.usefixtures("podusv")
def test_a_metric_that_raises_costs_no_run_in_memory():
    run = podusv_python.simulate(put(law=LAW + MORE + OTHERS["result"][0] + "\n"))
    assert run.metrics["iae"] > 0
    assert any("metric own could not be made" in line for line in run.warnings)


@pytest.mark.usefixtures("podusv")
def test_a_scenario_keeps_the_plug_in_that_it_was_loaded_with():
    law = LAW + "# of this test alone\n"
    scenario = podusv_python.load(put(law=law))
    first = podusv_python.simulate(scenario)
    put(law=law.replace("PUSH = 1.0", "PUSH = 2.0"))
    again = podusv_python.simulate(podusv_python.load(scenario, {"name": "x"}))
    assert (again["tau_u_cmd"] == first["tau_u_cmd"]).all()
    Path("laws/my_law.py").unlink()
    assert podusv_python.simulate(scenario).status == "finished"


def test_threads_find_a_whole_module():
    text = f"import time\ntime.sleep(0.05)\nWHOLE = {id(object())}\n"
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda _: plugins.from_file("slow.py", text), range(4)))
    assert all("WHOLE" in vars(module) for plugin in found for _, module in plugin.offers)


def test_a_package_s_digest_tells_where_its_files_are(tmp_path, monkeypatch):
    point = EntryPoint("a", "digested.a", "podusv.paths")
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "digested/one").mkdir(parents=True)
    (tmp_path / "digested/two").mkdir()
    (tmp_path / "digested/__init__.py").touch()
    (tmp_path / "digested/one/a.py").write_text("A = 1\n")
    before = plugins._package_digest([("paths", point)])
    (tmp_path / "digested/one/a.py").rename(tmp_path / "digested/two/a.py")
    assert plugins._package_digest([("paths", point)]) != before


@pytest.mark.long
@pytest.mark.usefixtures("podusv")
def test_a_scenario_with_a_plug_in_is_run_in_another_process():
    scenario = podusv_python.load(put(law=LAW + "# sent to another process\n"))
    Path("sent").write_bytes(pickle.dumps(scenario))
    Path("laws/my_law.py").unlink()
    assert pickle.loads(Path("sent").read_bytes()) == scenario
    code = "import pickle; print(pickle.load(open('sent', 'rb')).controller.kind)"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert told.stdout == "cross_track\n"
    plain = podusv_python.load("podusv:theory/sign.yaml")
    assert pickle.loads(pickle.dumps(plain)) == plain
    assert pickle.loads(pickle.dumps(plain)).open_choice == plain.open_choice
