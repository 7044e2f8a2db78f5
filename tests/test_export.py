"""A law out of the simulator: by itself, as C and as an FMU it has the bits of podusv's run."""

import json
import os
import re
import runpy
import shutil
import struct
import subprocess
import sys
import xml.etree.ElementTree as ET
import zipfile
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import cortex_m7
import numpy as np
import pytest
from command_samples import ROOT, one_line
from conftest import REQUIRED, example, kinds
from exported_laws import Unit
from fmpy.validation import validate_fmu

import podusv
from podusv_cli.components.actuators.command import Command, Failure
from podusv_cli.components.controllers.base import Controller
from podusv_cli.core import registry
from podusv_cli.core.errors import StorageError, UsageError
from podusv_cli.export import c, link, objects
from podusv_cli.export import check as checking
from podusv_cli.export.check import check
from podusv_cli.export.fmu import variables
from podusv_cli.export.law import ExportedLaw
from podusv_cli.scenario.load import resolved_yaml
from podusv_cli.storage import manifest
from podusv_cli.workflows import export as workflow

SOURCE = "podusv:mu_2017/corrected.yaml"
LAWS = sorted(registry.kinds("podusv_cli.components.controllers", Controller))
PODS = {"actuator": {"kind": "pod", "preset": "otter"}, "vessel": {"preset": "otter"}}
CC = "cc -std=c99 -Wall -Wextra -pedantic -Werror -O2 -ffp-contract=off"
HARDWARE = ROOT / "examples/hardware_in_the_loop"
steer = runpy.run_path(str(HARDWARE / "hardware.py"))["steer"]
needs_cc = pytest.mark.skipif(not shutil.which("cc"), reason="needs a C compiler")


def law(kind: str) -> dict[str, Any]:
    """A law with what it has no defaults for."""
    return {"kind": kind, **REQUIRED.get(kind, {})}


def scenario(kind: str, **changes: Any) -> Any:
    """The paper's task with a law that takes samples."""
    base = {"control.period": 0.1, "simulation.duration": 30.0, "controller": law(kind)}
    return podusv.load(SOURCE, {**base, **changes})


def task(kind: str, seconds: int = 300) -> tuple[str, str, str]:
    """What makes of the paper's task one for a law that takes samples."""
    given = f"controller={json.dumps(law(kind))}"
    return "control.period=0.1", f"simulation.duration={seconds}", given


def exported(to: Path, kind: str = "pid", **options: Any) -> Path:
    """The folder of a small export for this machine."""
    options = {"fmu": False, "platforms": [link.this_machine()]} | options
    return workflow.export(Path(SOURCE), workflow.Request(to, task(kind, 5), **options))


@pytest.mark.parametrize("update", ["after", "before"])
@pytest.mark.parametrize("kind", LAWS)
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
        {"controllers": None, "controller": {"kind": "los_pid"},
         "measurement": {"kind": "sensors"}, "estimator": {"kind": "ekf"}},
    ),
    "a command path": ("podusv:sea/delay.yaml", {}),
    "rounded corners": (
        "podusv:laws/corners.yaml", {"controllers": None, "controller": {"kind": "hand_position"}}
    ),
    "a log of some steps": (SOURCE, {"log.every": 7, "controller": {"kind": "momentum_vector"}}),
    "no whole number of periods": (SOURCE, {"simulation.duration": 4.07}),
}  # fmt: skip


@pytest.mark.parametrize("task", TASKS)
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
    changes = ["control.period=0.1", "simulation.duration=2", "controller={kind: momentum_vector}",
               pods, "vessel={preset: otter}"]  # fmt: skip
    request = workflow.Request(
        tmp_path / "law", changes, fmu=False, platforms=[link.this_machine()], say=said.append
    )
    folder = workflow.export(Path(SOURCE), request)
    assert any("not what it said in the run" in text for text in said)
    assert not any("the run" in text and "samples before" in text for text in said)
    assert not json.loads((folder / "law.json").read_text())["of_run"]
    if shutil.which("cc"):
        (found,) = check(folder)
        assert (found.whose, found.differs) == ("the law by itself in podusv", "")


