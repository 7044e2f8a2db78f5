"""The bench: cases from layers, ranks and ratios by hand, failures contained, laws of one's own."""

import json
import math
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from command_samples import ROOT
from plugin_samples import LAW

from podusv_cli.core.errors import ScenarioError, UsageError
from podusv_cli.scenario.conflicts import clashes, contradictions
from podusv_cli.scenario.load import load_text
from podusv_cli.studies.bench import standing
from podusv_cli.studies.bench.cases import AXES, BenchCase, Selection, cases, shipped_bench
from podusv_cli.studies.bench.optima import Least, wanted_optima
from podusv_cli.studies.bench.page import as_markdown, page
from podusv_cli.studies.bench.runs import FAILED, BenchRun, play
from podusv_cli.studies.bench.standing import leaderboard, middle, profile, table, with_optima

LAYERS = {
    "laws.yaml": "vessel: {preset: paper_nonlinear}\n"
    "controllers: {pid: {kind: pid}, li: {kind: full_backstepping}}\n"
    "simulation: {step: 0.02, duration: 2.0}\nmetrics: {settling_radius: 30.0}\n"
    "start: {x: -10.0, y: -10.0}\nactuator: {kind: saturated}\n",
    "tasks/line.yaml": "path: {kind: line}\n",
    "tasks/circle.yaml": "path: {kind: circle}\n",
    "vessels/model.yaml": "{}\n",
    "vessels/otter.yaml": "vessel: {preset: otter}\n",
    "conditions/calm.yaml": "disturbance: {kind: none}\n",
    "conditions/told/model.yaml": "extends: ../calm.yaml\n"
    "nominal: {preset: paper_nonlinear, m: 30.0}\n",
    "conditions/told/otter.yaml": "extends: ../calm.yaml\nnominal: {preset: otter, m: 60.0}\n",
}


@pytest.fixture
def bench(tmp_path):
    folder = tmp_path / "bench"
    for name, text in LAYERS.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder


def made_up(law, task, iae, status="finished"):
    numbers = {"iae": iae, "z_e_steady": 0.1 * iae}
    return BenchRun(("ship", task, "calm"), law, status, "", numbers, np.zeros((2, 4)))


RUNS = [
    made_up("a", "one", 10.0),
    made_up("b", "one", 12.0),
    made_up("c", "one", 30.0, "diverged"),
    made_up("a", "two", 8.0, FAILED),
    made_up("b", "two", 4.0),
    made_up("c", "two", 4.2),
    made_up("a", "three", 5.0),
    made_up("b", "three", 5.0),
    made_up("c", "three", 1.0, "crashed"),
]


def test_ratios_are_to_the_best_law_that_reached_its_target_and_failures_share_the_last_ranks():
    made = table(RUNS).set_index(["task", "law"])
    assert made.ratio["one"].tolist() == [1.0, 1.2, math.inf]
    assert made.ratio["two"].tolist() == pytest.approx([math.inf, 1.0, 1.05])
    assert made["rank"]["one"].tolist() == [1.0, 2.0, 3.0]
    assert made["rank"]["two"].tolist() == [3.0, 1.0, 2.0]
    assert made["rank"]["three"].tolist() == [1.5, 1.5, 3.0]


def test_the_leaderboard_counts_what_the_table_has():
    board = leaderboard(table(RUNS))
    assert board.index.tolist() == ["b", "a", "c"]
    assert board.failed.tolist() == [0, 1, 2]
    assert board.mean_rank.tolist() == pytest.approx([4.5 / 3, 5.5 / 3, 8.0 / 3])
    assert board.median_ratio.tolist() == [1.0, 1.0, math.inf]
    assert board.close.tolist() == pytest.approx([2 / 3, 2 / 3, 1 / 3])


def test_every_hull_has_a_leaderboard_of_its_own():
    """What is best on one is last on the other; no number is one of both."""
    other = [
        replace(run, place=("boat", *run.place[1:]), law="bca"["abc".index(run.law)])
        for run in RUNS
    ]
    made = table([*RUNS, *other])
    boards = standing.leaderboards(made)
    assert boards.loc["ship"].index.tolist() == ["b", "a", "c"]
    assert boards.loc["boat"].index.tolist() == ["c", "b", "a"]
    for vessel in ("ship", "boat"):
        assert boards.loc[vessel].equals(leaderboard(made[made.vessel == vessel]))
    lines = as_markdown(made).splitlines()
    heads = [line for line in lines if line.startswith("###")]
    assert heads == ["### ship", "### boat"]
    assert sum(line.startswith("| law |") for line in lines) == 2
    shown = page(made, [], {}).partition('id="cases"')[0]
    assert shown.count("<th>law</th>") == 2


