"""Whether an exported law does, sample by sample, what it did in podusv's own run."""

from __future__ import annotations

import csv
import ctypes
import struct
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, PositiveFloat, model_validator

from podusv_cli.core import signal
from podusv_cli.core.errors import UsageError, in_a_line
from podusv_cli.core.kernel import Vector
from podusv_cli.export.link import shared_library, this_machine
from podusv_cli.export.objects import PLATFORMS
from podusv_cli.storage import json_files, manifest

SAMPLES, ABOUT, FMU = "check.csv", "law.json", "law.fmu"
STATE, TARGET, LOADS, DEMAND = 6, 6, 3, len(signal.DEMAND)
INPUTS = STATE + TARGET + LOADS  # and a heading, of laws that read one
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


class NumberEntry(BaseModel):
    """What is read of a number in law.json; there is more."""

    model_config = ConfigDict(strict=True, frozen=True)
    name: str


class About(BaseModel):
    """What is read of law.json; there is more."""

    model_config = ConfigDict(strict=True, frozen=True)
    inputs: list[NumberEntry] = Field(min_length=INPUTS, max_length=INPUTS + len(signal.HEADING))
    demand: list[NumberEntry] = Field(min_length=DEMAND, max_length=signal.DEMAND_SIZE)
    signals: list[NumberEntry]
    memory: list[NumberEntry]
    period: PositiveFloat
    platforms: list[str]
    of_run: bool

    @model_validator(mode="after")
    def _check_lengths(self) -> Self:
        """Raises ValueError for lengths that no export has; the library would write beyond them."""
        if len(self.inputs) not in (INPUTS, INPUTS + len(signal.HEADING)):
            raise ValueError(f"has {len(self.inputs)} inputs, which no exported law has")
        return self

    @property
    def columns(self) -> list[str]:
        """The names of the columns of check.csv."""
        numbers = (*self.inputs, *self.demand, *self.signals, *self.memory)
        return ["time", *(number.name for number in numbers)]


def check(folder: Path, *, trusted: bool = True) -> list[Checked]:
    """Step the library that the folder's files make, and its FMU where FMPy is installed.

    This executes code of the folder: files that its manifest lists, unchanged. Raises UsageError
    where the folder is no export, where it is not `trusted`, and without a compiler for this
    machine; StorageError where a file was altered.
    """
    listed = _files_in_manifest(folder)
    about = json_files.read_as(folder / ABOUT, About)
    samples = _samples(folder, about)
    if not trusted:
        raise UsageError(
            f"this would execute the code in {folder}; if you know who made it, allow it with "
            "--trust"
        )
    results, unit = [], folder / FMU
    # A library that is loaded cannot be deleted on every machine.
    with TemporaryDirectory(ignore_cleanup_errors=True) as place:
        if "law.c" in listed:
            library = _library(folder, Path(place), about, listed)
            results.append(_compare_samples("library", samples, about, library))
        if FMU in listed and find_spec("fmpy"):
            results.append(_compare_samples(FMU, samples, about, _fmu(unit, Path(place), about)))
    if not results:
        raise UsageError(
            f"{folder} was exported with --no-c, and FMPy, which steps its {FMU}, is not there; "
            "install it with pip install 'podusv[export]'"
        )
    return results


def _files_in_manifest(folder: Path) -> Collection[str]:
    """The names of the files of an exported law, which are as its manifest has them.

    Raises UsageError for another folder, StorageError where a file was altered.
    """
    for name in (ABOUT, manifest.NAME):
        if not (folder / name).is_file():
            raise UsageError(
                f"{folder} is no exported law: it has no {name}; make one with podusv export"
            )
    files = manifest.check(folder).files
    if missing := [name for name in (ABOUT, SAMPLES) if name not in files]:
        raise UsageError(f"{folder} is no exported law: its {manifest.NAME} lists no {missing[0]}")
    return files


def _samples(folder: Path, about: About) -> Vector:
    """The samples (samples, columns) of check.csv. Raises UsageError for another table."""
    try:
        with (folder / SAMPLES).open(newline="") as lines:
            names, *rows = csv.reader(lines)
        samples = np.array(rows, dtype=float)
        if names != about.columns or samples.shape != (len(rows), len(names)):
            raise ValueError
        return samples
    except (OSError, ValueError, csv.Error):
        raise UsageError(
            f"{folder}: {SAMPLES} is not the table of samples that {ABOUT} describes; export the "
            "law again with podusv export"
        ) from None


