"""A law out of the simulator: by itself, as C and as an FMU it has the bits of podusv's run."""

import json
import os
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
import zipfile
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import cortex_m7
import numpy as np
import pytest
from command_samples import one_line
from conftest import example, failure_of, kinds
from export_samples import (
    CC,
    HARDWARE,
    KINDS,
    SOURCE,
    export_law,
    exported,
    law,
    needs_cc,
    scenario,
    task,
)
from exported_laws import Unit
from fmpy import read_model_description
from fmpy.validation import validate_fmu
from rotation import one_in

import podusv
from podusv_cli.core.errors import StorageError, UsageError
from podusv_cli.engine.running import simulate
from podusv_cli.export import c, link, objects
from podusv_cli.export import check as checking
from podusv_cli.export import fmu as units
from podusv_cli.export.check import check
from podusv_cli.export.fmu import variables
from podusv_cli.export.law import ExportedLaw
from podusv_cli.scenario.resolved import resolved_yaml
from podusv_cli.storage import manifest
from podusv_cli.workflows import export as workflow

UPDATES = ("after", "before")
LAWS, QUICK = sorted(KINDS.keys() - {"maneuvering"}), ("alos", "pose_pid")  # that is refused
FED = ("controllers=null", "controller={kind: pose_pid, load: estimated}")
MANEUVERING = ("controllers=null", "controller={kind: maneuvering}", "control.period=0.1")
PODS = {"actuator": {"kind": "pod", "preset": "otter"}, "vessel": {"preset": "otter"}}


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """An exported law; tests copy it."""
    return exported(tmp_path_factory.mktemp("sound") / "law")


@pytest.mark.parametrize(("kind", "update"), one_in(3, [(k, u) for k in LAWS for u in UPDATES]))
def test_a_law_by_itself_has_the_bits_of_its_run(kind, update):
    """Demand, signals and memory of every sample, called as the C files call it."""
    law = ExportedLaw.of(scenario(kind, **{"control.update": update}))
    rows = law.samples(podusv.simulate(law.scenario).recording)
    np.testing.assert_array_equal(law.by_itself(rows), rows)
    assert len(rows) == 301


@pytest.mark.slow  # compiles everything anew
@pytest.mark.parametrize("kind", LAWS)
def test_a_shipped_law_calls_no_mathematical_library(kind):
    assert objects.library_functions(objects.together(ExportedLaw.of(scenario(kind)).pieces)) == []


TASKS: dict[str, tuple[str, dict[str, Any]]] = {
    "an estimate in place of the state": ("podusv:sea/sensors.yaml", {}),
    "an estimate on a path that is followed": (
        "podusv:laws/legs.yaml",
        {
            "controllers": None,
            "controller": {"kind": "los_pid"},
            "measurement": {"kind": "sensors"},
            "estimator": {"kind": "ekf"},
        },
    ),
    "a command path": ("podusv:sea/delay.yaml", {}),
    "stations that are kept": (
        "podusv:dp/stations.yaml",
        {
            "controllers": None,
            "controller": {"kind": "pose_backstepping", "k_i": 0.02},
            "measurement": {"kind": "sensors"},
            "estimator": {"kind": "passive_observer"},
            "simulation.duration": 40.0,
        },
    ),
    "a law of two demands on a path with a heading": (
        "podusv:dp/four_corners.yaml",
        {"controllers": None, "controller": {"kind": "velocity_vector"}},
    ),
    "rounded corners": (
        "podusv:laws/corners.yaml",
        {"controllers": None, "controller": {"kind": "hand_position"}},
    ),
    "a log of some steps": (SOURCE, {"log.every": 7, "controller": {"kind": "momentum_vector"}}),
    "no whole number of periods": (SOURCE, {"simulation.duration": 4.07}),
}


@pytest.mark.parametrize("task", one_in(2, [*TASKS]))
def test_it_has_them_whatever_is_around_it(task):
    source, changes = TASKS[task]
    base = {"control.period": 0.1, "simulation.duration": 5.0}
    law = ExportedLaw.of(podusv.load(source, {**base, **changes}))
    rows = law.samples(podusv.simulate(law.scenario).recording)
    np.testing.assert_array_equal(law.by_itself(rows), rows)
    assert len(rows) == int(law.scenario.simulation.duration / 0.1) + 1