def test_a_run_that_diverges_is_told_and_one_that_is_interrupted_exports_nothing(
    tmp_path, monkeypatch
):
    said: list[str] = []
    simulated = workflow.simulated

    def ended(status):
        monkeypatch.setattr(
            workflow, "simulated",
            lambda *given: replace(simulated(*given), status=status, message="diverged at once"),
        )  # fmt: skip

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


@needs_cc
def test_the_program_in_the_documentation_runs(tmp_path):
    folder = exported(tmp_path / "law", "momentum_vector")  # it asks for the loads
    (program,) = re.findall(r"```c\n(.*?)```", (ROOT / "docs/export.md").read_text(), re.DOTALL)
    (folder / "program.c").write_text(program)
    sources = ["program.c", "law.c", f"{link.this_machine()}/law.o"]
    subprocess.run([*CC.split(), *sources, "-lm"], cwd=folder, check=True)
    out = subprocess.run([folder / "a.out"], capture_output=True, text=True, check=True).stdout
    demands = np.array([line.split() for line in out.splitlines()], dtype=float)
    stepped = ExportedLaw.of(scenario("momentum_vector")).stepper()
    row = np.array([-10.0, -10.0, *[0.0] * 4, 0.0, 0.0, 0.5, *[0.0] * 6])
    for sample, demand in enumerate(demands):
        np.testing.assert_array_equal(stepped(sample, row)[:2], demand)
        row[6] += 0.5 * 0.1
        row[12], row[14] = np.clip(demand, [-8.0, -2.5], [8.0, 2.5])  # as the actuator cuts them
    assert demands.shape == (3, 2)
    assert (demands[:, 0] > 0.0).all()  # towards the target


@pytest.fixture
def boat(sound, tmp_path):
    """The port of the example's program with the exported law, while it runs."""
    program = tmp_path / "boat"
    sources = [HARDWARE / "boat.c", "law.c", f"{link.this_machine()}/law.o"]
    subprocess.run([*CC.split(), "-I.", *sources, "-lm", "-o", program], cwd=sound, check=True)
    with subprocess.Popen([program], stdout=subprocess.PIPE, text=True) as running:
        assert running.stdout
        yield int(running.stdout.readline())
        running.kill()


@needs_cc
def test_the_law_on_another_computer_has_the_demands_of_the_law_inside(boat):
    """So it has in a second run, which begins anew."""
    changes = {"control.period": 0.1, "simulation.duration": 5.0, "controller": {"kind": "pid"}}
    inside = podusv.simulate(SOURCE, changes)
    for _ in range(2):
        session = podusv.open_session(SOURCE, changes)
        assert steer(session, ("127.0.0.1", boat), wait=30.0) == 0
        log = session.log
        for name in ("tau_u_cmd", "tau_r_cmd", "x", "y", "psi", "u", "v", "r"):
            # At the last instant the law inside takes a sample more.
            np.testing.assert_array_equal(log[name][:-1], inside[name][:-1], name)
    assert len(set(log["tau_r_cmd"])) == 50


class Network:
    """A socket and a clock: after each datagram, which answers arrive."""

    def __init__(self, arriving):
        self.arriving, self.here, self.now = arriving, [], 100.0

    def socket(self, *kind):
        """Itself."""
        return self

    def sendto(self, datagram, address):
        """The next answers arrive."""
        self.here += self.arriving.pop(0)

    def select(self, links, *others):
        """Itself where an answer is here."""
        return [links if self.here else []]

    def recv(self, size):
        """The answer that arrived first."""
        return struct.pack("<3d", *self.here.pop(0))

    def sleep(self, seconds):
        """The clock goes on."""
        self.now += seconds