def test_the_interval_of_a_mean_rank_is_over_tasks_and_not_over_their_cases():
    """By hand: means of tasks 1, 2, 6; Student's 0.975 quantile with two degrees is 4.303."""
    rows = pd.DataFrame({"task": [*"aaabbbccc"], "rank": [1, 1, 1, 1, 2, 3, 6, 6, 6]})
    half = 4.303 * math.sqrt(7.0 / 3.0)
    assert standing.over_tasks(rows) == pytest.approx((3.0 - half, 3.0 + half), rel=1e-3)
    assert all(map(math.isnan, standing.over_tasks(rows[rows.task != "c"])))


def test_a_column_of_the_leaderboard_is_one_value(monkeypatch):
    worst = standing.Column(
        "worst",
        lambda rows: rows.z_e_steady.max(),
        "worst [m]",
        lambda law: f"{law.worst:.1f}",
        "The largest.",
    )
    monkeypatch.setattr(standing, "BOARD", (*standing.BOARD, worst))
    made = table(RUNS)
    assert leaderboard(made).worst.notna().any()
    assert "worst [m]" in as_markdown(made).splitlines()[2]
    shown = " ".join(page(made, [], {}).split())
    assert "<b>worst [m]</b>: The largest." in shown
    assert "<b>cases</b>" not in shown


def test_a_case_that_no_law_does_has_no_best_law():
    made = table([made_up("a", "one", 10.0, FAILED), made_up("b", "one", 12.0, "diverged")])
    assert made.ratio.tolist() == [math.inf, math.inf]
    assert made["rank"].tolist() == [1.5, 1.5]
    assert "✗" in as_markdown(made)


def test_a_run_that_ended_early_has_not_settled():
    lost = BenchRun(("ship", "one", "calm"), "a", "diverged", "", {}, np.zeros((2, 4)))
    near = made_up("a", "two", 0.1)
    assert leaderboard(table([lost, near])).settled.tolist() == [math.inf]
    assert leaderboard(table([near])).settled.tolist() == pytest.approx([0.01])


def test_half_the_failures_make_an_infinite_median():
    assert middle([1.0, math.inf]) == math.inf
    assert middle([1.0, 2.0, math.inf]) == 2.0
    assert middle([1.0, 2.0]) == 1.5


def test_a_profile_ends_at_the_share_of_cases_that_the_law_does():
    ratios = np.array([0.99, 1.0, 1.05, 1.2, 1e9])
    assert profile(table(RUNS), "b", ratios).tolist() == pytest.approx([0, 2 / 3, 2 / 3, 1, 1])
    assert profile(table(RUNS), "c", ratios).tolist() == pytest.approx([0, 0, 1 / 3, 1 / 3, 1 / 3])


def test_cases_are_every_task_with_every_vessel_in_every_condition(bench):
    found = {case.place: case for case in cases(Selection(bench))}
    names = (("model", "otter"), ("circle", "line"), ("calm", "told"))
    assert list(found) == list(product(*names))
    told = found["otter", "line", "told"].laws["li"]
    assert (told.vessel.m, told.nominal.m) == (55.0, 60.0)
    assert told.path.kind == "line"
    assert found["model", "circle", "calm"].laws["pid"].disturbance.kind == "none"


def test_a_bench_may_change_the_shipped_layers_for_a_law_of_its_own(tmp_path):
    layers = {
        "laws.yaml": "controllers: {mine: {kind: velocity_vector}}",
        "tasks/line.yaml": "",
        "conditions/calm.yaml": "",
        "vessels/otter.yaml": "controllers: {mine: {U: 2.0, N_m: 70.0}}",
    }
    for name, text in layers.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(f"extends: podusv:bench/{name}\n{text}\n")
    (case,) = cases(Selection(tmp_path))
    assert case.laws.keys() > {"mine", "pid", "los_pid"}
    assert (case.laws["mine"].controller.U, case.laws["mine"].vessel.m) == (2.0, 55.0)


