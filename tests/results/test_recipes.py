"""Pages have the tables and numbers that their recipes make of the committed tables."""

from functools import cache
from pathlib import Path

import pytest
from recipe_samples import load_recipe

RECIPES = ("tuning", "bench", "studies", "identify_coverage")
load = cache(load_recipe)


@pytest.mark.parametrize("name", RECIPES)
def test_a_page_is_as_its_recipe_fills_it(name: str) -> None:
    page = Path(load(name)["PAGE"]).read_text()
    assert load(name)["filled"](page) == page


@pytest.mark.long
@pytest.mark.parametrize("name", ["tuning", "bench"])
def test_every_number_of_a_sentence_that_was_changed_is_put_right(name: str) -> None:
    recipe = load(name)
    page = Path(recipe["PAGE"]).read_text()
    wrong = [(words, *["777"] * len(numbers)) for words, *numbers in recipe["sentences"]()]
    changed = recipe["with_numbers"](page, wrong)
    assert changed.count("777") - page.count("777") >= sum(len(numbers) for _, *numbers in wrong)
    assert recipe["filled"](changed) == page


def test_a_sentence_that_is_not_on_the_page_is_named() -> None:
    with pytest.raises(SystemExit, match=r"no sentence like: it fails in \{\}"):
        load("bench")["with_numbers"]("All is well.", [("it fails in {}", 3)])