def test_a_lost_demand_and_a_late_one_are_counted_and_the_last_one_holds(monkeypatch):
    """In real time: a period of the vessel is a period of the clock."""
    arriving = [[(0.0, 1.0, 0.1)], [], [(0.1, 2.0, 0.2), (0.2, 3.0, 0.3)], [(0.2, 4.0, 0.4)]]
    network = Network(arriving)
    faked = {"socket": SimpleNamespace(socket=network.socket, AF_INET=0, SOCK_DGRAM=0)}
    faked |= {"select": network.select, "sleep": network.sleep, "monotonic": lambda: network.now}
    for name, module in faked.items():
        monkeypatch.setitem(steer.__globals__, name, module)
    session = podusv.open_session(HARDWARE / "boat.yaml", {"simulation.duration": 0.4})
    assert steer(session, ("boat", 4000)) == 2
    held = slice(0, 40, 10)
    assert session.log["tau_u_cmd"][held].tolist() == [1.0, 1.0, 3.0, 3.0]
    assert session.log["tau_r_cmd"][held].tolist() == [0.1, 0.1, 0.3, 0.3]
    assert network.now == pytest.approx(100.4)


def stand_ins(messages: list[Any]) -> dict[str, Any]:
    """Modules of ROS with as much as the node of the documentation takes from them."""

    class Node:
        def __init__(self, name):
            self.name = name

        def create_subscription(self, *given):
            """Nothing: the test calls the node itself."""

        def create_publisher(self, *given):
            return SimpleNamespace(publish=messages.append)

        create_timer = create_subscription

    def wrench():
        parts = {"force": SimpleNamespace(), "torque": SimpleNamespace()}
        return SimpleNamespace(wrench=SimpleNamespace(**parts))

    return {
        "rclpy": SimpleNamespace(), "rclpy.node": SimpleNamespace(Node=Node),
        "geometry_msgs.msg": SimpleNamespace(WrenchStamped=wrench),
        "nav_msgs.msg": SimpleNamespace(Odometry=None),
        "std_msgs.msg": SimpleNamespace(Float64MultiArray=None),
    }  # fmt: skip


def odometry(x: float, y: float, psi: float, u: float, v: float, r: float) -> Any:
    """The vessel's state as ROS has it: x east, y north, counterclockwise, y to port."""
    yaw, some = np.pi / 2 - psi, SimpleNamespace
    turned = some(w=np.cos(yaw / 2), x=0.0, y=0.0, z=np.sin(yaw / 2))
    pose = some(pose=some(position=some(x=y, y=x), orientation=turned))
    return some(pose=pose, twist=some(twist=some(linear=some(x=u, y=-v), angular=some(z=-r))))


@needs_cc
def test_the_node_in_the_documentation_demands_what_the_law_inside_demands(
    sound, tmp_path, monkeypatch
):
    """But for the digits that are lost in ROS's angles; ROS itself is not there."""
    folder, messages = shutil.copytree(sound, tmp_path / "law"), list[Any]()
    page = (ROOT / "docs/export.md").read_text()
    (build,) = re.findall(r"^    (cc -shared.*)$", page, re.MULTILINE)
    subprocess.run(build.replace("linux64", link.this_machine()).split(), cwd=folder, check=True)
    (program,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    monkeypatch.chdir(folder)
    for name, module in stand_ins(messages).items():
        monkeypatch.setitem(sys.modules, name, module)
    names: dict[str, Any] = {"__name__": "node"}
    exec(program, names)  # noqa: S102
    assert names["PERIOD"] == json.loads(Path("law.json").read_text())["period"]
    node = names["Law"]()
    node.step()  # nothing is known yet
    rows = np.genfromtxt("check.csv", delimiter=",", names=True)
    for row in rows:
        node.measure(odometry(*(row[name] for name in ("x", "y", "psi", "u", "v", "r"))))
        node.aim(SimpleNamespace(data=[*row][7:13]))
        node.step()
    surge = [message.wrench.force.x for message in messages]
    yaw = [-message.wrench.torque.z for message in messages]
    np.testing.assert_allclose(surge, rows["tau_u_cmd"], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(yaw, rows["tau_r_cmd"], rtol=1e-9, atol=1e-9)


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
        **c.template_values(law), "guid": "g", "outputs": [13, 14], "stop": "30.0",
        "variables": variables(law, np.arange(15.0)), "loads": True,
    }  # fmt: skip
    tree = ET.fromstring(c.rendered("modelDescription.xml", about))
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
        {"controllers": None, "path.points": [[0, 0], [6, 0], [6, 6]], "start.x": 5.0,
         "start.y": 4.0, "measurement": {"kind": "sensors"}, "estimator": {"kind": "ekf"}}, False,
    ),
}  # fmt: skip


