"""What is doubtful about a hull from logs, a sentence each; and why it is refused."""

from __future__ import annotations

import math

from podusv_cli.identify.answer import Identification, Whiteness
from podusv_cli.identify.fit.march import DEAD_BAND, DELAY, EXPONENT, THRUST
from podusv_cli.identify.judge import scores_worse_than_prior

FAR = 3.0  # prior standard deviations, beyond which a number contradicts what was known
LARGE = 2.0  # prior standard deviations, beyond which a noise or a walk has taken up something else
ALIKE = 0.2  # correlation of an innovation with the one before, from which on it is said
CHANCE = 4.0  # over the root of their number: a correlation that white innovations hardly have
NAMED = 4  # of them
SENSOR = (
    "the sensor is off by more than its values differ from one to the next, as where it wanders or "
    "its clock is off"
)
ACCELERATION = (
    "the motion has accelerations that neither hull nor load explains, as where the commands are "
    "not what the actuator did"
)
LOAD = "the filter puts the motion on loads, as where positions wander, thrust is wrong or it blows"
# What a noise or a walk that is far larger than was known before says.
MEANINGS = {
    "sigma": SENSOR,
    **dict.fromkeys(("q_u", "q_v", "q_r"), ACCELERATION),
    **dict.fromkeys(("q_b", "q_b_psi"), LOAD),
}


SOUGHT = {
    THRUST: "thrust over what the actuator's numbers give is",
    DEAD_BAND: "dead band of the thrust, a part of full n, is",
    EXPONENT: "exponent of the thrust over n, 2 being that of the actuator's numbers, is",
}


def list_doubts(answer: Identification) -> list[str]:
    """All that is doubtful about the numbers that were found."""
    kinds = (thrust_words, early_words, far_words, loud_words, correlation_words, worse_words)
    return [line for words in kinds for line in words(answer)]


def refusal(answer: Identification) -> str:
    """Why the hull is written with --force alone; "" where nothing speaks against it."""
    if not answer.refused_by:
        return ""
    s, prior = max(answer.refused_by, key=lambda pair: pair[0].position / pair[1].position)
    after = "along it" if math.isinf(s.horizon) else f"after {s.horizon:g} s"
    return (
        f"{s.log}: the hull is no improvement. {after[0].upper()}{after[1:]} the rms position "
        f"error is {s.position:.2g} m with the hull from the logs and {prior.position:.2g} m with "
        "the vessel as it was given. It is kept as refused.yaml; --force writes it as "
        "identified.yaml."
    )


def loud_words(answer: Identification) -> list[str]:
    """A sentence for each noise or walk that is far larger than was known before."""
    lines = []
    for p, number, y in zip(
        answer.parameters, answer.problem.numbers, answer.estimate.y, strict=True
    ):
        meaning = MEANINGS.get(p.name.partition("_")[0], MEANINGS.get(p.name))
        if meaning and number.ratio and y > LARGE:
            lines.append(
                f"{p.name} is {p.value:.3g}, {p.value / p.prior:.3g} times what was known before "
                f"({y:.2g} prior standard deviations): {meaning}. Forces and inertia may be wrong "
                "by more than their intervals say."
            )
    return lines


def correlation_words(answer: Identification) -> list[str]:
    """A sentence where a sensor's innovations along a log are alike from one to the next."""
    alike = sorted(filter(_is_alike, answer.whiteness), key=lambda w: -abs(w.correlation))
    if not alike:
        return []
    named = [f"{w.measured} of {w.log} {w.correlation:.2g}" for w in alike[:NAMED]]
    more = f" and {len(alike) - NAMED} more" if len(alike) > NAMED else ""
    return [
        "innovations have a correlation with the one before, where 0 means that nothing is left to "
        f"explain: {', '.join(named)}{more}. Model or noise is not right there, and intervals may "
        "be too narrow."
    ]


def _is_alike(w: Whiteness) -> bool:
    """Whether innovations are correlated by more than chance makes them."""
    return abs(w.correlation) > max(ALIKE, CHANCE / math.sqrt(w.count))


def worse_words(answer: Identification) -> list[str]:
    """A sentence for each log that was not fitted and that the prior predicts better."""
    worse = scores_worse_than_prior([s for s in answer.scores if s.role == "judge"])
    return [
        f"{name}: the vessel as it was given predicts this log better than the one from the logs; "
        "do not take that one before you know why (the logs determine too little, or disagree)"
        for name in dict.fromkeys(own.log for own, _ in worse)
    ]


def thrust_words(answer: Identification) -> list[str]:
    """A sentence where thrust was looked for, since a hull has no place for it."""
    said = [
        f"{SOUGHT[p.name]} {p.value:.4g} ({p.low:.4g} to {p.high:.4g})"
        for p in answer.parameters
        if p.name in SOUGHT
    ]
    if not said:
        return []
    use = (
        "beside it take the actuator that is written with it, which has that thrust"
        if answer.actuator
        else "the actuator's kind has no place for it, so its loads have to be changed likewise"
    )
    return [
        f"{'; '.join(said)}. The hull is right with that thrust alone: {use}. Draws of "
        "posterior.csv with another factor on the thrust are scaled to move as they would under "
        "it; none draws another curve."
    ]


def early_words(answer: Identification) -> list[str]:
    """A sentence where commands act before the log says that they were given, for certain.

    A command that is held from row to row, and in truth goes on changing, is half a row late there.
    """
    return [
        f"delay is {p.value:.2g} s ({p.low:.2g} to {p.high:.2g}): the boat moves before its "
        "commands. Half the distance of rows comes from commands that change between the rows of a "
        "log, and the fit takes that out; more is a clock that is off. Log commands more often, or "
        "log what the actuator did: with rows of five lags inertia came out 3 % off, outside its "
        "interval, and with rows of two lags within 0.6 %."
        for p in answer.parameters
        if p.name == DELAY and p.high < 0.0
    ]


def far_words(answer: Identification) -> list[str]:
    """A sentence where numbers end far from what was known before: the vessel is another one."""
    far = [
        f"{p.name} {p.value:.4g} (before {p.prior:.4g})"
        for p, y in zip(answer.parameters, answer.estimate.y, strict=True)
        if abs(y) > FAR and p.name in {number.name for number in answer.problem.hull}
    ]
    if not far:
        return []
    return [
        f"{len(far)} numbers are more than {FAR:g} standard deviations from what was known before: "
        f"{', '.join(far)}. Is the vessel's preset of another size, or the thrust in another unit? "
        "With a prior so far off the intervals are too narrow; give the vessel numbers nearer to "
        "these."
    ]