def _compare_samples(what: str, samples: Vector, about: About, step: Step) -> Checked:
    """Compare an exported law with its samples (n, columns) by bits, to the first difference.

    `what` names it in messages; `step` gives what comes out for a row's time and inputs. By bits,
    since NaN is not equal to itself, and -0 equals 0.
    """
    given, names = 1 + len(about.inputs), about.columns
    whose = "the run" if about.of_run else "the law by itself in podusv"
    for row in samples:
        out = step(row[:given])
        for name, one, other in zip(names[given:], out, row[given:], strict=True):
            if struct.pack("d", one) != struct.pack("d", other):
                where = f"t = {row[0]:g} s: {name} is {one!r}, and is {float(other)!r} in {SAMPLES}"
                return Checked(what, len(samples), whose, where)
    return Checked(what, len(samples), whose)


def _library(folder: Path, place: Path, about: About, listed: Collection[str]) -> Step:
    """The step of the library for this machine, made in `place` from the folder's files.

    `listed` are the files of the manifest. Raises UsageError without object code for this machine,
    or without a compiler.
    """
    name = this_machine()
    code = f"{name}/law.o"
    if code not in listed:
        made = ", ".join(about.platforms)
        raise UsageError(f"{folder} has no object code for this machine, only for {made}")
    files = {file: (folder / file).read_bytes() for file in ("law.h", "law.c") if file in listed}
    files["law.o"] = (folder / code).read_bytes()
    path = place / f"law{PLATFORMS[name].library}"
    path.write_bytes(shared_library(files, name, PLATFORMS[name]))
    library, numbers = ctypes.CDLL(str(path)), ctypes.POINTER(ctypes.c_double)
    # ctypes would take results for an int, which has half of a pointer's bits
    library.podusv_law_size.restype = ctypes.c_size_t
    library.podusv_law_signals.restype = library.podusv_law_memory.restype = numbers
    law = ctypes.create_string_buffer(library.podusv_law_size())
    library.podusv_law_start(law)

    def step(row: Vector) -> list[float]:
        """Demand, signals and memory that the C library gives for a sample's row (columns,)."""
        state, target, loads = np.split(row[1:], [STATE, len(about.inputs) - LOADS])
        demand = (ctypes.c_double * len(about.demand))()
        library.podusv_law_step(law, *map(_vector, (state, target, loads)), demand)
        signals = library.podusv_law_signals(law)[: len(about.signals)]
        return [*demand, *signals, *library.podusv_law_memory(law)[: len(about.memory)]]

    return step


def _vector(numbers: Vector) -> Any:
    """Numbers (n,) as an array of C."""
    return (ctypes.c_double * len(numbers))(*numbers.tolist())


def _fmu(path: Path, place: Path, about: About) -> Step:
    """The step of the FMU at `path`, unpacked into `place` and stepped by FMPy.

    Raises UsageError where FMPy cannot read it, or it has no library for this machine.
    """
    import fmpy  # is not installed with podusv
    from fmpy.fmi2 import FMU2Slave

    try:
        fmpy.extract(str(path), str(place))
        description = fmpy.read_model_description(str(place))
    except Exception as error:  # whatever FMPy raises of a file that podusv did not write
        raise UsageError(f"{path} cannot be read by FMPy: {in_a_line(error)}") from error
    if not (place / "binaries" / this_machine()).is_dir():
        raise UsageError(f"{path} has no library for this machine")
    slave = FMU2Slave(
        guid=description.guid,
        unzipDirectory=str(place),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="law",
    )
    slave.instantiate()
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    # Both in the order of check.csv's columns, see `fmu.variables`
    given = [v.valueReference for v in description.modelVariables if v.causality == "input"]
    said = [v.valueReference for v in description.modelVariables if v.causality != "input"]

    def step(row: Vector) -> list[float]:
        """The outputs that the FMU gives for the inputs of one sample, a row (columns,)."""
        slave.setReal(given, row[1 : 1 + len(given)].tolist())
        slave.doStep(float(row[0]), about.period)
        return [float(number) for number in slave.getReal(said)]

    return step
