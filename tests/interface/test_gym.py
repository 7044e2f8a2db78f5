"""Environments of Gymnasium: the draws, the bits and the metrics of podusv's own runs."""

import math
import pickle
import re
import subprocess
import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml
from command_samples import ROOT
from policy_samples import content, drawn, symmetric

import podusv
from podusv_cli.components.controllers.policy import Policy
from podusv_cli.core.errors import UsageError
from podusv_cli.core.kernel import bundle, call
from podusv_cli.studies.making import draws

pytest.importorskip("gymnasium", reason="Gymnasium is not installed: podusv[gym]")
import gymnasium.utils.env_checker

import podusv.gym

PERIOD = 0.1  # s
SCENARIO: dict[str, Any] = {
    "extends": "podusv:mu_2017/corrected.yaml",
    "control": {"period": PERIOD},
    "simulation": {"duration": 3.0},
    "sweep": {
        "seed": 5,
        "draws": 20,
        "vary": {
            "vessel.m": {"times": {"uniform": [0.8, 1.2]}},
            "start.x": {"uniform": [-12.0, 12.0]},
            "start.psi": {"angle": "all"},
            "path.speed": {"uniform": [0.0, 0.6]},
        },
    },
}
LAW = Policy(content=content(symmetric()))


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def single(**changes: Any) -> podusv.gym.Env:
    return podusv.gym.Env(SCENARIO, changes)


def several(count: int, **changes: Any) -> podusv.gym.VectorEnv:
    return podusv.gym.VectorEnv(SCENARIO, changes, count=count)


def demanded(env: podusv.gym.Env) -> Any:
    """What the law `policy` asks for where the session is."""
    now, tau, work = env.session.observe(), np.zeros(2), np.zeros(LAW.workspace())
    k = bundle(LAW.constants())
    call(LAW.law, x=now.state, target=now.target, k=k, table=LAW.table(), tau=tau, work=work)
    return tau


def steered(env: podusv.gym.Env, seed: int) -> float:
    """The rewards of an episode under the policy."""
    env.reset(seed=seed)
    total, over = 0.0, False
    while not over:
        _, reward, terminated, over, _ = env.step(demanded(env))
        assert not terminated
        total += reward
    return total


@pytest.mark.filterwarnings("ignore:.*(infinity|symmetric|spec):UserWarning")
def test_gymnasium_finds_no_fault():
    gymnasium.utils.env_checker.check_env(single())


def test_an_agent_that_does_what_the_law_does_is_rewarded_as_the_study_judges_it():
    """Draw for draw: what `reset(seed=i)` begins is the run i of the study, to the bit."""
    law = {"controllers": None, "controller": LAW.model_dump(exclude_none=True)}
    study = podusv.sweep(SCENARIO, {**law, "sweep.draws": 4}, out="study", figures=False)
    table, env = study.table, single()
    for i in range(4):
        assert steered(env, i) == pytest.approx(-table["iae"][i], rel=1e-12)
        assert env.session.metric("iae") == table["iae"][i]
        assert env.session.scenario.vessel.m == 23.8 * table["vessel.m"][i]


def test_an_episode_is_a_run_of_its_own():
    env = single()
    total = steered(env, 3)
    run = env.session.close("episode", figures=False)
    assert run.metrics["iae"] == env.session.metric("iae") == pytest.approx(-total)
    assert run.scenario.start.x == env.session.scenario.start.x


def test_without_a_seed_no_draw_of_the_study_comes_up():
    env, sweep = single(), podusv.load(SCENARIO).sweep
    judged = set(draws.table(sweep, 0, 1000)["start.x"])
    env.reset(seed=7)
    assert env.session.scenario.start.x in judged
    starts = []
    for _ in range(30):
        env.reset()
        starts.append(env.session.scenario.start.x)
    assert len(set(starts)) == 30
    assert judged.isdisjoint(starts)
    assert min(starts) < -6.0 < 6.0 < max(starts)
    task, first = env._task, SimpleNamespace(integers=lambda most: 0)
    assert (
        task.draw_scenario(None, first).start.x not in judged
    )  # also with the number of a study's draw
    again = single()
    again.reset(seed=7)
    again.reset()
    assert again.session.scenario.start.x == starts[0]


