"""The logic that all languages of claims share: yes, no and unknown, for one run or for many."""

from __future__ import annotations

import ast

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from podusv_cli.expressions.walk import Condition, Logic

ANSWERS = [True, False, None]
NAMES = {f"c{i}": answer for i, answer in enumerate(ANSWERS)}
TEXTS = st.recursive(
    st.sampled_from([*NAMES, "each"]),
    lambda inner: (
        inner.map("not ({})".format) | st.tuples(inner, inner).map("({0[0]}) and ({0[1]})".format)
    ),
)


class Named(Logic):
    """Conditions by name: `each` has all three answers, in three runs."""

    def comparison(self, node):
        raise AssertionError("no text has one")

    def property(self, node):
        return Condition.of(ANSWERS if node.id == "each" else [NAMES[node.id]])


def by_hand(node: ast.expr, run: int) -> bool | None:
    """Kleene's logic, where unknown lies between no and yes."""
    order = [False, None, True]
    match node:
        case ast.UnaryOp(operand=part):
            return order[2 - order.index(by_hand(part, run))]
        case ast.BoolOp(values=parts):
            return order[min(order.index(by_hand(part, run)) for part in parts)]
    return ANSWERS[run] if node.id == "each" else NAMES[node.id]


@given(TEXTS)
def test_every_run_has_the_answer_of_a_logic_of_three_values(text):
    tree = ast.parse(text, mode="eval").body
    found = Named().condition(tree)
    answers = found.answers() if np.size(found.yes) > 1 else found.answers() * len(ANSWERS)
    assert answers == [by_hand(tree, run) for run in range(len(ANSWERS))]