def test_a_law_that_loads_between_samples_change_is_held_against_itself(tmp_path):
    """The C files are given the loads at samples only, so they cannot have the bits of the run."""
    pods = "actuator={kind: pod, preset: otter}"
    said: list[str] = []
    changes = [
        "control.period=0.1",
        "simulation.duration=2",
        "controller={kind: momentum_vector}",
        pods,
        "vessel={preset: otter}",
    ]
    folder = export_law(Path(SOURCE), tmp_path / "law", changes, fmu=False, say=said.append)
    (note,) = [text for text in said if "log.h5" in text]
    assert note.startswith("the demands of the exported law differ from those in log.h5: ")
    assert "check your code by check.csv, which has what the exported law answers" in note
    assert not any("the run" in text and "samples before" in text for text in said)
    assert not json.loads((folder / "law.json").read_text())["of_run"]
    if shutil.which("cc"):
        (found,) = check(folder)
        assert (found.whose, found.differs) == ("the law by itself in podusv", "")


def test_a_run_that_diverges_is_told_and_one_that_is_interrupted_exports_nothing(
    tmp_path, monkeypatch
):
    said: list[str] = []
    marched = simulate.run

    def ended(status):
        monkeypatch.setattr(
            simulate,
            "run",
            lambda *given, **how: replace(
                marched(*given, **how), status=status, message="diverged at once"
            ),
        )

    ended("diverged")
    exported(tmp_path / "far", say=said.append)
    assert "the run diverged at once; check.csv has the samples before" in said
    ended("interrupted")
    with pytest.raises(KeyboardInterrupt):
        exported(tmp_path / "left")
    assert not (tmp_path / "left").exists()


def test_the_period_keeps_its_digits():
    law = ExportedLaw.of(
        scenario(
            "pid",
            **{
                "simulation.step": 0.0123456789,
                "control.period": 0.123456789,
                "simulation.duration": 1.23456789,
            },
        )
    )
    (period,) = re.findall(r"#define PODUSV_LAW_PERIOD (\S+)", c.sources(law)["law.h"])
    assert float(period) == pytest.approx(0.123456789, rel=1e-14)


@needs_cc
def test_the_c_files_have_the_bits_of_the_run_and_tell_where_they_have_not(sound, tmp_path, podusv):
    folder = shutil.copytree(sound, tmp_path / "law")
    (found,) = check(folder)
    assert (found.samples, found.whose, found.differs) == (51, "the run", "")
    samples = folder / "check.csv"
    names, first, *rest = samples.read_text().splitlines()
    place = names.split(",").index("tau_u_cmd")
    cells = first.split(",")
    cells[place] = repr(float(np.nextafter(float(cells[place]), 1e9)))
    samples.write_text("\n".join([names, ",".join(cells), *rest]) + "\n")
    said = podusv("export", "--check", "--trust", str(folder))
    assert (said.code, "check.csv was altered" in said.err) == (5, True)
    manifest.write(folder, "finished")
    said = podusv("export", "--check", "--trust", str(folder))
    assert said.code == 3
    assert re.match(r"library: t = 0 s: tau_u_cmd is .*, and is .* in check\.csv\n", said.out)


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


def test_the_description_of_the_fmu_names_every_variable_once():
    law = ExportedLaw.of(scenario("momentum_vector", **PODS))
    about = {
        **c.template_values(law),
        "guid": "g",
        "outputs": [13, 14],
        "stop": "30.0",
        "units": ["N"],
        "variables": variables(law, np.arange(15.0)),
        "loads": True,
    }
    tree = ET.fromstring(c.render_file("modelDescription.xml", about))
    found = [variable.get("name") for variable in tree.iter("ScalarVariable")]
    assert found == law.columns[1:]
    starts = [real.get("start") for real in tree.iter("Real")]
    assert starts[:15] == [f"{i}.0" for i in range(15)]
    assert starts[15:] == [None] * (len(found) - 15)


AROUND: dict[str, tuple[str, dict[str, Any], bool]] = {
    "a demand that is cut": (SOURCE, {}, False),
    "a delay shorter than the period": (SOURCE, {"actuator": {"command": {"delay": 0.1}}}, True),
    "a failure after the run": (SOURCE, {"actuator": {"failure": {"time": 99.0}}}, True),
    "an estimate beside the third leg": (
        "podusv:laws/legs.yaml",
        {
            "controllers": None,
            "path.points": [[0, 0], [6, 0], [6, 6]],
            "start.x": 5.0,
            "start.y": 4.0,
            "measurement": {"kind": "sensors"},
            "estimator": {"kind": "ekf"},
        },
        False,
    ),
}