def test_draws_of_no_study_are_independent_where_those_of_the_study_are_not():
    env = single(**{"sweep.design": "sobol"})
    env.reset(seed=2)
    assert env.session.scenario.start.x in draws.table(env._task.sweep, 0, 4)["start.x"]
    env.reset()


@pytest.mark.parametrize("reward", ["iae", "energy", "peak_tau_u"])
def test_environments_side_by_side_have_the_bits_of_single_ones(reward):
    """Eleven of them take two marches; the last steps are a second episode."""
    many = podusv.gym.VectorEnv(SCENARIO, count=11, reward=reward)
    ones = [podusv.gym.Env(SCENARIO, reward=reward) for _ in range(11)]
    seen, _ = many.reset(seed=4)
    np.testing.assert_array_equal(seen, [env.reset(seed=4 + i)[0] for i, env in enumerate(ones)])
    random = np.random.default_rng(0)
    for step in range(30):
        actions = random.normal(0.0, 2.0, (11, 2))
        seen, gained, dead, cut, info = many.step(actions)
        each = [env.step(action) for env, action in zip(ones, actions, strict=True)]
        np.testing.assert_array_equal(seen, [one[0] for one in each])
        np.testing.assert_array_equal(gained, [one[1] for one in each])
        assert not dead.any()
        assert set(cut) == {step == 29} == {answer[3] for answer in each}
        assert set(info["time"]) == {each[0][4]["time"]}
    seen, gained, dead, cut, info = many.step(np.full((11, 2), 9.0))
    assert not np.concatenate([gained, dead, cut, info["time"]]).any()
    assert len(np.unique(seen[:, 0])) == 11
    _, gained, *_ = many.step(np.zeros((11, 2)))
    assert (gained < 0.0).all() or reward != "iae"


SEEN: dict[str, dict[str, Any]] = {
    "an estimate": {"measurement": {"kind": "sensors"}, "estimator": {"kind": "ekf"}},
    "legs": {
        "path": {"kind": "legs", "points": [[0, 0], [6, 0], [6, 6]]},
        "start.y": 0.0,
        "sweep.vary": {"path.speed": None, "start.x": {"uniform": [0.0, 9.0]}},
    },
}


@pytest.mark.parametrize("case", SEEN)
def test_an_estimate_and_a_target_on_legs_are_seen_side_by_side_as_alone(case):
    """On legs some runs are past the first corner, and others are before it."""
    given = {"reward": "peak_tau_u"}
    many = podusv.gym.VectorEnv(SCENARIO, SEEN[case], count=5, **given)
    ones = [podusv.gym.Env(SCENARIO, SEEN[case], **given) for _ in range(5)]
    many.reset(seed=0)
    for i, env in enumerate(ones):
        env.reset(seed=i)
    for _ in range(20):
        seen, *_ = many.step(np.full((5, 2), 2.0))
        np.testing.assert_array_equal(seen, [env.step((2.0, 2.0))[0] for env in ones])
    assert len({tuple(env.session.observe().target[2:4]) for env in ones}) > 1


def test_what_was_seen_stays_as_it_was():
    many = several(2)
    seen, info = many.reset(seed=0)
    before, times = seen.copy(), info["time"].copy()
    many.step(np.ones((2, 2)))
    np.testing.assert_array_equal(seen, before)
    np.testing.assert_array_equal(info["time"], times)


def test_where_one_diverges_the_others_of_its_march_are_truncated():
    """The actuator has no limits; one of nine is asked for more than a number can be."""
    free = {"actuator": {"kind": "ideal"}, "vessel": {"preset": "paper"}}
    many = podusv.gym.VectorEnv(SCENARIO, free, count=9, limits=(1e300, 1e300))
    before, _ = many.reset(seed=0)
    actions = np.zeros((9, 2))
    actions[2] = 1e200
    seen, gained, dead, cut, info = many.step(actions)
    assert list(np.flatnonzero(dead)) == [2]
    assert list(np.flatnonzero(cut)) == [0, 1, 3, 4, 5, 6, 7]  # 8 is alone in its march
    np.testing.assert_array_equal(seen[2], before[2])
    assert np.isfinite(gained).all()
    assert info["time"][8] == PERIOD
    seen, gained, dead, cut, info = many.step(np.zeros((9, 2)))
    assert not np.concatenate([dead, cut, gained[:8]]).any()
    assert gained[8] < 0.0
    assert list(info["time"]) == [0.0] * 8 + [2 * PERIOD]
    env = podusv.gym.Env(SCENARIO, free, limits=(1e300, 1e300))
    env.reset(seed=2)
    assert env.step(np.array([1e200, 1e200]))[2:4] == (True, False)
    with pytest.raises(UsageError, match="the episode is over; call reset"):
        env.step(np.zeros(2))


