"""Which files may be somebody else's: those in the folder of a run, study or search."""

from __future__ import annotations

import os
from pathlib import Path

FINISHED = ("manifest.json", "study.json", "tune.json")  # folders of podusv have one of these


def in_folder(source: str) -> bool:
    """Whether a file is anywhere in the folder of a run, study or search, or a link leads there."""
    place, origin = Path(os.path.abspath(source)), Path(os.path.realpath(source))
    above = {place, *place.parents, origin, *origin.parents}
    return any(os.path.lexists(folder / name) for folder in above for name in FINISHED)