@needs_cc
@pytest.mark.parametrize("around", one_in(2, [*AROUND]))
def test_an_fmu_begins_where_the_run_does_and_asks_for_loads_that_it_cannot_know(tmp_path, around):
    """As another program reads it: modelDescription.xml, the library, and check.csv."""
    source, changes, loads = AROUND[around]
    base = {"control.period": 0.2, "simulation.duration": 3.0, "controller": law("los_pid")}
    folder = exported_as(tmp_path, podusv.load(source, {**base, **changes}), fmu=True)
    unit, rows = Unit(folder / "law.fmu", tmp_path / "unit"), table(folder)
    given = len(unit.inputs)
    assert given == (15 if loads else 12)
    assert unit.starts == unit.read()[:given] == rows[0, 1 : 1 + given].tolist()
    for row in rows:
        assert unit.step(row[0], row[1 : 1 + given]) == row[16:].tolist()


def exported_as(to: Path, scenario: Any, **options: Any) -> Path:
    """The folder of a scenario's law for this machine."""
    (to / "scenario.yaml").write_text(resolved_yaml(scenario))
    return export_law(to / "scenario.yaml", to / "law", **options)


def table(folder: Path) -> Any:
    """The samples of an exported law."""
    return np.loadtxt(folder / "check.csv", delimiter=",", skiprows=1)


@pytest.mark.parametrize("kind", kinds("actuators").values(), ids=kinds("actuators"))
def test_an_actuator_cuts_the_demand_and_nothing_else_where_it_says_so(kind):
    actuator, random = example(kind), np.random.default_rng(3)
    for _ in range(20):
        limits = actuator.limits()
        demand = random.normal(0.0, 10.0, len(limits))
        u, r, *v = np.clip(demand, np.negative(limits), limits)
        loads = actuator._drive_once(random.normal(0.0, 1.0, 6), actuator.rest(), demand)[0]
        assert np.array_equal(loads, [u, *(v or [0.0]), r]) == actuator.only_cuts
    for around in ({"command": {}}, {"failure": failure_of(kind, 1e9)}):
        assert not example(kind, **around).only_cuts


def test_an_fmu_is_for_this_machine_or_for_those_asked_for_each_said_before_it(monkeypatch):
    monkeypatch.setattr(link, "find_spec", lambda name: name == "ziglang")
    assert [*workflow._linkable_platforms(workflow.Products())] == [link.this_machine()]
    asked = workflow.Products(platforms=["win64", "linux64"])
    said: list[str] = []
    monkeypatch.setattr(
        units, "shared_library", lambda files, name, platform: said.append(name) or b""
    )
    law = ExportedLaw.of(scenario("pid"))
    inputs = np.zeros(12)
    units.fmu(
        law, objects.together(law.pieces), workflow._linkable_platforms(asked), inputs, said.append
    )
    builds = "the first time, zig builds the platform's C library, a minute or two"
    assert said == [
        f"linking the FMU for win64; {builds}",
        "win64",
        f"linking the FMU for linux64; {builds}",
        "linux64",
    ]


@pytest.mark.long
def test_every_platform_gets_object_code_and_nothing_of_this_machine():
    pieces = ExportedLaw.of(scenario("pid")).pieces
    text = objects.together(pieces)
    seen = re.findall(r"^define (?!internal)[^@]*@(\w+)", text, re.MULTILINE)
    assert sorted(seen) == sorted(pieces)
    assert objects.library_functions(text) == []
    assert objects.library_functions("declare double @llvm.sin.f64(double) #1\n") == ["sin"]
    magic = {
        "linux64": b"\x7fELF",
        "win64": b"\x64\x86",
        "darwin64": b"\xcf\xfa\xed\xfe",
        "aarch64-darwin": b"\xcf\xfa\xed\xfe",
        "aarch64-linux": b"\x7fELF",
        "armv7": b"\x7fELF",
        "thumbv7em": b"\x7fELF",
        "riscv64": b"\x7fELF",
    }
    assert set(magic) == set(objects.PLATFORMS)
    for name, platform in objects.PLATFORMS.items():
        assert objects.object_file(text, platform).startswith(magic[name]), name


REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"overrides": ()}, r"acts continuously in this scenario.*set control\.period"),
    (
        {"overrides": ["control.period=0.1", "simulation.duration=700000", "log.every=10000"]},
        r"logs every step, too many of them in 700000 s; simulate less",
    ),
    (
        {"source": "podusv:dp/estimated_load.yaml", "overrides": ["control.period=0.1", *FED]},
        "takes the load that an estimator finds, and what is exported has no input.*to unknown",
    ),
    (
        {"source": "podusv:skjetne_2005/ellipse.yaml", "overrides": MANEUVERING},
        "reads its path at a time of its own, and what is exported is told its target; choose",
    ),
    ({"platforms": ["linux"]}, r"unknown platform 'linux'; did you mean 'linux64'\? \(allowed: "),
    ({"platforms": ["thumbv7em"], "fmu": True}, "thumbv7em has no shared libraries.*--no-fmu"),
    ({"c": False, "fmu": False}, "leave nothing to export; give one of them only"),
]


@pytest.mark.parametrize(("options", "says"), REFUSED)
def test_what_cannot_be_exported_gets_a_sentence(tmp_path, options, says):
    changes = {"overrides": ["control.period=0.1", "simulation.duration=1"]} | options
    source = Path(changes.pop("source", SOURCE))
    with pytest.raises(UsageError, match=says):
        export_law(source, tmp_path / "law", **changes)
    assert not (tmp_path / "law").exists()


def test_an_export_says_which_law_it_takes_where_nobody_chose(tmp_path, monkeypatch):
    """The scenario has a `controller` of its base beside those that it compares."""
    said: list[str] = []
    monkeypatch.setattr(workflow, "to_end", raised := Mock(side_effect=KeyboardInterrupt))
    for chosen in ("", "velocity_vector"):
        with pytest.raises(KeyboardInterrupt):
            export_law(
                HARDWARE / "boat.yaml",
                tmp_path / f"law-{chosen}",
                ["simulation.duration=1"],
                fmu=False,
                controller=chosen,
                say=said.append,
            )
    assert raised.call_count == 2
    notes = [line for line in said if line.startswith("exporting")]
    assert notes == [
        "exporting `controller`; --controller chooses among velocity_vector, momentum_vector"
    ]


def test_without_a_linker_or_an_export_the_check_says_what_is_missing(tmp_path, monkeypatch):
    with pytest.raises(UsageError, match=r"is no exported law: it has no law\.json"):
        check(tmp_path)
    (tmp_path / "law.json").write_text("{}")
    with pytest.raises(UsageError, match=r"is no exported law: it has no manifest\.json"):
        check(tmp_path)
    described(tmp_path, "0\n")
    with pytest.raises(UsageError, match=r"exported with --no-c, and FMPy.*podusv\[export\]"):
        check(tmp_path)
    monkeypatch.setattr(workflow, "this_machine", lambda: "")
    with pytest.raises(UsageError, match=r"no export for this machine.*--no-fmu"):
        export_law(Path(SOURCE), tmp_path / "law", platforms=())
    monkeypatch.setattr(link.shutil, "which", lambda name: None)
    monkeypatch.setattr(link, "find_spec", lambda name: None)
    with pytest.raises(UsageError, match=r"no linker for .*podusv\[export\]"):
        link.shared_library({}, link.this_machine(), objects.PLATFORMS[link.this_machine()])
    monkeypatch.undo()
    monkeypatch.setattr(link.shutil, "which", lambda name: None)
    monkeypatch.setattr(link, "find_spec", lambda name: None)
    said: list[str] = []
    with pytest.raises(UsageError, match=r"no linker for .*--no-fmu exports without"):
        export_law(
            Path(SOURCE), tmp_path / "law", ["control.period=0.1"], platforms=(), say=said.append
        )
    assert said == []  # before anything is computed


ABOUT = {
    "inputs": [{"name": f"i{i}"} for i in range(15)],
    "demand": [{"name": "u"}, {"name": "r"}],
    "signals": [],
    "memory": [],
    "period": 0.1,
    "platforms": [],
    "of_run": True,
}
HEAD = ",".join(["time", *(number["name"] for number in ABOUT["inputs"] + ABOUT["demand"])])


def described(folder: Path, rows: str, **changes: Any) -> None:
    """An exported law without code: law.json, a table with these rows, and a manifest of both."""
    (folder / "law.json").write_text(json.dumps({**ABOUT, **changes}))
    (folder / "check.csv").write_text(f"{HEAD}\n" + rows.replace("0", ",".join("0" * 18)))
    manifest.write(folder, "finished")


