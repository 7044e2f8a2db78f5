"""docs/tuning.md has the tables and numbers that its recipe makes of the committed searches."""

import runpy

from command_samples import ROOT


def test_the_page_is_as_its_recipe_fills_it():
    page = (ROOT / "docs/tuning.md").read_text()
    assert runpy.run_path(str(ROOT / "examples/reproduce/tuning.py"))["filled"](page) == page
