"""Whether an exported law does, sample by sample, what it did in podusv's own run."""

from __future__ import annotations

import csv
import ctypes
import struct
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from zipfile import BadZipFile

import numpy as np

from podusv_cli.core.errors import UsageError
from podusv_cli.core.kernel import Vector
from podusv_cli.export.link import shared_library, this_machine
from podusv_cli.export.objects import PLATFORMS
from podusv_cli.storage import json_files

PARTS = ("inputs", "demand", "signals", "memory")  # of law.json, in the order of the columns
SAMPLES, ABOUT, FMU = "check.csv", "law.json", "law.fmu"
STATE, TARGET, LOADS = 6, 6, 3
Step = Callable[[Vector], Sequence[float]]  # from time and inputs of a sample to what comes out


@dataclass(frozen=True)
class Checked:
    """How many samples of an exported law were stepped, and the first that came out otherwise.

    `whose` are the bits that it was held against.
    """

    what: str
    samples: int
    whose: str
    differs: str = ""


def check(folder: Path) -> list[Checked]:
    """Step the library that the folder's files make, and its FMU where FMPy is installed.

    This executes code of the folder. Raises UsageError where it is no export, and without a
    compiler for this machine.
    """
    if not (folder / ABOUT).is_file():
        raise UsageError(
            f"{folder} is no exported law: it has no {ABOUT}; make one with podusv export"
        )
    about, names, samples = _read(folder)
    found, unit = [], folder / FMU
    # A library that is loaded cannot be deleted on every machine.
    with TemporaryDirectory(ignore_cleanup_errors=True) as place:
        if (folder / "law.c").is_file():
            library = _library(folder, Path(place), about)
            found.append(_compared("library", samples, names, about, library))
        if unit.is_file() and find_spec("fmpy"):
            found.append(_compared(FMU, samples, names, about, _fmu(unit, Path(place), about)))
    if not found:
        raise UsageError(
            f"{folder} was exported with --no-c, and FMPy, which steps its {FMU}, is not there; "
            "install it with pip install 'podusv[export]'"
        )
    return found


def _read(folder: Path) -> tuple[dict[str, Any], list[str], Vector]:
    """What law.json says, names of the samples' columns, and the samples."""
    about = json_files.read(folder / ABOUT)
    try:
        with (folder / SAMPLES).open(newline="") as lines:
            names, *rows = csv.reader(lines)
        numbers = [one for part in PARTS for one in about[part]]
        if names != ["time", *(one["name"] for one in numbers)] or not rows:
            raise ValueError
        return about, names, np.array(rows, dtype=float)
    except (OSError, KeyError, TypeError, ValueError):
        raise UsageError(
            f"{folder}: {SAMPLES} is not the table of samples that {ABOUT} describes; export the "
            "law again with podusv export"
        ) from None


def _compared(
    what: str, samples: Vector, names: Sequence[str], about: dict[str, Any], step: Step
) -> Checked:
    inputs = 1 + STATE + TARGET + LOADS
    whose = "the run" if about["of_run"] else "the law by itself in podusv"
    for row in samples:
        out = step(row[:inputs])
        for name, one, other in zip(names[inputs:], out, row[inputs:], strict=True):
            if struct.pack("d", one) != struct.pack("d", other):
                told = f"t = {row[0]:g} s: {name} is {one!r}, and is {float(other)!r} in {SAMPLES}"
                return Checked(what, len(samples), whose, told)
    return Checked(what, len(samples), whose)


def _library(folder: Path, place: Path, about: dict[str, Any]) -> Step:
    """The library for this machine, made from the folder's files."""
    name = this_machine()
    code = folder / name / "law.o"
    if not (name and code.is_file()):
        made = ", ".join(about["platforms"])
        raise UsageError(f"{folder} has no object code for this machine, only for {made}")
    files = {file: (folder / file).read_bytes() for file in ("law.h", "law.c")}
    files["law.o"] = code.read_bytes()
    path = place / f"law{PLATFORMS[name].library}"
    path.write_bytes(shared_library(files, name, PLATFORMS[name]))
    library, numbers = ctypes.CDLL(str(path)), ctypes.POINTER(ctypes.c_double)
    library.podusv_law_size.restype = ctypes.c_size_t
    library.podusv_law_signals.restype = library.podusv_law_memory.restype = numbers
    law = ctypes.create_string_buffer(library.podusv_law_size())
    library.podusv_law_start(law)

    def step(row: Vector) -> list[float]:
        state, target, loads = np.split(row[1:], [STATE, STATE + TARGET])
        demand = (ctypes.c_double * 2)()
        library.podusv_law_step(law, *map(_vector, (state, target, loads)), demand)
        signals = library.podusv_law_signals(law)[: len(about["signals"])]
        return [*demand, *signals, *library.podusv_law_memory(law)[: len(about["memory"])]]

    return step


def _vector(numbers: Vector) -> Any:
    return (ctypes.c_double * len(numbers))(*numbers.tolist())


def _fmu(path: Path, place: Path, about: dict[str, Any]) -> Step:
    """The FMU, unpacked here and stepped by FMPy."""
    import fmpy  # is not installed with podusv
    from fmpy.fmi2 import FMU2Slave

    with suppress(BadZipFile):
        fmpy.extract(str(path), str(place))
    if not (place / "binaries" / this_machine()).is_dir():
        raise UsageError(f"{path} has no library for this machine, or is damaged")
    description = fmpy.read_model_description(str(place))
    slave = FMU2Slave(
        guid=description.guid, unzipDirectory=str(place),
        modelIdentifier=description.coSimulation.modelIdentifier, instanceName="law",
    )  # fmt: skip
    slave.instantiate()
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    given = [v.valueReference for v in description.modelVariables if v.causality == "input"]
    said = [v.valueReference for v in description.modelVariables if v.causality != "input"]

    def step(row: Vector) -> list[float]:
        slave.setReal(given, row[1 : 1 + len(given)].tolist())
        slave.doStep(float(row[0]), about["period"])
        return [float(number) for number in slave.getReal(said)]

    return step