@needs_cc
@pytest.mark.parametrize("around", AROUND)
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
    options = {"platforms": [link.this_machine()]} | options
    return workflow.export(to / "scenario.yaml", workflow.Request(to / "law", **options))


def table(folder: Path) -> Any:
    """The samples of an exported law."""
    return np.loadtxt(folder / "check.csv", delimiter=",", skiprows=1)


@pytest.mark.parametrize("kind", kinds("actuators").values(), ids=kinds("actuators"))
def test_an_actuator_cuts_the_demand_and_nothing_else_where_it_says_so(kind):
    actuator, random = example(kind), np.random.default_rng(3)
    for _ in range(20):
        demand, limits = random.normal(0.0, 10.0, 2), actuator.limits()
        cut = np.clip(demand, np.negative(limits), limits)
        loads = actuator._driven(random.normal(0.0, 1.0, 6), actuator.rest(), demand)[0]
        assert np.array_equal(loads, [cut[0], 0.0, cut[1]]) == actuator.only_cuts
    for around in (Command(), Failure(time=1e9)):
        name = type(around).__name__.lower()
        assert not actuator.model_copy(update={name: around}).only_cuts


def test_every_platform_gets_object_code_and_nothing_of_this_machine():
    pieces = ExportedLaw.of(scenario("pid")).pieces
    text = objects.together(pieces)
    seen = re.findall(r"^define (?!internal)[^@]*@(\w+)", text, re.MULTILINE)
    assert sorted(seen) == sorted(pieces)
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
    (
        {"overrides": ["control.period=0.1", "simulation.duration=700000", "log.every=10000"]},
        r"logs every step, too many of them in 700000 s; simulate less",
    ),
    ({"platforms": ["linux"]}, r"unknown platform 'linux'; did you mean 'linux64'\? \(allowed: "),
    ({"platforms": ["thumbv7em"], "fmu": True}, "thumbv7em has no shared libraries.*--no-fmu"),
    ({"c": False, "fmu": False}, "leave nothing to export; give one of them only"),
]


@pytest.mark.parametrize(("options", "says"), REFUSED)
def test_what_cannot_be_exported_gets_a_sentence(tmp_path, options, says):
    changes = {"overrides": ["control.period=0.1", "simulation.duration=1"]} | options
    with pytest.raises(UsageError, match=says):
        workflow.export(Path(SOURCE), workflow.Request(tmp_path / "law", **changes))
    assert not (tmp_path / "law").exists()


