"""The recipes that fill pages in, as tests call them."""

import runpy
import sys
from typing import Any

from command_samples import ROOT

RECIPES = ROOT / "examples" / "reproduce"


def load_recipe(name: str) -> dict[str, Any]:
    """The names that a recipe defines; it finds its neighbours as when it is run."""
    sys.path.insert(0, str(RECIPES))
    try:
        return runpy.run_path(str(RECIPES / f"{name}.py"))
    finally:
        sys.path.remove(str(RECIPES))
