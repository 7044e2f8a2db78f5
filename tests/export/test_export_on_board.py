"""An exported law on another computer: the programs of docs/export.md, and hardware in the loop."""

import ctypes
import json
import re
import runpy
import shutil
import struct
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from command_samples import ROOT
from export_samples import CC, HARDWARE, OTTER, SOURCE, exported, law, needs_cc, scenario

import podusv
from podusv_cli.export import link
from podusv_cli.export.law import ExportedLaw
from podusv_cli.workflows.start import Boat, start

steer = runpy.run_path(str(HARDWARE / "hardware.py"))["steer"]


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """An exported law; tests copy it."""
    return exported(tmp_path_factory.mktemp("sound") / "law")


def c_of_the_page() -> list[str]:
    """The program in docs/export.md, and the functions before and after a step of the law."""
    return re.findall(r"```c\n(.*?)```", (ROOT / "docs/export.md").read_text(), re.DOTALL)


@needs_cc
def test_the_program_in_the_documentation_runs(tmp_path):
    folder = exported(tmp_path / "law", "momentum_vector")  # it asks for the loads
    program, _ = c_of_the_page()
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


@needs_cc
def test_targets_and_thrusts_of_the_documentation_are_those_of_the_simulator(tmp_path, monkeypatch):
    """The law of a started boat over a whole run, from the legs to each thruster."""
    monkeypatch.chdir(tmp_path)
    start(Boat("4.9", "2.4", "180", "2x180N@1.0", hulls=2), Path("boat.yaml"))
    short = {"simulation.duration": 110.0}
    folder = exported(tmp_path / "law", source="boat.yaml", changes=short, controller="los_pid")
    (folder / "ends.c").write_text(c_of_the_page()[1])
    sources = ["ends.c", "law.c", f"{link.this_machine()}/law.o"]
    build = [*CC.split(), "-shared", "-fPIC", *sources, "-lm", "-o", "ends.so"]
    subprocess.run(build, cwd=folder, check=True)
    ends, leg = ctypes.CDLL(str(folder / "ends.so")), ctypes.c_int(0)
    memory = ctypes.create_string_buffer(ends.podusv_law_size())
    ends.podusv_law_start(memory)

    def vector(*numbers):
        return (ctypes.c_double * len(numbers))(*numbers)

    for row in np.genfromtxt(folder / "check.csv", delimiter=",", skip_header=1):
        state, target, demand = vector(*row[1:7]), vector(*[0.0] * 6), vector(0.0, 0.0)
        ends.aim(state, ctypes.byref(leg), target)
        np.testing.assert_allclose(target, row[7:13], rtol=0, atol=1e-9)
        ends.podusv_law_step(memory, state, target, vector(*row[13:16]), demand)
        np.testing.assert_allclose(demand, row[16:18], rtol=1e-9, atol=1e-9)
    assert leg.value == 2
    alone = {"controllers": None, "controller": {"kind": "los_pid"}, "claims": {}, **short}
    run = podusv.simulate("boat.yaml", alone)
    T = 180.0 * run["n_part_cmd"] * np.abs(run["n_part_cmd"])
    assert run["saturated"].any()
    for asked, wanted in zip(zip(run["tau_u_cmd"], run["tau_r_cmd"], strict=True), T, strict=True):
        sides, loads = vector(0.0, 0.0), vector(0.0, 0.0, 0.0)
        ends.thrusts(vector(*asked), sides, loads)
        np.testing.assert_allclose(sides, wanted, rtol=0, atol=0.001 * 180)
        np.testing.assert_allclose(loads, [sides[0] + sides[1], 0.0, sides[0] - sides[1]])


@contextmanager
def boat(folder, text=None):
    """The port of the example's program, or of this one, with an exported law, while it runs."""
    (folder / "boat.c").write_text(text or (HARDWARE / "boat.c").read_text())
    sources = ["boat.c", "law.c", f"{link.this_machine()}/law.o"]
    subprocess.run([*CC.split(), "-I.", *sources, "-lm", "-o", "boat"], cwd=folder, check=True)
    with subprocess.Popen([folder / "boat"], stdout=subprocess.PIPE, text=True) as running:
        assert running.stdout
        yield int(running.stdout.readline())
        running.kill()


def steered(port, source, changes):
    """The log of a scenario whose demands come from this port; none is lost."""
    session = podusv.open_session(source, changes)
    assert steer(session, ("127.0.0.1", port), wait=30.0) == 0
    return session.log


@needs_cc
def test_the_law_on_another_computer_has_the_demands_of_the_law_inside(tmp_path):
    """So it has in a second run, which begins anew; of a law against windup, too."""
    for kind in ("pid", "momentum_vector"):
        changes = {"control.period": 0.1, "simulation.duration": 5.0, "controller": law(kind)}
        inside = podusv.simulate(SOURCE, changes)
        with boat(exported(tmp_path / kind, kind)) as port:
            logs = [steered(port, SOURCE, changes) for _ in range(2)]
        for log in logs:
            for name in ("tau_u_cmd", "tau_r_cmd", "x", "y", "psi", "u", "v", "r"):
                # At the last instant the law inside takes a sample more.
                np.testing.assert_array_equal(log[name][:-1], inside[name][:-1], name)
        assert len(set(log["tau_r_cmd"])) == 50


@needs_cc
def test_a_law_behind_pods_hears_their_loads_and_does_not_wind_up(tmp_path):
    """It stays as near to the law inside as the vessel moves in a period; with NULL it does not."""
    period = 0.15
    changes = {"control.period": period, "simulation.duration": 30.0, "controller": law("alos")}
    folder = exported(tmp_path / "law", source=OTTER, changes=changes)
    inside, far = podusv.simulate(OTTER, changes), {}
    for loads in ("given + 13", "NULL"):
        program = (HARDWARE / "boat.c").read_text().replace("given + 13", loads)
        with boat(folder, program) as port:
            log = steered(port, OTTER, changes)
        far[loads] = np.hypot(log["x"] - inside["x"], log["y"] - inside["y"]).max()
    moved = period * np.abs(inside["u"]).max()
    assert far["given + 13"] < moved < 5.0 * moved < far["NULL"]


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
        "rclpy": SimpleNamespace(),
        "rclpy.node": SimpleNamespace(Node=Node),
        "geometry_msgs.msg": SimpleNamespace(WrenchStamped=wrench),
        "nav_msgs.msg": SimpleNamespace(Odometry=None),
        "std_msgs.msg": SimpleNamespace(Float64MultiArray=None),
    }


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
