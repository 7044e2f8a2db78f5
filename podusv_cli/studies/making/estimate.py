"""Whether a study fits on the disk and into memory, before its first run."""

from __future__ import annotations

import math
from pathlib import Path

from podusv_cli.core.errors import StorageError
from podusv_cli.core.quantities import bytes_in_words
from podusv_cli.core.system import physical_memory
from podusv_cli.storage.run_folder import check_free_space
from podusv_cli.studies.making import runs_writer
from podusv_cli.studies.making.plan import StudyPlan

HELD_BYTES = 32  # of a run in memory while tables are made: four numbers


def check_fits(plan: StudyPlan, folder: Path, parts: int = 1) -> None:
    """Raise StorageError where the runs surely fit neither the disk nor the memory.

    The table of the runs is on the disk, divided into `parts` folders; a few numbers a run are in
    memory.
    """
    shape = (len(plan.laws), len(plan.cells), plan.sweep.draws)
    runs, size = math.prod(shape), f"{math.prod(shape):,} runs (sweep.draws: {shape[2]:,})"
    fewer = (
        f"{size} were asked for; ask for fewer draws, or name a folder on a larger disk with --out"
    )
    table = runs_writer.bytes_of(shape, len(plan.metrics), len(plan.sweep.vary))
    check_free_space(folder, table / parts, fewer)
    memory = physical_memory()
    if (held := HELD_BYTES * runs) > memory:
        raise StorageError(
            f"cannot make {folder}: its tables take {bytes_in_words(held)} of memory or more, and "
            f"this machine has {bytes_in_words(memory)}; {size} were asked for; ask for fewer draws"
        )
