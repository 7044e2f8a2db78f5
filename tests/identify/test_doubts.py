"""What is doubtful about a hull from logs is said, and one that predicts worse is not written."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from identify_samples import HULL, commands_of, made_logs, motion, problem, table_of

from podusv_cli.identify import judge
from podusv_cli.identify.answer import Identification, Whiteness
from podusv_cli.identify.doubts import correlation_words, loud_words
from podusv_cli.identify.fit.estimate import HullEstimate, directions
from podusv_cli.identify.outputs import force_rows, page, parameter_rows
from podusv_cli.identify.phrases import summary


def write_log(path, hull, seed):
    """60 s of a boat in calm water."""
    times = np.arange(0.0, 60.0, 0.2)
    commands = commands_of(times, seed=seed)
    states = motion(commands, times, np.array([0.0, 0.0, 0.0, 0.4, 0.0, 0.0]), hull)
    table = table_of(times, states, commands, seed=seed)
    pd.DataFrame({"t": times, **table.columns}).to_csv(path, index=False)


@pytest.fixture(scope="module")
def boats(tmp_path_factory):
    """Logs of two boats: the vessel that is given, and one that turns half as willingly."""
    folder = tmp_path_factory.mktemp("boats")
    other = HULL.changed({"N_r": 4.0 * HULL.N_r, "X_u": 2.0 * HULL.X_u, "Y_v": 2.0 * HULL.Y_v})
    write_log(folder / "own.csv", HULL, 0)
    write_log(folder / "other.csv", other, 1)
    (folder / "boat.yaml").write_text(
        "extends: podusv:trials/base.yaml\nvessel: {preset: cybership2}\n"
        "actuator: {kind: ideal}\ncontroller: {kind: pid}\n"
        "identify:\n  columns: {time: t}\n  draws: 5\n  current: 0\n  free: [damping.surge, N_r]\n"
        "  logs: [{file: other.csv}, {file: own.csv, role: judge}]\n"
    )
    return folder


@pytest.mark.long
def test_a_hull_that_predicts_worse_than_the_vessel_is_written_with_force_alone(
    boats, tmp_path, podusv
):
    """The fitted log is of another boat than the judged one, which `vessel` is."""
    hull = tmp_path / "hull"
    call = ("identify", boats / "boat.yaml", "--out", hull, "--no-figures")
    code, _, err = podusv(*call)
    assert code == 3
    last = err.splitlines()[-1]
    assert last.startswith("own.csv: the hull is no improvement. After 30 s the rms position")
    assert last.endswith("It is kept as refused.yaml; --force writes it as identified.yaml.")
    assert not (hull / "identified.yaml").exists()
    assert not (hull / "posterior.csv").exists()
    for kept in ("refused.yaml", "refused_posterior.csv", "parameters.csv", "judged.csv"):
        assert (hull / kept).stat().st_size > 0
    assert last.split(";")[0].split(",")[0] in (hull / "report.html").read_text()
    judged = pd.read_csv(hull / "judged.csv").set_index(["log", "horizon [s]", "who"])
    errors = judged.loc["own.csv", 30.0]["position [m]"]
    assert errors["identified"] > 1.2 * errors["prior"]
    study = tmp_path / "study.yaml"
    study.write_text(
        "extends: podusv:trials/base.yaml\nvessel: {preset: cybership2}\nactuator: {kind: ideal}\n"
        "controller: {kind: pid}\nsweep: {draws: 2, seed: 1, vary: {vessel: {identified: hull}}}\n"
    )
    code, _, err = podusv("sweep", "run", study, "--out", tmp_path / "study")
    assert code == 2
    assert "has no posterior.csv; podusv identify makes it, of a hull that it refuses with" in err
    code, out, err = podusv(*call, "--force")
    assert code == 0
    assert "refused" not in err
    assert out.splitlines()[-2] == f"hull: {hull / 'identified.yaml'}"
    assert (hull / "posterior.csv").exists()
    assert not (hull / "refused.yaml").exists()


@pytest.mark.long
def test_a_refused_hull_says_so_in_json_and_in_python(boats, tmp_path, podusv):
    out = podusv(
        "identify", boats / "boat.yaml", "--out", tmp_path / "a", "--json", "--no-figures"
    )[1]
    assert json.loads(out)["refused"].startswith("own.csv: the hull is no improvement. After 30 s")
    import podusv as library

    hull = library.identify(boats / "boat.yaml", out=tmp_path / "b", figures=False)
    assert hull.refusal.startswith("own.csv: the hull is no improvement. After 30 s")
    assert ", refused, " in repr(hull)


def scored(errors, role="judge", log="a.csv", horizon=30.0):
    """Errors of the hull from the logs and of the prior, as scores."""
    return [
        judge.Score(log, role, horizon, who, 1, error, 0.1)
        for who, error in zip(judge.WHO, (*errors, 9.0), strict=True)
    ]


@pytest.mark.parametrize(
    ("scores", "noise", "logs"),
    [
        (scored((1.1, 1.0)), 0.0, []),  # no worse than by accident
        (scored((1.3, 1.0)), 0.0, ["a.csv"]),
        (scored((1.3, 1.0)), 1.2, []),  # noise of the positions explains both
        (scored((1.3, 1.0), horizon=5.0) + scored((0.5, 1.0)), 0.0, []),  # 30 s count
        (scored((1.3, 1.0), horizon=math.inf) + scored((0.5, 1.0)), 0.0, []),
        (scored((1.3, 1.0), horizon=5.0), 0.0, ["a.csv"]),  # where there are any
        (scored((1.3, 1.0), "fit") + scored((0.5, 1.0), log="b.csv"), 0.0, []),
        (scored((1.3, 1.0), "fit"), 0.0, ["a.csv"]),  # worse even along what was fitted
        (scored((0.1, 1.0)) + scored((3.0, 1.0), log="b.csv"), 0.0, ["b.csv"]),
        ([], 0.0, []),
    ],
)
def test_which_scores_refuse_a_hull(scores, noise, logs):
    worse = judge.scores_worse_than_prior(judge.decisive(scores), noise)
    assert [own.log for own, _ in worse] == logs


@pytest.fixture(scope="module")
def boat():
    return made_logs()[2:]


def answer_at(logs, off, *, settled=True):
    """An answer whose numbers are so many prior deviations, by name, from what was known."""
    given = problem(logs, free=("X_u", "N_r"), prior=0.5, draws=10)
    size = len(given.numbers)
    y = np.array([off.get(number.name, 0.0) for number in given.numbers])
    found = HullEstimate(y, 0.0, 0.01 * np.eye(size), 1, settled)
    return Identification(given, found, directions(found.covariance, 2), (), ())


@pytest.mark.parametrize(
    ("name", "meaning"),
    [
        ("q_b", "the motion on loads"),
        ("q_b_psi", "the motion on loads"),
        ("q_u", "accelerations that neither hull nor load explains"),
        ("sigma_p", "the sensor is off by more"),
        ("sigma_r", "the sensor is off by more"),
    ],
)
def test_a_noise_far_above_what_was_known_is_said_with_its_meaning(boat, name, meaning):
    """1.5 is the deviation of a noise's logarithm."""
    (line,) = loud_words(answer_at(boat, {name: 2.1, "N_r": 2.5}))
    assert line.startswith(f"{name} is ")
    assert f"{math.exp(1.5 * 2.1):.3g} times what was known before (2.1 prior" in line
    assert meaning in line
    assert loud_words(answer_at(boat, {name: 1.9})) == []
    assert loud_words(answer_at(boat, {name: -2.5})) == []


