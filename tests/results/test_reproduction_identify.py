"""The recipe of results/identify.md counts sets as the page says."""

import pandas as pd
import pytest
from recipe_samples import load_recipe

RECIPE = load_recipe("identify_coverage")


def test_sets_without_a_hull_and_those_that_did_not_settle_count():
    determined = {"what": "number", "determined": True, "refused": False}
    made = pd.DataFrame(
        [
            {"number": 0, "holds": True, "off": 1.0, "settled": True, **determined},
            {"number": 0, "holds": True, "off": -1.0, "settled": True, **determined},
            {"number": 1, "holds": False, "off": 4.0, "settled": False, **determined},
            {"number": 1, "holds": False, "off": 9.0, "settled": False, **determined}
            | {"determined": False},
            {"number": 2, "what": "none"},
        ]
    )
    counts = RECIPE["count_held"](made)
    assert (counts["sets"], counts["none"], counts["unsettled"], counts["refused"]) == (3, 1, 1, 0)
    assert counts["determined"] == 3
    assert counts["held"] == pytest.approx(200.0 / 3.0)
    assert counts["rms"] == pytest.approx(6.0**0.5)  # of 1, 1 and 16