def test_choices_and_changes_are_taken(bench):
    chosen = {"tasks": ["line"], "vessels": ["otter"], "conditions": ["told"]}
    (case,) = cases(Selection(bench, overrides=["simulation.duration=3"], chosen=chosen))
    assert case.place == ("otter", "line", "told")
    assert case.laws["pid"].simulation.duration == 3.0


@pytest.mark.parametrize(
    ("chosen", "told"),
    [
        ({"tasks": ["lime"]}, "unknown task 'lime'; did you mean 'line'?"),
        ({"vessels": ["boat"]}, "unknown vessel 'boat'"),
    ],
)
def test_an_unknown_name_is_told_with_those_that_there_are(bench, chosen, told):
    with pytest.raises(UsageError, match=told.replace("?", r"\?")):
        list(cases(Selection(bench, chosen=chosen)))


def test_a_folder_without_tasks_and_a_condition_without_its_vessel_are_told(bench, tmp_path):
    with pytest.raises(UsageError, match="it has no folder vessels"):
        list(cases(Selection(tmp_path)))
    (bench / "conditions/told/otter.yaml").unlink()
    with pytest.raises(UsageError, match="no file for the vessel otter"):
        list(cases(Selection(bench)))


def test_a_law_s_python_file_in_place_of_a_scenario_is_told(bench):
    with pytest.raises(UsageError, match=r"my_law.py is Python; write a YAML file with `plugins:"):
        list(cases(Selection(bench, laws=[Path("my_law.py")])))


def test_a_scenario_in_place_of_laws_is_refused_for_it_would_replace_every_task(bench, tmp_path):
    given = tmp_path / "mine.yaml"
    given.write_text("extends: podusv:mu_2017/corrected.yaml\ncontrollers: {mine: {kind: pid}}\n")
    with pytest.raises(
        UsageError, match=r"mine.yaml has vessel, path, disturbance, start, and with"
    ):
        list(cases(Selection(bench, laws=[given])))
    given.write_text("controllers: {mine: {kind: pid}}\nmetrics: {settling_radius: 2.0}\n")
    assert "mine" in next(cases(Selection(bench, laws=[given]))).laws


def test_a_long_name_may_be_broken_in_the_head_of_the_case_table():
    made = table([made_up("hand_position", "one", 10.0)])
    assert '<th class="number">hand_<wbr>position</th>' in page(made, [], {})


def test_a_median_over_failures_is_a_cross_on_the_page():
    made = table([made_up("a", "one", 10.0), made_up("b", "one", 12.0, FAILED)])
    assert "inf" not in page(made.assign(z_e_steady=math.nan), [], {}).partition("Case by case")[0]


def test_a_mistake_in_a_layer_is_told_with_its_file_and_line(bench):
    (bench / "tasks/line.yaml").write_text("path: {kind: lime}\n")
    with pytest.raises(ScenarioError, match=r"line\.yaml:1:14: path\.kind"):
        list(cases(Selection(bench)))


def test_a_law_that_fails_is_a_row_and_costs_no_other(bench):
    text = f"extends: {json.dumps(str(bench / 'laws.yaml'))}\nname: x\npath: {{kind: line}}\n"
    far = load_text(text, "x", ["metrics.settling_radius=0.001", "disturbance={kind: none}"])
    wild = ["controllers.pid.K_Pu=1e9", "actuator={kind: ideal}", "disturbance={kind: none}"]
    laws = {
        "far": far.scenario.singles()["li"],
        "wild": load_text(text, "x", wild).scenario.singles()["pid"],
        "good": load_text(text, "x", ["disturbance={kind: none}"]).scenario.singles()["pid"],
    }
    found = {run.law: run for run in play(BenchCase("ship", "line", "calm", laws))}
    assert {law: run.status for law, run in found.items()} == {
        "far": FAILED,
        "wild": "diverged",
        "good": "finished",
    }
    assert found["wild"].cause.startswith("diverged at t = ")
    assert ";" not in found["wild"].cause
    assert "m off over the steady window" in found["far"].cause
    alone = laws["good"].probe()
    assert set(found["good"].metrics) == set(alone.summary(np.zeros(alone.size)))
    assert found["good"].track[0].tolist() == [-10.0, -10.0, 0.0, 0.0]


