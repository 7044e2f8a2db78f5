"""Exported laws as another program sees them: an FMU by its C functions, without FMPy."""

import ctypes
import xml.etree.ElementTree as ET
import zipfile
from pathlib import Path

import numpy as np

from podusv_cli.export import link
from podusv_cli.export.objects import PLATFORMS

COSIMULATION = 1


class Unit:
    """An instance of an FMU. `starts` are the inputs' as modelDescription.xml states them."""

    def __init__(self, path: Path, place: Path) -> None:
        """Unpack it into `place`, which has to stay."""
        machine = link.this_machine()
        with zipfile.ZipFile(path) as archive:
            archive.extractall(place)
        tree = ET.parse(place / "modelDescription.xml").getroot()
        shown = [*tree.iter("ScalarVariable")]
        self.names = [variable.get("name") for variable in shown]
        self.inputs = [one.get("name") for one in shown if one.get("causality") == "input"]
        self.starts = [float(variable[0].attrib["start"]) for variable in shown[: len(self.inputs)]]
        self.period = float(next(tree.iter("DefaultExperiment")).attrib["stepSize"])
        self._library = ctypes.CDLL(
            str(place / "binaries" / machine / f"law{PLATFORMS[machine].library}")
        )
        self._library.fmi2Instantiate.restype = ctypes.c_void_p
        guid = str(tree.get("guid")).encode()
        made = self._library.fmi2Instantiate(b"law", COSIMULATION, guid, None, None, 0, 0)
        assert made
        self._one = ctypes.c_void_p(made)

    def read(self) -> list[float]:
        """Every variable, in the order of `names`."""
        values = (ctypes.c_double * len(self.names))()
        self._real(self._library.fmi2GetReal, values)
        return [*values]

    def step(self, time: float, inputs: "np.typing.NDArray[np.float64]") -> list[float]:
        """What comes out of a sample at a time [s]."""
        self._real(self._library.fmi2SetReal, (ctypes.c_double * len(inputs))(*inputs))
        at, period = ctypes.c_double(time), ctypes.c_double(self.period)
        assert self._library.fmi2DoStep(self._one, at, period, 0) == 0
        return self.read()[len(inputs) :]

    def _real(self, function, values) -> None:
        references = (ctypes.c_uint * len(values))(*range(len(values)))
        assert function(self._one, references, ctypes.c_size_t(len(values)), values) == 0