@pytest.mark.parametrize("rows", ["", "zero\n", "0\n0,1\n", "0,1\n"])
def test_a_table_that_is_not_the_one_described_gets_a_sentence(tmp_path, rows):
    described(tmp_path, rows)
    with pytest.raises(UsageError, match=r"export the law again"):
        check(tmp_path)


@pytest.mark.parametrize(
    "changes",
    [
        {"inputs": 3},
        {"inputs": ABOUT["inputs"][1:]},
        {"demand": None},
        {"signals": ["e_ct"]},
        {"memory": {"a": 1}},
        {"period": "0.1"},
        {"period": -1.0},
        {"platforms": "linux64"},
        {"of_run": 1},
    ],
)
def test_a_law_json_of_other_types_gets_a_sentence(tmp_path, changes):
    described(tmp_path, "0\n", **changes)
    (key,) = changes
    with pytest.raises(StorageError, match=rf"law\.json: damaged, .* \({key}"):
        check(tmp_path)


DAMAGES = {
    "removed": lambda path: path.unlink(),
    "emptied": lambda path: path.write_bytes(b""),
    "truncated": lambda path: path.write_bytes(path.read_bytes()[: path.stat().st_size // 2]),
    "flipped": lambda path: path.write_bytes(path.read_bytes()[:-9] + b"#" * 9),
    "a folder": lambda path: (path.unlink(), path.mkdir()),
}
FILES = ("law.json", "check.csv", "law.c", "law.h", "{}/law.o", "provenance.json", "manifest.json")


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("file", FILES)
def test_of_a_damaged_folder_nothing_is_compiled_and_a_sentence_says_why(
    sound, tmp_path, podusv, monkeypatch, file, damage
):
    folder = tmp_path / "law"
    shutil.copytree(sound, folder)
    DAMAGES[damage](folder / file.format(link.this_machine()))
    monkeypatch.setattr(checking, "shared_library", lambda *given: pytest.fail("it was compiled"))
    said = podusv("export", "--check", "--trust", folder)
    assert said.code in (2, 5)
    assert one_line(said.err)


def test_code_that_a_folder_brings_along_is_run_with_trust_alone(
    sound, tmp_path, podusv, monkeypatch
):
    monkeypatch.setattr(checking, "shared_library", lambda *given: pytest.fail("it was compiled"))
    said = podusv("export", "--check", sound)
    assert (said.code, said.out) == (2, "")
    assert str(sound) in said.err
    assert one_line(said.err).endswith(" --trust")
    folder = exported(tmp_path / "law", c=False, fmu=True)
    for name in ("law.c", "law.h", f"{link.this_machine()}/law.o"):  # nobody's manifest has these
        (folder / name).parent.mkdir(exist_ok=True)
        shutil.copy(sound / name, folder / name)
    monkeypatch.setattr(checking, "find_spec", lambda name: None)
    said = podusv("export", "--check", "--trust", folder)
    assert (said.code, "exported with --no-c" in said.err) == (2, True)


@pytest.mark.parametrize(
    "kind",
    [
        *one_in(2, QUICK),
        *(pytest.param(law, marks=pytest.mark.slow) for law in LAWS if law not in QUICK),
    ],
)
def test_fmpy_finds_no_fault_and_the_bits_of_the_run(tmp_path, kind):
    folder = export_law(Path(SOURCE), tmp_path / "law", task(kind))
    assert validate_fmu(str(folder / "law.fmu")) == []
    found = check(folder)
    assert [checked.what for checked in found] == ["library", "law.fmu"]
    assert all(checked.samples == 3001 and not checked.differs for checked in found)
    with zipfile.ZipFile(folder / "law.fmu") as archive:
        assert "modelDescription.xml" in archive.namelist()
    told = read_model_description(str(folder / "law.fmu"))
    assert {"m", "rad", "m/s", "N", "N m"} <= {unit.name for unit in told.unitDefinitions}
    units = {variable.name: variable.unit for variable in told.modelVariables}
    assert (units["x"], units["psi"], units["tau_r_cmd"]) == ("m", "rad", "N m")


@needs_cc
@pytest.mark.parametrize("kind", ["pid", "pose_pid"])
def test_a_program_without_loads_has_the_bits_behind_limits(tmp_path, kind):
    """With NULL the law takes its own demand, cut at each limit: the sway force's, too."""
    limits = ("actuator={kind: saturated_full, surge_limit: 3, sway_limit: 0.4, yaw_limit: 0.2}",)
    changes = (*task(kind, 20), *(limits if kind == "pose_pid" else ()))
    folder = export_law(Path(SOURCE), tmp_path / "law", changes, fmu=False)
    program = STEPS.replace("in + 6 + PODUSV_LAW_TARGET, demand", "NULL, demand")
    (folder / "steps.c").write_text(program)
    about = json.loads((folder / "law.json").read_text())
    samples = np.loadtxt(folder / "check.csv", delimiter=",", skiprows=1)
    end = 1 + len(about["inputs"])
    (folder / "in.bin").write_bytes(samples[:, 1:end].tobytes())
    made = f"{CC} steps.c law.c {about['platforms'][0]}/law.o -lm -o steps.run"
    subprocess.run(made.split(), cwd=folder, check=True)
    subprocess.run([folder / "steps.run"], cwd=folder, check=True)
    said = np.fromfile(folder / "out.bin").reshape(len(samples), -1)
    np.testing.assert_array_equal(said, samples[:, end:])
    demands = [number["name"] for number in about["demand"]]
    asked = dict(zip(demands, said.T, strict=False))
    if kind == "pose_pid":
        assert demands == ["tau_u_cmd", "tau_r_cmd", "tau_v_cmd"]
        assert np.abs(asked["tau_v_cmd"]).max() > 0.4


WINE = shutil.which("wine64", path=f"{os.environ.get('PATH')}:/usr/lib/wine") or "wine64"
EMULATED = {  # what runs a program of a platform, and how zig calls the platform
    "aarch64-linux": ("qemu-aarch64", "aarch64-linux-musl"),
    "armv7": ("qemu-arm", "arm-linux-musleabihf"),
    "riscv64": ("qemu-riscv64", "riscv64-linux-musl"),
    "win64": (WINE, "x86_64-windows-gnu"),
}
STEPS = """
#include <stdio.h>
#include "law.h"

static podusv_law law;

int main(void)
{
    double in[9 + PODUSV_LAW_TARGET], demand[PODUSV_LAW_DEMAND];
    FILE *from = fopen("in.bin", "rb"), *to = fopen("out.bin", "wb");
    podusv_law_start(&law);
    while (fread(in, sizeof in, 1, from) == 1) {
        podusv_law_step(&law, in, in + 6, in + 6 + PODUSV_LAW_TARGET, demand);
        fwrite(demand, sizeof demand, 1, to);
        fwrite(podusv_law_signals(&law), sizeof(double), PODUSV_LAW_SIGNALS, to);
        fwrite(podusv_law_memory(&law), sizeof(double), PODUSV_LAW_MEMORY, to);
    }
    return fclose(to);
}
"""


def stepped_on(platform: str, folder: Path, inputs: bytes) -> bytes:
    """What the law in an exported folder makes of rows of inputs, emulated."""
    runner, target = EMULATED[platform]
    (folder / "steps.c").write_text(STEPS)
    (folder / "in.bin").write_bytes(inputs)
    linked = f"cc -target {target} -static -O2 -ffp-contract=off steps.c law.c {platform}/law.o"
    compiler = [sys.executable, "-m", "ziglang", *linked.split(), "-o", "steps.run"]
    subprocess.run(compiler, cwd=folder, check=True)
    subprocess.run([runner, folder / "steps.run"], cwd=folder, check=True)
    return (folder / "out.bin").read_bytes()


BOARDS = {
    **{name: (runner, partial(stepped_on, name)) for name, (runner, _) in EMULATED.items()},
    "thumbv7em": (cortex_m7.BOARD, cortex_m7.stepped),
}


@pytest.mark.slow
@pytest.mark.skipif(not find_spec("ziglang"), reason="needs ziglang")
@pytest.mark.parametrize("platform", BOARDS)
@pytest.mark.parametrize("kind", LAWS)
def test_other_processors_have_the_bits_of_the_run(tmp_path, platform, kind):
    runner, stepped = BOARDS[platform]
    if not shutil.which(runner):
        pytest.skip(f"needs {runner}")
    folder = export_law(Path(SOURCE), tmp_path / "law", task(kind), fmu=False, platforms=[platform])
    samples = np.loadtxt(folder / "check.csv", delimiter=",", skiprows=1)
    assert len(samples) == 3001
    end = 1 + len(json.loads((folder / "law.json").read_text())["inputs"])
    out = stepped(folder, samples[:, 1:end].tobytes())
    said = np.frombuffer(out).reshape(len(samples), -1)
    np.testing.assert_array_equal(said.view(int), samples[:, end:].copy().view(int))