def test_the_command_writes_table_board_and_page_and_takes_a_law_of_one_s_own(bench, podusv):
    (bench.parent / "my_law.py").write_text(LAW)
    own = bench.parent / "own.yaml"
    own.write_text("plugins: [my_law.py]\ncontrollers: {mine: {kind: cross_track}}\n")
    said = podusv("bench", str(bench), "--laws", str(own), "--out", "out", "--condition", "calm")
    assert said.code == 0, said.err
    assert "12 runs: out/report.html" in said.out
    runs = pd.read_csv("out/runs.csv")
    assert sorted(set(runs.law)) == ["li", "mine", "pid"]
    assert len(runs) == 12
    assert runs.groupby(["vessel", "task"])["rank"].sum().tolist() == [6.0] * 4
    written = Path("out/report.html").read_text()
    for part in ("<td>mine</td>", "Case by case", "data:image/png", "otter"):
        assert part in written
    again = podusv("bench", str(bench), "--out", "out")
    assert again.code == 5
    assert "--force replaces it" in again.err


@pytest.mark.long
def test_a_law_that_ends_its_process_costs_no_other(bench, podusv):
    # Plain Python may end its process; compiled code has no way to.
    line = "        signals[0] = target[1] - x[1]\n"
    assert line in LAW
    text = LAW.replace(line, f"{line}        if t > 0.5:\n            import os; os._exit(9)\n")
    (bench.parent / "my_law.py").write_text(text)
    own = bench.parent / "own.yaml"
    own.write_text(
        "plugins: [my_law.py]\nsimulation: {compiled: false}\n"
        "controllers: {mine: {kind: cross_track}}\n"
    )
    chosen = ("--condition", "calm", "--vessel", "model", "--task", "line", "--no-figures")
    said = podusv("bench", str(bench), "--laws", str(own), "--out", "out", *chosen)
    assert said.code == 3
    status = pd.read_csv("out/runs.csv").set_index("law").status
    assert status.to_dict() == {"pid": "finished", "li": "finished", "mine": "crashed"}


def test_the_told_hulls_of_the_shipped_bench_are_a_quarter_off():
    inertia = {"m", "I_z", "X_udot", "Y_vdot", "Y_rdot", "N_vdot", "N_rdot"}
    for condition, of_inertia, of_damping in (
        ("hull_light", 0.75, 1.25),
        ("hull_heavy", 1.25, 0.75),
    ):
        chosen = {"tasks": ["line"], "conditions": [condition]}
        for case in cases(Selection(shipped_bench(), chosen=chosen)):
            law = case.laws["pid"]
            for name in inertia | {n for n in type(law.vessel).model_fields if "_" in n}:
                true, told = getattr(law.vessel, name), getattr(law.nominal, name)
                if isinstance(true, float) and name not in ("x_g",) and true:
                    factor = of_inertia if name in inertia else of_damping
                    assert told == pytest.approx(factor * true, rel=1e-5), (case.place, name)


def test_text_of_users_is_escaped_on_the_page():
    made = table([made_up("<b>", "one", 10.0)])
    assert "<td><b></td>" not in page(made, [], {"argv": "<i>"})
    assert "&lt;i&gt;" in page(made, [], {"argv": "<i>"})


@pytest.mark.long
def test_every_file_of_the_shipped_bench_makes_a_case_that_is_valid():
    folder = shipped_bench()
    names = {axis: sorted(p.stem for p in (folder / axis).iterdir()) for axis in AXES}
    assert len(names["tasks"]) >= 8
    assert len(names["conditions"]) == 8
    every = {"vessels": names["vessels"], "tasks": ["line"], "conditions": names["conditions"]}
    tasks = {"vessels": ["otter"], "conditions": ["calm"]}
    made = [*cases(Selection(folder, chosen=every)), *cases(Selection(folder, chosen=tasks))]
    assert {case.task for case in made} == set(names["tasks"])
    for case in made:
        for law in case.laws.values():
            assert not [*contradictions(law), *clashes(law, law.plans())]
            assert law.metrics.settling_radius == 0.5 * law.vessel.length


# --- optima


