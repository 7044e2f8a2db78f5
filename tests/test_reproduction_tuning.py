"""The page of tuned laws says what the committed searches and judgements say."""

import math

import pandas as pd
import pytest
from command_samples import ROOT

FOLDER = ROOT / "results/tuning"
WORDS = " ".join((ROOT / "results/tuning.md").read_text().split())
JUDGED = {
    name: pd.read_csv(FOLDER / "judged" / name / "laws.csv").set_index("law")
    for name in ("fresh", "cybership2", "otter")
}


def apart(folder):
    """How many pairs of laws are apart, and of how many."""
    pairs = pd.read_csv(FOLDER / folder / "searches.csv")
    return int(((pairs.ratio_high < 1.0) | (pairs.ratio_low > 1.0)).sum()), len(pairs)


@pytest.mark.parametrize("folder", ["hull", "network"])
def test_the_page_has_the_searches(folder):
    gains = pd.read_csv(FOLDER / folder / "gains.csv").groupby("law").size()
    for law in pd.read_csv(FOLDER / folder / "laws.csv").itertuples():
        before, low, high = (
            law.objective_before,
            law.objective_before_low,
            law.objective_before_high,
        )
        assert (
            f"| {law.law} | {gains[law.law]} | {law.place_low} to {law.place_high} | {before:.0f} "
            f"[{low:.0f}, {high:.0f}] | {law.repeats_median:.0f} ({law.repeats_low:.0f} to "
            f"{law.repeats_high:.0f}) |"
        ) in WORDS


def error(number):
    return f"{number:.0f}" if math.isfinite(number) else "fails"


@pytest.mark.parametrize("hull", ["cybership2", "otter"])
def test_the_page_has_the_judgements(hull):
    for law in JUDGED[hull].itertuples():
        failed, most = 100.0 * law.failed_after, 100.0 * law.failed_after_high
        assert (
            f"| {law.Index} | {law.place_low} to {law.place_high} | {100 * law.failed_before:.1f}, "
            f"{failed:.1f} ({100 * law.failed_after_low:.1f} to {most:.1f}) | {law.before:.0f} "
            f"[{law.before_low:.0f}, {law.before_high:.0f}] | {error(law.after)} "
            f"({error(law.after_low)} to {error(law.after_high)}) | {law.held_after} of 20 |"
        ) in WORDS


def ratio(law):
    if not math.isfinite(law.ratio_high):
        return f"{law.ratio:.2f}, open"
    text = f"{law.ratio:.2f} [{law.ratio_low:.2f}, {law.ratio_high:.2f}]"
    return f"**{text}**" if law.ratio_low > 1.0 or law.ratio_high < 1.0 else text


def test_the_page_has_the_ratios_of_after_over_before():
    for law in JUDGED["fresh"].index:
        cells = " | ".join(ratio(table.loc[law]) for table in JUDGED.values())
        assert f"| {law} | {cells} |" in WORDS


def test_the_page_counts_pairs_and_limits_as_the_tables_have_them():
    (hull, every), (network, _) = apart("hull"), apart("network")
    assert (hull, every, network) == (10, 91, 0)
    assert "Ten of 91 pairs are apart" in WORDS
    assert f"On CyberShip II {apart('judged/cybership2')[0]} of 91 pairs are apart" in WORDS
    fresh, otter = apart("judged/fresh")[0], apart("judged/otter")[0]
    assert f"searched hulls it is {fresh} pairs, three of them" in WORDS
    assert f"on the Otter {otter}, six of them" in WORDS
    held = {hull: table.held_after.sum() for hull, table in JUDGED.items()}
    assert f"{held['cybership2']} of the 280 sets hold all of them there" in WORDS
    assert f"searched hulls {held['fresh']} of 280 sets do" in WORDS
    assert f"in proportion to its forces, {held['otter']}." in WORDS