def test_spaces_are_the_actuator_s_limits_or_those_that_are_given():
    np.testing.assert_array_equal(single().action_space.high, [8.0, 2.5])
    own = podusv.gym.Env(SCENARIO, limits=(3.0, 1.0))
    np.testing.assert_array_equal(own.action_space.low, [-3.0, -1.0])
    assert several(3).action_space.shape == (3, 2)
    assert several(3).observation_space.shape == (3, 8)


def test_plain_python_has_the_bits_of_machine_code():
    changes = {"simulation.duration": 0.2}
    compiled, plain = single(**changes), single(**changes, **{"simulation.compiled": False})
    for env in (compiled, plain):
        env.reset(seed=1)
    for _ in range(2):
        one, other = (env.step((3.0, 0.5)) for env in (compiled, plain))
        np.testing.assert_array_equal(one[0], other[0])
        assert one[1:] == other[1:]


VARIED = "sweep.vary"
REFUSED: dict[str, tuple[dict[str, Any], dict[str, Any], str]] = {
    "no limits": ({"actuator": {"kind": "ideal"}}, {}, r"actuator does not say .* limits=\(8"),
    "no metric": ({}, {"reward": "iea"}, "unknown reward 'iea'; did you mean 'i"),
    "a grid": ({"sweep.grid": {"path.course": [0.1, 0.2]}}, {}, "sweep.grid has several"),
    "a gain": (
        {"controller": {"kind": "pid"}, VARIED: {"controller.K_Pu": {"uniform": [1.0, 2.0]}}},
        {},
        "sweep.vary.controller.K_Pu draws controller.K_Pu, and in an environment the controller",
    ),
    "limits of one axis": ({}, {"limits": 8.0}, r"limits are 8\.0; give .* as in limits=\(8"),
    "limits below 0": ({}, {"limits": (8.0, -2.5)}, r"limits are \(8\.0, -2\.5\); give"),
    "limits in words": ({}, {"limits": "ab"}, "limits are 'ab'; give"),
    "a path without a timetable": (
        {"path": {"kind": "legs", "points": [[0, 0], [20, 0], [20, 20]]}},
        {},
        "runs of this scenario do not gather 'iae' .* take e_ct_integral",
    ),
    "no period": ({"control.period": 0.0}, {}, "for how long does a demand hold"),
}


@pytest.mark.parametrize("make", [podusv.gym.Env, podusv.gym.VectorEnv])
@pytest.mark.parametrize("case", REFUSED)
def test_what_no_environment_can_be_made_of_is_a_sentence(make, case):
    changes, options, says = REFUSED[case]
    with pytest.raises(UsageError, match=says):
        make(SCENARIO, changes, **options)


@pytest.mark.parametrize("count", [0, -1, 2.0, "8"])
def test_a_count_of_environments_is_a_whole_number_from_one_on(count):
    with pytest.raises(UsageError, match=f"count is {count!r}; give a whole number from 1 on"):
        several(count)


def test_seeds_are_whole_numbers_from_0_on():
    env, many = single(), several(2)
    one, _ = env.reset(seed=np.int64(3))
    for seeds in (np.int64(3), [3, 4], np.array([3, 4])):
        np.testing.assert_array_equal(many.reset(seed=seeds)[0][0], one)
    for wrong in (-1, 1.5, "a"):
        says = f"the seed is {wrong!r}; give a whole number from 0 on"
        for made, seed in ((env, wrong), (many, wrong), (many, [0, wrong])):
            with pytest.raises(UsageError, match=says):
                made.reset(seed=seed)
    sobol = single(**{"sweep.design": "sobol"})
    with pytest.raises(UsageError, match="4294967296; Sobol' points have numbers up to"):
        sobol.reset(seed=2**32)


