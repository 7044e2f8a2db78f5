"""How turns are searched for: planted judges, draws, and the numbers that claims compare."""

import ast
import math

import numpy as np
import pytest

from podusv_cli.comparison.expressions import Evaluation
from podusv_cli.doubt.alone import SHARP, explore_choice
from podusv_cli.doubt.choices import Choice
from podusv_cli.doubt.compared import compared_numbers
from podusv_cli.doubt.judged import Judged
from podusv_cli.doubt.ranges import DoubtRange
from podusv_cli.doubt.together import draw_worlds, explain_turns
from podusv_cli.scenario.distributions import Distribution
from podusv_cli.scenario.sweep import Quantity


def moving(own=1.0, name="k"):
    quantity = Quantity(times=Distribution(log_uniform=(0.25, 4.0)))
    return Choice(
        name, (("a", ("controller", name)),), own, range=DoubtRange(quantity, quantity, own)
    )


def by(rule):
    """A judge of one claim about one number."""

    def judge(world):
        number = next(iter(world.values()), 1.0)
        return Judged({"C": bool(rule(number))}, {"C": {"k": number}})

    return judge


@pytest.mark.parametrize("place", [3.3, 1.04, 1.0 + 3e-5, 0.9997, 0.31])
def test_the_place_is_bracketed_however_near(place):
    judge = by(lambda k: (k < place) is (place > 1.0))
    (turn,) = explore_choice(moving(), judge, judge({}), {"C": []}).turns("C", judge({}))
    assert abs(turn.held - 1.0) < abs(place - 1.0) * (1 + 1e-12)
    assert abs(turn.value - 1.0) >= abs(place - 1.0) * (1 - 1e-12)
    assert turn.distance <= SHARP * abs(turn.held - 1.0) * (1 + 1e-9)


def test_a_verdict_that_the_last_digit_turns():
    judge = by(lambda k: k == 1.0)
    turns = explore_choice(moving(), judge, judge({}), {"C": []}).turns("C", judge({}))
    assert [turn.by_rounding for turn in turns] == [True, True]
    assert {turn.value for turn in turns} == {1.0 + math.ulp(1.0), 1.0 - math.ulp(1.0)}


def test_a_verdict_that_turns_back_is_seen_at_a_tenth_of_the_range():
    judge = by(lambda k: not 1.2 < k < 1.4)
    (turn,) = explore_choice(moving(), judge, judge({}), {"C": []}).turns("C", judge({}))
    assert 1.2 < turn.value < 1.2 * SHARP + 0.01


def of_distance(law, edge=0.1):
    """A judge whose number is a law of k, above an edge at k = 1; and what was tried."""
    tried = []

    def judge(world):
        k = next(iter(world.values()), 1.0)
        tried.append(k)
        return Judged({"C": law(k) > edge}, {"C": {"k": law(k)}})

    numbers = {"C": compared_numbers(f"k > {edge}")}
    return explore_choice(moving(), judge, judge({}), numbers), judge({}), tried


@pytest.mark.parametrize("at", [2.87, 1.41, 0.44])
@pytest.mark.parametrize("power", [0.25, 0.5, 1.0, 2.0])
def test_a_window_of_a_hundredth_of_the_range_is_found_by_the_number_that_falls(at, power):
    """A start that cancels a mode: the number vanishes there, and is under 0.1 for 0.03 only."""
    half = 0.015 if at > 1.0 else 0.004
    alone, base, tried = of_distance(lambda k: 0.1 * (abs(k - at) / half) ** power)
    (turn,) = alone.turns("C", base)
    nearest = at - math.copysign(half, at - 1.0)
    assert abs(turn.held - 1.0) < abs(nearest - 1.0) <= abs(turn.value - 1.0)
    assert abs(turn.value - at) < half
    assert len(tried) < 2 + 16 + 3 * 12


def test_many_claims_that_fall_at_one_place_look_there_once_each():
    """A bracket that the claims before have narrowed would have no width."""
    claims = [f"C{n}" for n in range(20)]

    def judge(world):
        number = 0.1 + abs(next(iter(world.values()), 1.0) - 1.41)
        return Judged(dict.fromkeys(claims, True), {claim: {"k": number} for claim in claims})

    alone = explore_choice(
        moving(), judge, judge({}), dict.fromkeys(claims, compared_numbers("k > 0.1"))
    )
    assert not alone.turns("C3", judge({}))
    assert len(alone.trials) < 2 + 16 + 2 * 12


def test_a_number_that_falls_and_cannot_reach_its_edge_costs_few_tries():
    alone, base, tried = of_distance(lambda k: 0.5 + (k - 2.87) ** 2)
    assert not alone.turns("C", base)
    assert len(tried) <= 2 + 16 + 2


def test_a_number_that_does_not_act_is_tried_at_its_ends_and_half_way_alone():
    tried = []

    def judge(world):
        tried.append(world)
        return Judged({"C": True}, {"C": {"k": 7.0}})

    alone = explore_choice(moving(), judge, judge({}), {"C": []})
    assert len(tried) == 1 + 4
    assert not alone.acts("C", judge({}))


def planted(rule, count=300):
    names = ("a", "b", "c")
    draws = draw_worlds([moving(name=name) for name in names], 1, count)
    turned = np.array([rule(dict(zip(names, u, strict=True))) for u in draws.shares])
    return explain_turns(draws, turned, np.ones(count, bool), dict.fromkeys(names, True))