def test_correlated_innovations_are_said():
    def lines(*pairs):
        rows = [Whiteness("a.csv", f"s{i}", n, 1.0, c) for i, (n, c) in enumerate(pairs)]
        return correlation_words(SimpleNamespace(whiteness=rows))

    assert lines((600, 0.19), (50, 0.4)) == []  # the latter is chance: 0.4 sqrt(50) = 2.8
    (line,) = lines((600, 0.21), (600, -0.5), (100, 0.41), (600, 0.3), (600, 0.25))
    assert "explain: s1 of a.csv -0.5, s2 of a.csv 0.41, s3 of a.csv 0.3" in line
    assert "s4 of a.csv 0.25 and 1 more." in line


def test_the_correlation_of_innovations_is_that_of_a_known_process(boat):
    """Values of a first-order process with 0.6 from one to the next."""
    answer = answer_at(boat, {})
    log, rng = boat[0], np.random.default_rng(1)
    count = log.record.delivered
    noise = rng.standard_normal(count)
    for i in range(4, count):  # x, y, psi, r come in turn
        noise[i] += 0.6 * noise[i - 4]
    followed = SimpleNamespace(innovations=noise[:, None], variances=np.ones((count, 1)))
    answer = replace(answer, problem=SimpleNamespace(follow=lambda *_: followed, logs=[log]))
    assert [w.correlation for w in answer.whiteness] == pytest.approx([0.6] * 4, abs=0.1)
    assert len(correlation_words(answer)) == 1


def test_nothing_is_called_determined_where_the_search_did_not_settle(boat):
    """Widths are 0.1 of the prior's; settled, all counts as determined."""
    settled, not_settled = (answer_at(boat, {}, settled=settled) for settled in (True, False))
    assert (settled.determined_count, not_settled.determined_count) == (2, 0)
    assert {row[-1] for row in parameter_rows(settled)} == {"yes"}
    assert {row[-1] for row in parameter_rows(not_settled)} == {"not settled"}
    assert {row[-1] for row in force_rows(not_settled)} == {"not settled"}
    words = " ".join(summary(not_settled))
    assert "the search did not settle, so the logs count as determining nothing" in words
    assert "is known to" in " ".join(summary(settled))
    assert "known to" not in words
    assert "2 directions of the hull's numbers are determined" in " ".join(summary(settled))
    assert "The logs determine the first 0." in page(not_settled, [], {}, [])