def test_a_run_that_ends_with_a_reward_beyond_all_numbers_is_terminated():
    """The square of a demand of 1e200 is infinite; those of other runs are not."""
    free = {"actuator": {"kind": "ideal"}, "vessel": {"preset": "paper"}}
    given: dict[str, Any] = {"reward": "effort_u", "limits": (1e300, 1e300)}
    one, many = (
        podusv.gym.Env(SCENARIO, free, **given),
        podusv.gym.VectorEnv(SCENARIO, free, count=2, **given),
    )
    one.reset(seed=0)
    many.reset(seed=0)
    assert one.step((1e200, 1e200))[1:4] == (-math.inf, True, False)
    _, gained, dead, cut, _ = many.step(np.array([[1e200, 1e200], [1.0, 1.0]]))
    assert (gained[0], list(dead), list(cut)) == (-math.inf, [True, False], [False, True])
    assert -1.0 < gained[1] < 0.0


def test_a_reward_that_is_not_defined_at_every_instant_is_a_sentence():
    for env, action in ((single, np.zeros(2)), (lambda: several(2), np.zeros((2, 2)))):
        made = env()
        made._task.metric = "settling_time"
        made.reset(seed=0)
        with pytest.raises(UsageError, match=r"settling_time is not defined at 0\.1 s; a reward"):
            made.step(action)


@pytest.mark.parametrize("reward", ["e_steady", "settling_time"])
def test_such_a_reward_is_refused_before_the_first_episode(reward):
    for make in (podusv.gym.Env, podusv.gym.VectorEnv):
        with pytest.raises(UsageError, match=rf"{reward} is not defined at 0\.1 s; a reward needs"):
            make(SCENARIO, reward=reward)


def test_gymnasium_makes_environments_by_name():
    """The same as the classes."""
    made = gymnasium.make("podusv/Scenario-v0", scenario=SCENARIO, reward="ise")
    own = podusv.gym.Env(SCENARIO, reward="ise")
    np.testing.assert_array_equal(made.reset(seed=4)[0], own.reset(seed=4)[0])
    one, other = made.step(np.array([3.0, 0.5])), own.step((3.0, 0.5))
    np.testing.assert_array_equal(one[0], other[0])
    assert one[1:] == other[1:]
    several = gymnasium.make_vec(
        "podusv/Scenario-v0", 3, vectorization_mode="vector_entry_point", scenario=SCENARIO
    )
    assert isinstance(several.unwrapped, podusv.gym.VectorEnv)
    assert several.num_envs == 3


@pytest.mark.long
def test_gymnasium_alone_finds_the_environment_by_module_and_name():
    """In a process that has imported nothing of podusv."""
    asked = (
        "import gymnasium\n"
        f"made = gymnasium.make('podusv.gym:podusv/Scenario-v0', scenario={SCENARIO!r})\n"
        "print(type(made.unwrapped).__name__)"
    )
    done = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True)
    assert done.stdout == "Env\n"


def test_a_name_for_a_task_that_is_there_needs_nothing_else():
    """It is `podusv:studies/learned.yaml`, and takes the options of any environment."""
    made = gymnasium.make("podusv.gym:podusv/Track-v0", reward="ise")
    own = podusv.gym.Env("podusv:studies/learned.yaml", period=0.2, reward="ise")
    np.testing.assert_array_equal(made.reset(seed=4)[0], own.reset(seed=4)[0])
    assert made.step(np.array([3.0, 0.5]))[1:] == own.step((3.0, 0.5))[1:]
    shorter = gymnasium.make("podusv/Track-v0", changes={"simulation.duration": 1.0}, period=0.5)
    shorter.reset()
    assert [shorter.step(np.zeros(2))[3] for _ in range(2)] == [False, True]
    name = {"vectorization_mode": "vector_entry_point"}
    assert gymnasium.make_vec("podusv/Track-v0", 3, **name).reset(seed=0)[0].shape == (3, 8)


# --- rewards and observations of one's own


def distance(now: podusv.gym.Moment) -> Any:
    return np.hypot(now.target[0] - now.state[0], now.target[1] - now.state[1])


