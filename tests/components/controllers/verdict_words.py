"""Verdicts of `claims.json` and of a comparison's table in the words of the pages."""

from collections.abc import Mapping
from typing import Any

from podusv_cli.expressions.verdict import ANSWERS, OF_OWN, OWN


def in_words(claim: Mapping[str, Any]) -> str:
    """Reproduced or not for what was published, holds or fails for what is ours."""
    answer = {word: answer for answer, word in ANSWERS.items()}[claim["verdict"]]
    return OF_OWN[answer] if claim["source"].startswith(OWN) else ANSWERS[answer]