def test_ratios_to_the_optimum_are_those_of_the_cases_that_have_one():
    two = Least([("ship", "two", "calm")], 3.2, 0.2, 0.01, "b")
    made = with_optima(table(RUNS), [two]).set_index(["task", "law"])
    assert made.of_optimum["two"].tolist() == pytest.approx([math.inf, 1.25, 1.3125])
    assert made.of_optimum["one"].isna().all()
    board = leaderboard(made.reset_index())
    assert board.of_optimum[["a", "b", "c"]].tolist() == pytest.approx([math.inf, 1.25, 1.3125])
    assert "| median of IAE / optimum |" in as_markdown(made.reset_index())
    written = page(made.reset_index(), [], {}, [two])
    assert "up to 0.01 m s from it. 1 of 3 cases have one" in " ".join(written.split())


def test_cases_that_differ_in_what_laws_know_share_an_optimum_and_pods_have_none():
    chosen = {"tasks": ["line"], "vessels": ["revolt"]}
    every = list(cases(Selection(shipped_bench(), chosen=chosen)))
    done = [
        BenchRun(case.place, law, "finished", "", {"iae": iae}, np.zeros((2, 4)))
        for case in every
        for law, iae in (("li", 9.0), ("pid", 5.0), ("dsc", 7.0))
    ]
    found, refused = wanted_optima(every, done)
    shared = {"sea", "hull_light", "hull_heavy", "hull_other", "sampled"}
    assert [{case.condition for case in group.cases} for group in found] == [{"calm"}, shared]
    assert [list(group.laws) for group in found] == [["pid", "dsc"]] * 2
    assert len(refused) == 2
    assert any("actuator.kind: pod" in text for text in refused)
    assert any("loads that depend on time alone" in text for text in refused)


@pytest.mark.long
def test_the_command_finds_optima(bench, podusv):
    pytest.importorskip("casadi", reason="the optimum needs CasADi")
    pod = "extends: calm.yaml\nactuator: {kind: pod, preset: cybership2_pod}\n"
    (bench / "conditions/pod.yaml").write_text(pod)
    chosen = ("--vessel", "model", "--task", "line", "--no-figures")
    said = podusv("bench", str(bench), "--out", "out", "--optimum", *chosen)
    assert said.code == 0, said.err
    assert "actuator.kind: pod" in said.err
    assert "median of IAE / optimum" in said.out
    optima = pd.read_csv("out/optima.csv")
    assert optima.condition.tolist() == ["calm", "told"]  # what is told does not matter
    assert optima.optimum.nunique() == 1
    runs = pd.read_csv("out/runs.csv").set_index("condition")
    assert (runs.of_optimum[["calm", "told"]] > 1.0).all()
    assert runs.optimum["calm"].iloc[0] == optima.optimum[0]
    assert runs.optimum["pod"].isna().all()


def test_on_legs_the_cross_track_error_counts_in_place_of_the_distance():
    def on_legs(law, size, status="finished"):
        numbers = {"e_ct_integral": size, "e_ct_steady": 0.1, "path_time": 30.0, "tv_tau_u": 1.0}
        return BenchRun(("hull", "legs", "calm"), law, status, "", numbers, np.empty((0, 4)))

    made = table([on_legs("a", 10.0), on_legs("b", 15.0), on_legs("c", 1.0, "not at its target")])
    assert made.iae.tolist() == [10.0, 15.0, 1.0]
    assert made.ratio.tolist() == [1.0, 1.5, np.inf]
    assert made["rank"].tolist() == [1.0, 2.0, 3.0]
    assert made.settling_time.tolist() == [30.0] * 3


@pytest.mark.slow
def test_the_bench_on_legs_is_what_its_page_says(podusv):
    assert podusv("bench", str(ROOT / "configs/bench_legs"), "--no-figures", "--out", "b").code == 0
    runs = pd.read_csv("b/runs.csv")
    others = runs.law.str.contains("ardupilot|px4|mss")
    assert (sum(~others), set(runs.status[~others])) == (112, {"finished"})
    assert (sum(others), sum(runs.status[others] != "finished")) == (40, 30)
    failed = runs.law[runs.status != "finished"].value_counts()
    assert failed[["ardupilot", "ardupilot_l1", "px4"]].tolist() == [8, 8, 8]
    ranks = runs.pivot_table("rank", "law", "vessel")
    page = " ".join((ROOT / "docs/bench.md").read_text().split())
    for law, hull in (("velocity_vector", "cybership2"), ("super_twisting", "paper_nonlinear")):
        assert ranks[hull].idxmin() == law
        assert f"`{law}` on `{hull}` ({ranks[hull].min():.2f})" in page