def work(before: podusv.gym.Moment, now: podusv.gym.Moment) -> Any:
    """The distance over the period, and a little for turning and for a demand that changes."""
    change = ((now.demand - before.demand) ** 2).sum(axis=0)
    apart = 0.5 * (distance(before) + distance(now)) * (now.time - before.time)
    return -(apart + 0.1 * now.seen[4] ** 2 + 0.01 * change)


def view(now: podusv.gym.Moment) -> Any:
    return [distance(now), np.sin(now.seen[7]), now.demand[1], 1.0]


def test_the_trapezoid_of_the_distance_is_what_iae_grows_by():
    """At a period of a step; podusv's metric is the same sum."""
    given: dict[str, Any] = {"period": 0.01}

    def area(before, now):
        return -0.01 * 0.5 * (distance(before) + distance(now))

    own, usual = podusv.gym.Env(SCENARIO, reward=area, **given), podusv.gym.Env(SCENARIO, **given)
    for env in (own, usual):
        env.reset(seed=1)
    for _ in range(50):
        one, other = (env.step((4.0, 0.5))[1] for env in (own, usual))
        assert one == pytest.approx(other, rel=1e-9)


def test_a_moment_has_what_the_session_has():
    """Its arrays are copies, and the demand is that of the action before."""
    moments = []
    env = podusv.gym.Env(SCENARIO, observe=lambda now: moments.append(now) or [0.0])
    env.reset(seed=3)
    first, moments[:] = env.session.observe(), moments[-1:]
    env.step(np.array([3.0, -1.0]))
    for now, seen, demand in zip(
        moments, (first, env.session.observe()), ((0.0, 0.0), (3.0, -1.0)), strict=True
    ):
        assert now.time == seen.time
        np.testing.assert_array_equal(now.state, seen.state)
        np.testing.assert_array_equal(now.target, seen.target)
        np.testing.assert_array_equal(now.demand, demand)
    usual = single()
    np.testing.assert_array_equal(usual.reset(seed=3)[0], moments[0].seen)


def test_an_agent_may_work_in_the_observation_that_it_was_given():
    """As one that scales it in its place; the next reward is of what was seen."""
    given: dict[str, Any] = {"reward": lambda before, now: now.seen[0] - before.seen[0]}
    many = podusv.gym.VectorEnv(SCENARIO, count=1, **given)
    kept, scaled = podusv.gym.Env(SCENARIO, **given), podusv.gym.Env(SCENARIO, **given)
    seen, several = kept.reset(seed=1)[0], many.reset(seed=1)[0]
    own = scaled.reset(seed=1)[0]
    for _ in range(3):
        own *= 0.0
        several *= 0.0
        last, (seen, reward, *_) = seen[0], kept.step((1.0, 0.1))
        own, own_reward, *_ = scaled.step((1.0, 0.1))
        several, rewards, *_ = many.step(np.array([[1.0, 0.1]]))
        assert own_reward == rewards[0] == reward == seen[0] - last


def test_functions_of_one_s_own_have_the_same_bits_side_by_side():
    """Over the end of an episode: there nothing is gained, and no demand was there before."""
    given: dict[str, Any] = {"reward": work, "observe": view}
    many = podusv.gym.VectorEnv(SCENARIO, count=3, **given)
    ones = [podusv.gym.Env(SCENARIO, **given) for _ in range(3)]
    assert many.single_observation_space == ones[0].observation_space
    assert ones[0].observation_space.shape == (4,)
    seen, _ = many.reset(seed=0)
    np.testing.assert_array_equal(seen, [env.reset(seed=i)[0] for i, env in enumerate(ones)])
    random = np.random.default_rng(0)
    for _ in range(30):
        actions = random.normal(0.0, 1.0, (3, 2))
        seen, gained, _, cut, _ = many.step(actions)
        each = [env.step(action) for env, action in zip(ones, actions, strict=True)]
        np.testing.assert_array_equal(seen, [one[0] for one in each])
        np.testing.assert_array_equal(gained, [one[1] for one in each])
        np.testing.assert_array_equal(seen[:, 2], actions[:, 1])
        assert (seen[:, 3] == 1.0).all()
    assert cut.all()
    seen, gained, *_ = many.step(actions)
    assert not gained.any()
    assert not seen[:, 2].any()
    assert (many.step(actions)[1] < 0.0).all()