def test_the_choice_that_turns_draws_is_named():
    first, *_ = planted(lambda u: u["b"] > 0.7)
    assert (first.choice.name, first.part) == ("b", "above")
    assert first.outside == 0.0
    assert first.inside == pytest.approx(0.6, abs=0.1)
    first, *_ = planted(lambda u: abs(u["c"] - 0.5) > 0.4)
    assert (first.choice.name, first.part) == ("c", "far from")


def test_chance_explains_nothing():
    random = np.random.default_rng(3)
    wrongly = sum(bool(planted(lambda u: random.random() < 0.2)) for _ in range(40))
    assert wrongly <= 6  # of 40 at 5 %: 7 or more with a chance of 0.5 %


def test_a_draw_depends_on_its_name_and_index_alone():
    few, many = (
        draw_worlds([moving(name="b")], 1, 5),
        draw_worlds([moving(name="a"), moving(name="b")], 1, 9),
    )
    assert (few.shares[:, 0] == many.shares[:5, 1]).all()
    assert [v[0] for v in few.values] == [v[1] for v in many.values[:5]]


# ---- the numbers that a claim compares ----


def test_the_numbers_of_a_claim_with_their_limits():
    assert compared_numbers("max(a.x) <= 0.1 and -3 > a.e") == [
        ("max(a.x)", "", (0.1,), False),
        ("a.e", "", (-3.0,), True),
    ]
    assert compared_numbers("1 < a.e < b.e") == [
        ("a.e", "", (1.0,), True),
        ("a.e", "b.e", (1.0,), True),
    ]
    (ratio,) = compared_numbers("not b.iae > 2 * a.iae")
    assert ratio == ("b.iae", "2 * a.iae", (1.0,), True)
    assert ratio.of({"b.iae": 3.0, "2 * a.iae": 4.0}) == 0.75
    assert math.isnan(ratio.of({"b.iae": 3.0}))
    assert compared_numbers("finished(a)")[0].of({"finished(a)": 1.0}) == 1.0


class Numbered:
    """A run of one metric, as far as claims ask."""

    until, every, ending = math.inf, 1, ""

    def __init__(self, number):
        self.number = number

    def metric(self, name):
        return self.number


@pytest.mark.parametrize(
    ("expect", "edges"),
    [
        ("a.iae <= 4", (4.4,)),
        ("4 <= a.iae", (4.0 / 1.1,)),
        ("a.iae >= 4", (3.6,)),
        ("4 == a.iae", (4.0 / 0.9, 4.0 / 1.1)),
        ("a.iae < 4", (3.6, 4.0 / 0.9)),
        ("a.iae > -4", (-3.6, -4.0 / 0.9)),
        ("4 > a.iae", (4.0 / 0.9, 3.6)),
        ("a.iae < b.iae", (0.9, 1.0 / 0.9)),
        ("a.iae == 4", (3.6, 4.4)),
        ("a.iae == b.iae", (0.9, 1.1)),
        ("a.iae <= b.iae", (1.1,)),
    ],
)
def test_a_number_turns_where_the_verdict_on_the_claim_does(expect, edges):
    """As the claims' own judge has it, a little to both sides of each edge."""
    (number,) = compared_numbers(expect, 0.1)
    scale = 5.0 if number.right else 1.0
    for edge in number.edges:
        runs = [{"a": Numbered(scale * edge * f), "b": Numbered(5.0)} for f in (0.999, 1.001)]
        answers = [Evaluation(run, 0.1).holds(ast.parse(expect, mode="eval").body) for run in runs]
        assert len({*answers}) == 2, (edge, answers)
        assert number.between is (None in answers)
    assert number.edges == pytest.approx(edges)


def test_a_strict_comparison_turns_beyond_the_edge_where_it_can_tell_again():
    (number,) = compared_numbers("a.e < 4", 0.1)
    assert number.turning({"a.e": 1.0}) == (4.0 / 0.9,)
    assert number.turning({"a.e": 9.0}) == (3.6,)
    (equal,) = compared_numbers("a.e == 4", 0.1)
    assert equal.turning({"a.e": 4.0}) == pytest.approx((3.6, 4.4))


def test_what_keeps_a_verdict_is_no_value_that_leaves_it_open():
    def judge(world):
        k = next(iter(world.values()), 1.0)
        return Judged({"C": None if 1.3 < k < 2.0 else k <= 1.3}, {"C": {"k": k}})

    (turn,) = explore_choice(moving(), judge, judge({}), {"C": []}).turns("C", judge({}))
    assert turn.value == pytest.approx(2.0, rel=SHARP - 1.0)
    assert turn.held <= 1.3


def test_the_margin_is_counted_in_half_widths_of_the_draws():
    (number,) = compared_numbers("a.e <= 0.5")
    worlds = [Judged({}, {"C": {"a.e": x}}) for x in np.linspace(0.0, 1.0, 101)]
    spread = number.spread("C", [*worlds, Judged({}, {}, "no such world")])
    assert spread == pytest.approx((0.05, 0.5, 0.95))
    assert number.margin({"a.e": 0.2}, spread) == pytest.approx(0.3 / 0.45)
    assert number.margin({"a.e": 0.2}, (0.2, 0.2, 0.2)) == math.inf
    (equal,) = compared_numbers("a.e == 0.5", 0.1)
    assert equal.margin({"a.e": 0.5}, spread) == pytest.approx(0.05 / 0.45)
