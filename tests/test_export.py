"""A law out of the simulator: by itself, as C and as an FMU it has the bits of podusv's run."""

import json
import re
import shutil
import subprocess
import xml.etree.ElementTree as ET
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_samples import ROOT

import podusv
from podusv_cli.components.controllers.base import Controller
from podusv_cli.core import registry
from podusv_cli.core.errors import UsageError
from podusv_cli.engine.machine import compile, signatures
from podusv_cli.export import c, link, objects
from podusv_cli.export.check import check
from podusv_cli.export.fmu import variables
from podusv_cli.export.law import PARTS, STEP, ExportedLaw
from podusv_cli.workflows import export as workflow

SOURCE = "podusv:mu_2017/corrected.yaml"
LAWS = sorted(
    set(registry.kinds("podusv_cli.components.controllers", Controller)) - {"schedule"}
)  # a schedule is the demand itself
PODS = {"actuator": {"kind": "pod", "preset": "otter"}, "vessel": {"preset": "otter"}}
needs_cc = pytest.mark.skipif(not shutil.which("cc"), reason="needs a C compiler")


def scenario(kind: str, **changes: Any) -> Any:
    """The paper's task with a law that takes samples."""
    base = {"control.period": 0.1, "simulation.duration": 30.0, "controller": {"kind": kind}}
    return podusv.load(SOURCE, {**base, **changes})


def exported(to: Path, **options: Any) -> Path:
    """The folder of a small export for this machine."""
    changes = ("control.period=0.1", "simulation.duration=5", "controller={kind: pid}")
    options = {"fmu": False, "platforms": [link.this_machine()]} | options
    return workflow.export(Path(SOURCE), workflow.Request(to, changes, **options))


def alone(law: ExportedLaw) -> Any:
    """What steps a law in this process as the C files do: from a sample to what comes out."""
    parts = [compile.routine(law.pieces[name]) for name in PARTS.values()]
    step, n = compile.routine(law.pieces[STEP]), law.layout
    state, row = law.vectors.s, law.vectors.row
    vectors, layout = signatures.pointers(law.vectors), signatures.whole_numbers(n)

    def stepped(sample: int, given: Any) -> list[float]:
        state[:6], row[:6], row[n.tau : n.tau + 3] = given[1:7], given[7:13], given[13:16]
        step(*parts, sample * n.hold_every, law.grid.step, vectors, layout)
        return [*row[n.demand : n.demand + 2], *row[n.signals : n.demand], *state[6:]]

    return stepped


@pytest.mark.parametrize("update", ["after", "before"])
@pytest.mark.parametrize("kind", LAWS)
def test_a_law_by_itself_has_the_bits_of_its_run(kind, update):
    """Demand, signals and memory of every sample, called as the C files call it."""
    law = ExportedLaw.of(scenario(kind, **{"control.update": update}))
    rows, stepped = law.samples(podusv.simulate(law.scenario).recording), alone(law)
    for sample, given in enumerate(rows):
        np.testing.assert_array_equal(stepped(sample, given), given[16:], f"sample {sample}")
    assert len(rows) == 301


@needs_cc
def test_the_c_files_have_the_bits_of_the_run_and_tell_where_they_have_not(tmp_path, podusv):
    folder = exported(tmp_path / "law")
    (found,) = check(folder)
    assert (found.samples, found.differs) == (51, "")
    samples = folder / "check.csv"
    names, first, *rest = samples.read_text().splitlines()
    place = names.split(",").index("tau_u_cmd")
    cells = first.split(",")
    cells[place] = repr(float(np.nextafter(float(cells[place]), 1e9)))
    samples.write_text("\n".join([names, ",".join(cells), *rest]) + "\n")
    said = podusv("export", "--check", str(folder))
    assert said.code == 3
    assert re.match(r"library: t = 0 s: tau_u_cmd is .* and was .* in the run\n", said.out)


@needs_cc
def test_the_program_in_the_documentation_runs(tmp_path):
    folder = exported(tmp_path / "law")
    (program,) = re.findall(r"```c\n(.*?)```", (ROOT / "docs/export.md").read_text(), re.DOTALL)
    (folder / "program.c").write_text(program)
    command = "cc -std=c99 -Wall -Wextra -pedantic -Werror -O2 -ffp-contract=off program.c law.c "
    subprocess.run(
        [*command.split(), f"{link.this_machine()}/law.o", "-lm"], cwd=folder, check=True
    )
    out = subprocess.run([folder / "a.out"], capture_output=True, text=True, check=True).stdout
    demands = np.array([line.split() for line in out.splitlines()], dtype=float)
    stepped = alone(ExportedLaw.of(scenario("pid")))
    row = np.array([0.0, -10.0, -10.0, *[0.0] * 4, 0.0, 0.0, 0.5, *[0.0] * 6])
    for sample, demand in enumerate(demands):
        np.testing.assert_array_equal(stepped(sample, row)[:2], demand)
        row[7] += 0.5 * 0.1
        row[13], row[15] = np.clip(demand, [-8.0, -2.5], [8.0, 2.5])  # as the actuator cuts them
    assert demands.shape == (3, 2)
    assert (demands[:, 0] > 0.0).all()  # towards the target