def test_a_terminated_run_gives_its_last_numbers_to_functions_of_one_s_own():
    free = {"actuator": {"kind": "ideal"}, "vessel": {"preset": "paper"}}
    given: dict[str, Any] = {
        "limits": (1e300, 1e300),
        "reward": lambda a, b: b.state[0] - a.state[0],
    }
    one, many = (
        podusv.gym.Env(SCENARIO, free, **given),
        podusv.gym.VectorEnv(SCENARIO, free, count=1, **given),
    )
    before, _ = one.reset(seed=0)
    many.reset(seed=0)
    seen, reward, dead, *_ = one.step((1e200, 1e200))
    np.testing.assert_array_equal(seen, before)
    assert (reward, dead) == (0.0, True)
    seen, rewards, deads, *_ = many.step(np.array([[1e200, 1e200]]))
    np.testing.assert_array_equal(seen[0], before)
    assert (rewards[0], deads[0]) == (0.0, True)


OWN: dict[str, tuple[dict[str, Any], str]] = {
    "no number": ({"reward": lambda a, b: "much"}, "reward gave 'much' at 0.1 s; give finite numb"),
    "nothing": ({"reward": lambda a, b: None}, "reward gave None at 0.1 s"),
    "not finite": ({"reward": lambda a, b: math.nan}, "reward gave nan at 0.1 s"),
    "several": ({"reward": lambda a, b: [1.0, 2.0]}, r"reward gave \[1.0, 2.0\] at 0.1 s"),
    "no list": ({"observe": lambda now: 3.0}, "observe gave 3.0; give a list of numbers"),
    "an empty list": ({"observe": lambda now: []}, r"observe gave \[\]; give a list"),
    "a list of words": ({"observe": lambda now: ["a"]}, "observe gave 'a' at 0 s; give finite"),
}


@pytest.mark.parametrize("make", [podusv.gym.Env, podusv.gym.VectorEnv])
@pytest.mark.parametrize("case", OWN)
def test_functions_that_give_no_numbers_are_a_sentence_before_the_first_episode(make, case):
    options, says = OWN[case]
    with pytest.raises(UsageError, match=says):
        make(SCENARIO, **options)


def test_a_function_for_one_run_alone_is_a_sentence_where_there_are_several():
    def reward(before, now):
        return np.ones(2) if np.size(now.time) > 1 else 0.0

    many = podusv.gym.VectorEnv(SCENARIO, count=3, reward=reward)
    many.reset(seed=0)
    with pytest.raises(UsageError, match="give finite numbers, or 3 of them"):
        many.step(np.zeros((3, 2)))


@pytest.mark.parametrize("reward", [None, 3, ["iae"]])
def test_a_reward_that_is_no_name_is_a_sentence(reward):
    with pytest.raises(UsageError, match="unknown reward"):
        podusv.gym.Env(SCENARIO, reward=reward)


def test_an_action_that_is_no_demand_is_a_sentence_and_nothing_is_lost():
    env, many = single(), several(2)
    with pytest.raises(UsageError, match="no episode has begun; call reset first"):
        env.step((0.0, 0.0))
    with pytest.raises(UsageError, match="no episode has begun; call reset first"):
        many.step(np.zeros((2, 2)))
    env.reset(seed=0)
    many.reset(seed=0)
    for wrong in ((math.nan, 0.0), (1.0,), "ab"):
        with pytest.raises(UsageError, match="give two finite numbers"):
            env.step(wrong)
    for wrong in (np.zeros(2), [[0.0], [0.0, 0.0]]):
        with pytest.raises(UsageError, match="give 2 rows of two finite numbers"):
            many.step(wrong)
    with pytest.raises(UsageError, match=r"environment 1 is \(nan, 0\.0\); give two"):
        many.step(np.array([[1.0, 0.2], [math.nan, 0.0]]))
    after, together = env.step((1.0, 0.2)), many.step(np.array([[1.0, 0.2], [0.0, 0.0]]))
    assert after[4] == {"time": PERIOD}
    np.testing.assert_array_equal(after[0], together[0][0])
    with pytest.raises(UsageError, match="3 seeds for 2 environments; give 2"):
        many.reset(seed=[1, 2, 3])