def test_an_export_says_which_law_it_takes_where_nobody_chose(tmp_path, monkeypatch):
    """The scenario has a `controller` of its base beside those that it compares."""
    said: list[str] = []
    monkeypatch.setattr(workflow, "simulated", raised := Mock(side_effect=KeyboardInterrupt))
    for chosen in ("", "velocity_vector"):
        request = workflow.Request(
            tmp_path / f"law-{chosen}", ["simulation.duration=1"], chosen, c=True, fmu=False,
            platforms=["linux64"], say=said.append,
        )  # fmt: skip
        with pytest.raises(KeyboardInterrupt):
            workflow.export(HARDWARE / "boat.yaml", request)
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
    monkeypatch.setattr(workflow, "find_spec", lambda name: None)
    with pytest.raises(UsageError, match=r"no export for this machine.*--no-fmu"):
        workflow.export(Path(SOURCE), workflow.Request(tmp_path / "law"))
    monkeypatch.setattr(link.shutil, "which", lambda name: None)
    monkeypatch.setattr(link, "find_spec", lambda name: None)
    with pytest.raises(UsageError, match=r"no linker for .*podusv\[export\]"):
        link.shared_library({}, link.this_machine(), objects.PLATFORMS[link.this_machine()])
    monkeypatch.undo()
    monkeypatch.setattr(link.shutil, "which", lambda name: None)
    monkeypatch.setattr(link, "find_spec", lambda name: None)
    said: list[str] = []
    request = workflow.Request(tmp_path / "law", ["control.period=0.1"], say=said.append)
    with pytest.raises(UsageError, match=r"no linker for .*--no-fmu exports without"):
        workflow.export(Path(SOURCE), request)
    assert said == []  # before anything is computed


ABOUT = {
    "inputs": [{"name": f"i{i}"} for i in range(15)], "demand": [{"name": "u"}, {"name": "r"}],
    "signals": [], "memory": [], "period": 0.1, "platforms": [], "of_run": True,
}  # fmt: skip
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
        {"inputs": 3}, {"inputs": ABOUT["inputs"][1:]}, {"demand": None}, {"signals": ["e_ct"]},
        {"memory": {"a": 1}}, {"period": "0.1"}, {"period": -1.0}, {"platforms": "linux64"},
        {"of_run": 1},
    ],
)  # fmt: skip
def test_a_law_json_of_other_types_gets_a_sentence(tmp_path, changes):
    described(tmp_path, "0\n", **changes)
    (key,) = changes
    with pytest.raises(StorageError, match=rf"law\.json: damaged, .* \({key}"):
        check(tmp_path)


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """An exported law; tests copy it."""
    return exported(tmp_path_factory.mktemp("sound") / "law")


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
    "kind", [pytest.param(law, marks=() if law == "alos" else pytest.mark.slow) for law in LAWS]
)
def test_fmpy_finds_no_fault_and_the_bits_of_the_run(tmp_path, kind):
    request = workflow.Request(tmp_path / "law", task(kind), platforms=[link.this_machine()])
    folder = workflow.export(Path(SOURCE), request)
    assert validate_fmu(str(folder / "law.fmu")) == []
    found = check(folder)
    assert [checked.what for checked in found] == ["library", "law.fmu"]
    assert all(checked.samples == 3001 and not checked.differs for checked in found)
    with zipfile.ZipFile(folder / "law.fmu") as archive:
        assert "modelDescription.xml" in archive.namelist()


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
    double in[15], demand[2];
    FILE *from = fopen("in.bin", "rb"), *to = fopen("out.bin", "wb");
    podusv_law_start(&law);
    while (fread(in, sizeof in, 1, from) == 1) {
        podusv_law_step(&law, in, in + 6, in + 12, demand);
        fwrite(demand, sizeof demand, 1, to);
        fwrite(podusv_law_signals(&law), sizeof(double), PODUSV_LAW_SIGNALS, to);
        fwrite(podusv_law_memory(&law), sizeof(double), PODUSV_LAW_MEMORY, to);
    }
    return fclose(to);
}
"""


def stepped_on(platform: str, folder: Path, inputs: bytes) -> bytes:
    """What the law in an exported folder makes of rows of 15 numbers, emulated."""
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
    request = workflow.Request(tmp_path / "law", task(kind), fmu=False, platforms=[platform])
    folder = workflow.export(Path(SOURCE), request)
    samples = np.loadtxt(folder / "check.csv", delimiter=",", skiprows=1)
    assert len(samples) == 3001
    out = stepped(folder, samples[:, 1:16].tobytes())
    said = np.frombuffer(out).reshape(len(samples), -1)
    np.testing.assert_array_equal(said.view(int), samples[:, 16:].copy().view(int))