def test_the_table_of_samples_has_what_the_law_was_given(tmp_path):
    law = ExportedLaw.of(scenario("momentum_vector"))
    log = podusv.simulate(law.scenario).recording
    rows = law.samples(log)
    assert len(law.columns) == rows.shape[1]
    at = dict(zip(law.columns, rows.T, strict=True))
    np.testing.assert_array_equal(at["time"], log["time"][::10])
    np.testing.assert_array_equal(at["psi"], log["psi"][::10])
    np.testing.assert_array_equal(at["x_d"], log["x_d"][::10])
    np.testing.assert_array_equal(at["tau_u"][1:], log["tau_u"][9::10][: len(rows) - 1])
    assert law.assumes(rows)
    assert not ExportedLaw.of(scenario("momentum_vector", **PODS)).assumes(
        law.samples(podusv.simulate(scenario("momentum_vector", **PODS)).recording)
    )


def test_the_description_of_the_fmu_names_every_variable_once():
    law = ExportedLaw.of(scenario("momentum_vector"))
    about = {
        **c.told(law), "guid": "g", "outputs": [13, 14], "stop": "30.0",
        "variables": variables(law, loads=True),
    }  # fmt: skip
    tree = ET.fromstring(c.rendered("modelDescription.xml", about))
    found = [one.get("name") for one in tree.iter("ScalarVariable")]
    assert found == law.columns[1:]
    starts = [real.get("start") for real in tree.iter("Real")]
    assert all(np.isfinite(float(start)) for start in starts[:15] if start)
    assert starts[15:] == [None] * (len(found) - 15)


def test_every_platform_gets_object_code_and_nothing_of_this_machine():
    text = objects.together(ExportedLaw.of(scenario("velocity_vector")).pieces)
    assert objects.library_functions(text) == []
    assert objects.library_functions("declare double @llvm.sin.f64(double) #1\n") == ["sin"]
    magic = {
        "linux64": b"\x7fELF", "win64": b"\x64\x86", "darwin64": b"\xcf\xfa\xed\xfe",
        "aarch64-linux": b"\x7fELF", "armv7": b"\x7fELF", "thumbv7em": b"\x7fELF",
        "riscv64": b"\x7fELF",
    }  # fmt: skip
    assert set(magic) == set(objects.PLATFORMS)
    for name, platform in objects.PLATFORMS.items():
        assert objects.object_file(text, platform).startswith(magic[name]), name


REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"overrides": ()}, r"acts continuously in this scenario.*set control\.period"),
    ({"platforms": ["linux"]}, r"unknown platform 'linux'; did you mean 'linux64'\? \(allowed: "),
    ({"platforms": ["thumbv7em"], "fmu": True}, "thumbv7em has no shared libraries.*--no-fmu"),
]


@pytest.mark.parametrize(("options", "says"), REFUSED)
def test_what_cannot_be_exported_gets_a_sentence(tmp_path, options, says):
    changes = {"overrides": ["control.period=0.1", "simulation.duration=1"]} | options
    with pytest.raises(UsageError, match=says):
        workflow.export(Path(SOURCE), workflow.Request(tmp_path / "law", **changes))
    assert not (tmp_path / "law").exists()


def test_without_a_linker_or_an_export_the_check_says_what_is_missing(tmp_path, monkeypatch):
    with pytest.raises(UsageError, match=r"is no exported law: it has no law\.json"):
        check(tmp_path)
    monkeypatch.setattr(link.shutil, "which", lambda name: None)
    monkeypatch.setattr(link, "find_spec", lambda name: None)
    with pytest.raises(UsageError, match=r"no linker for .*podusv\[export\]"):
        link.shared_library({}, link.this_machine(), objects.PLATFORMS[link.this_machine()])


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["momentum_vector", "adaptive_neural"])
def test_fmpy_finds_no_fault_and_the_bits_of_the_run(tmp_path, kind):
    validation = pytest.importorskip("fmpy.validation")
    changes = ("control.period=0.1", "simulation.duration=300", f"controller={{kind: {kind}}}")
    request = workflow.Request(tmp_path / "law", changes, platforms=[link.this_machine()])
    folder = workflow.export(Path(SOURCE), request)
    assert validation.validate_fmu(str(folder / "law.fmu")) == []
    found = check(folder)
    assert [one.what for one in found] == ["library", "law.fmu"]
    assert all(one.samples == 3001 and not one.differs for one in found)
    with zipfile.ZipFile(folder / "law.fmu") as archive:
        assert "modelDescription.xml" in archive.namelist()
    about = json.loads((folder / "law.json").read_text())
    assert about["library"] == ([] if kind == "momentum_vector" else ["cos", "sin"])