def test_what_cannot_march_side_by_side_is_a_sentence(monkeypatch):
    monkeypatch.setattr("podusv_cli.interface.gym.why_alone", lambda *given: "a part prints")
    with pytest.raises(UsageError, match=r"side by side \(a part prints\); take Gymnasium's SyncV"):
        several(2)


def test_a_drawn_network_and_the_environment_see_the_same(tmp_path):
    """The law inside a run and an agent outside: the same demands in the same observations."""
    law = Policy(content=content(drawn([8, 6, 2])))
    made = {"controllers": None, "controller": law.model_dump(exclude_none=True), "sweep": None}
    run = podusv.simulate({**SCENARIO, "sweep": None}, made)
    env = podusv.gym.Env({**SCENARIO, "sweep": None})
    env.reset()
    tau, work, k = np.zeros(2), np.zeros(law.workspace()), bundle(law.constants())
    for i in range(30):
        now = env.session.observe()
        call(law.law, x=now.state, target=now.target, k=k, table=law.table(), tau=tau, work=work)
        np.testing.assert_array_equal(tau, [run["tau_u_cmd"][10 * i], run["tau_r_cmd"][10 * i]])
        env.step(tau)


def test_the_page_runs_from_an_environment_to_a_network_in_a_scenario(tmp_path):
    text = (ROOT / "docs/learning.md").read_text()
    known: dict[str, Any] = {}
    for code in re.findall(r"```python\n(.*?)```", text, re.DOTALL):
        exec(code.replace("count=64", "count=8"), known)  # noqa: S102
    assert (tmp_path / "episode/log.h5").exists()
    for shown in re.findall(r"```yaml\n(.*?)```", text, re.DOTALL):
        changes = {"controllers": None, "simulation.duration": 1.0, **yaml.safe_load(shown)}
        loaded = podusv.load("podusv:laws/learned.yaml", changes)
        laws = [loaded.controller, *loaded.controllers.values()]
        assert any(law.kind == "policy" and law.content for law in laws)


def trapezoid(values: Any, step: float) -> float:
    return step * float(values.sum() - 0.5 * (values[0] + values[-1]))


@pytest.mark.parametrize(
    ("period", "duration"), [(0.2, 0.6), (0.2, 0.53), (0.07, 0.53), (0.01, 0.05)]
)
def test_a_reward_is_what_the_metric_grows_by_in_the_interval_of_its_action(period, duration):
    """The integral of z_e, and the largest force, over each interval of the log by themselves."""
    changes = {"control.period": period, "simulation.duration": duration, "log.every": 1}
    for reward in ("iae", "peak_tau_u"):
        given: dict[str, Any] = {"reward": reward}
        env, many = (
            podusv.gym.Env(SCENARIO, changes, **given),
            podusv.gym.VectorEnv(SCENARIO, changes, **given),
        )
        env.reset(seed=2)
        many.reset(seed=[2, *range(7)])
        random, gained, over = np.random.default_rng(1), [], False
        while not over:
            action = random.normal(0.0, 1.0, 2)
            _, reward_now, _, over, _ = env.step(action)
            _, together, _, cut, _ = many.step(np.tile(action, (8, 1)))
            assert (together[0], cut[0]) == (reward_now, over)
            gained.append(reward_now)
        run = env.session.close(f"{reward}_{period}_{duration}", figures=False)
        assert -sum(gained) == pytest.approx(run.metrics[reward], rel=1e-12)
        assert len(gained) == math.ceil(duration / period - 1e-9)
        if reward == "iae":
            every = round(period / 0.01)
            own = [run["z_e"][k : k + every + 1] for k in range(0, round(duration / 0.01), every)]
            assert gained == pytest.approx([-trapezoid(part, 0.01) for part in own], rel=1e-9)


def test_the_first_action_costs():
    """At a period of one step, too; the force of surge acts from the first instant on."""
    given: dict[str, Any] = {"reward": "effort_u", "period": 0.01}
    env = podusv.gym.Env(SCENARIO, **given)
    env.reset(seed=0)
    first, second = (env.step((2.0, 0.0))[1] for _ in range(2))
    assert first == pytest.approx(second) == pytest.approx(-0.01 * 2.0**2)


def metres_a_second(before: podusv.gym.Moment, now: podusv.gym.Moment) -> Any:
    """A reward over the time that has passed, which is none where a run is over."""
    return (now.state[0] - before.state[0]) / (now.time - before.time)


def asked_for(before: podusv.gym.Moment, now: podusv.gym.Moment) -> Any:
    """What was demanded, and when."""
    return now.demand[0] + now.time


@pytest.mark.filterwarnings("error")
def test_a_reward_over_the_time_that_passed_goes_on_where_episodes_end():
    many = podusv.gym.VectorEnv(SCENARIO, count=3, reward=metres_a_second)
    many.reset(seed=0)
    ends = 0
    for _ in range(70):  # episodes of 30 periods, and a step in which the next one begins
        _, gained, _, cut, info = many.step(np.ones((3, 2)))
        ends += cut.all()
        assert ((gained == 0.0) == (info["time"] == 0.0)).all()
    assert ends == 2


OF_DEAD = ("iae", "energy", metres_a_second, asked_for, lambda a, b: 1.0 / (b.time - a.time))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("reward", OF_DEAD)
@pytest.mark.parametrize(
    ("demand", "after"), [(1e200, 0.21), (1e9, 0.22), (1e5, 0.24), (3e4, 0.27)]
)
def test_a_run_that_is_terminated_late_has_time_and_reward_of_a_single_one(reward, demand, after):
    """It ends within a period; the times are of the single one before it had lanes beside it."""
    free = {"actuator": {"kind": "ideal"}, "vessel": {"preset": "paper"}}
    given: dict[str, Any] = {"limits": (1e300, 1e300), "reward": reward, "period": PERIOD}
    given["observe"] = lambda now: [now.time, *now.demand, *now.state]
    one = podusv.gym.Env(SCENARIO, free, **given)
    many = podusv.gym.VectorEnv(SCENARIO, free, count=2, **given)
    one.reset(seed=0)
    many.reset(seed=0)
    for action in ((1.0, 0.1), (1.0, 0.1), (demand, demand)):
        seen, gained, dead, cut, info = one.step(action)
        each, rewards, deads, cuts, infos = many.step(np.array([action, (1.0, 0.1)]))
        assert (gained, dead, cut) == (rewards[0], deads[0], cuts[0])
        np.testing.assert_array_equal(each[0], seen)
        assert infos["time"][0] == info["time"]
    assert (dead, cuts[1]) == (True, True)
    assert info["time"] == pytest.approx(after)
    assert infos["time"][1] == pytest.approx(0.3)  # the other one went on
    assert (seen[0], seen[1]) == (pytest.approx(0.2), 1.0)  # the last numbers that were


def test_a_count_in_the_place_of_changes_is_a_sentence():
    with pytest.raises(UsageError, match=r"3 stands for `changes`; write count=3$"):
        podusv.gym.VectorEnv(SCENARIO, 3)
    for wrong in (3, "start.x=1.0"):
        with pytest.raises(UsageError, match="give a dictionary of dotted keys and values"):
            podusv.gym.Env(SCENARIO, wrong)


def test_an_environment_is_pickled_as_it_is_before_its_first_episode():
    given: dict[str, Any] = {"period": 0.2, "reward": metres_a_second, "limits": (7.0, 1.5)}
    one = podusv.gym.Env(SCENARIO, {"start.y": 1.25}, **given)
    many = podusv.gym.VectorEnv(SCENARIO, {"start.y": 1.25}, count=3, **given)
    one.reset(seed=5)
    again, others = pickle.loads(pickle.dumps((one, many)))
    with pytest.raises(UsageError, match="no episode has begun"):
        again.step((1.0, 0.1))
    assert (others.num_envs, again.action_space) == (3, one.action_space)
    for env in (one, again):
        env.reset(seed=2)
    for env in (many, others):
        env.reset(seed=2)
    answers = [env.step((1.0, 0.1)) for env in (one, again)]
    np.testing.assert_array_equal(answers[0][0], answers[1][0])
    assert answers[0][1:] == answers[1][1:]
    for a, b in zip(*(env.step(np.ones((3, 2))) for env in (many, others)), strict=True):
        np.testing.assert_equal(a, b)
