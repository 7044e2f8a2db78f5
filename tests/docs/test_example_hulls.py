"""`examples/hulls`: vessels of other programs beside plain loops with the programs' equations."""

import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from podusv_cli.scenario.load import load
from podusv_cli.testing import contract
from podusv_cli.workflows.in_memory import run_in_memory

HULLS = Path(__file__).parents[2] / "examples" / "hulls"
STEP, STEPS = 0.01, 3000
TASK = """
{plugins}
vessel: {{preset: hull.yaml}}
start: {{x: 1.0, y: 2.0, psi: 0.4, u: 1.2, v: -0.3, r: 0.05}}
path: {{kind: line, speed: 0.0}}
disturbance: {sea}
actuator: {{kind: ideal}}
controller: {{kind: schedule, rows: "0, {surge}, {yaw}\\n99, {surge}, {yaw}"}}
simulation: {{step: 0.01, duration: 30.0}}
"""
LINK = """<robot><link name="${{namespace}}/base_link"><inertial><mass value="{mass}"/>
<inertia ixx="1.0" iyy="2.0" izz="446.0"/></inertial></link>
<link name="mast"><inertial><mass value="15"/></inertial></link></robot>"""
PLUGIN = """<robot><plugin filename="{file}" name="{name}">
<link_name>${{namespace}}/base_link</link_name>
<xDotU>{s}0.0</xDotU><yDotV>{s}0.0</yDotV><nDotR>{s}20.0</nDotR><zW>500.0</zW><xU>{s}100.0</xU>
<{xx}>{s}150.0</{xx}><yV>{s}90.0</yV><{yy}>{s}110.0</{yy}><nR>{s}700.0</nR><{rr}>{s}800.0</{rr}>
</plugin></robot>"""
VRX = {"file": "libSimpleHydrodynamics.so", "name": "vrx::SimpleHydrodynamics", "s": ""}
VRX |= {"xx": "xUU", "yy": "yVV", "rr": "nRR"}
GZ = {"file": "gz-sim-hydrodynamics-system", "name": "gz::sim::systems::Hydrodynamics", "s": "-"}
GZ |= {"xx": "xUabsU", "yy": "yVabsV", "rr": "nRabsR"}
M = np.array([[6.7e3, 0.0, 0.0], [0.0, 1.1e4, -3.4e3], [0.0, -3.3e3, 4.4e5]])
D = np.array([[770.0, 0.0, 0.0], [0.0, 2500.0, -2000.0], [0.0, -670.0, 3.8e5]])


@pytest.fixture
def script(tmp_path, monkeypatch):
    """A script of the example, run in a folder of its own; its errors, and hull.yaml beside."""
    monkeypatch.chdir(tmp_path)

    def run_script(name, *words, code=0):
        command = [sys.executable, str(HULLS / name), *words]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60)
        assert done.returncode == code, done.stderr
        Path("hull.yaml").write_text(done.stdout)
        return done.stderr

    return run_script


def end_of_run(surge, yaw, sea="{kind: none}", plugins=""):
    """(x, y, psi, u, v, r) after 30 s under a force [N] and a moment [N m]."""
    Path("a.yaml").write_text(TASK.format(plugins=plugins, sea=sea, surge=surge, yaw=yaw))
    (case,) = load("a.yaml").cases.values()
    log = run_in_memory(case)
    return np.array([log.signal(name)[-1] for name in ("x", "y", "psi", "u", "v", "r")])


def end_of_loop(rate, state):
    """The same by a loop: `rate` of the state, classical steps."""
    x = np.array(state)
    for _ in range(STEPS):
        a = rate(x)
        b = rate(x + 0.5 * STEP * a)
        c = rate(x + 0.5 * STEP * b)
        x = x + STEP / 6.0 * (a + 2.0 * b + 2.0 * c + rate(x + STEP * c))
    return x


def moved(x, acceleration):
    """The rate of (x, y, psi, u, v, r), or of the same east, north and to port."""
    c, s = math.cos(x[2]), math.sin(x[2])
    return np.array([c * x[3] - s * x[4], s * x[3] + c * x[4], x[5], *acceleration])


@pytest.mark.parametrize("model", [VRX, GZ], ids=["vrx", "gz-sim"])
def test_a_hull_of_gazebo_moves_as_there(script, model):
    """In Gazebo's axes: x east, y north, yaw from east, v and r to port; 20 kg m2 of added mass."""
    Path("link.xacro").write_text(LINK.format(mass=180.0))
    Path("drag.xacro").write_text(PLUGIN.format(**model))
    said = script("gazebo.py", "drag.xacro", "link.xacro", "--length", "4.9", "--beam", "2.4")
    assert said == "left out: zW\n"
    assert "without the other links' 15 kg" in Path("hull.yaml").read_text()

    def rate(s):
        u, v, w = s[3:]
        surge = 150.0 - (100.0 + 150.0 * abs(u)) * u
        sway = -(90.0 + 110.0 * abs(v)) * v
        yaw = 60.0 - (700.0 + 800.0 * abs(w)) * w
        return moved(s, (surge / 180.0 + v * w, sway / 180.0 - u * w, yaw / 466.0))

    east, north, yaw, u, v, w = end_of_loop(rate, (2.0, 1.0, math.pi / 2 - 0.4, 1.2, 0.3, -0.05))
    there = [north, east, math.pi / 2 - yaw, u, -v, -w]
    np.testing.assert_allclose(end_of_run(150.0, -60.0), there, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("degrees", [3, 6])
def test_matrices_become_a_hull_that_moves_by_them(script, degrees):
    plane = [0, 1, 2] if degrees == 3 else [0, 1, 5]
    rows = np.full((2, degrees, degrees), 7.0) * (degrees == 6)  # of heave, roll and pitch
    rows[np.ix_([0, 1], plane, plane)] = M, D
    np.savetxt("md.csv", rows.reshape(-1, degrees), delimiter=",")
    size = ("--length", "7.6", "--beam", "1.8", "--mass", "6e3")
    assert script("matrices.py", "md.csv", *size) == ""

    def rate(x):
        return moved(x, np.linalg.solve(M, np.array([900.0, 0.0, 3e3]) - D @ x[3:]))

    there = end_of_loop(rate, (1.0, 2.0, 0.4, 1.2, -0.3, 0.05))
    np.testing.assert_allclose(end_of_run(900.0, 3e3), there, rtol=0.0, atol=1e-9)


def test_damping_that_goes_with_speed_is_that_of_the_formula(script):
    """N(U) = U N(2)/2 in sway and yaw, as of Clarke's formulas; surge keeps its own."""
    np.savetxt("md.csv", np.vstack([M, D]))
    script("matrices.py", "md.csv", "--length", "7.6", "--beam", "1.8", "--mass", "6e3")
    plugin = HULLS / "speed_damping.py"

    def rate(x):
        share = np.array([1.0, *[math.hypot(x[3], x[4]) / 2.0] * 2])
        return moved(x, np.linalg.solve(M, np.array([900.0, 0.0, 3e3]) - share * (D @ x[3:])))

    there = end_of_loop(rate, (1.0, 2.0, 0.4, 1.2, -0.3, 0.05))
    sea = "{kind: speed_damping, at: 2.0, surge: 0.0}"
    found = end_of_run(900.0, 3e3, sea, f"plugins: [{plugin}]")
    np.testing.assert_allclose(found, there, rtol=0.0, atol=1e-9)
    assert abs(end_of_run(900.0, 3e3)[2] - there[2]) > 0.01


@pytest.mark.parametrize(("check", "part"), contract(HULLS / "speed_damping.py"))
def test_the_plug_in_keeps_the_contract(check, part):
    check(part)


def test_what_is_no_number_yet_is_told(script):
    Path("link.xacro").write_text(LINK.format(mass="${1 + 2}"))
    Path("drag.xacro").write_text(PLUGIN.format(**VRX))
    size = ("--length", "4.9", "--beam", "2.4")
    said = script("gazebo.py", "drag.xacro", "link.xacro", *size, code=1)
    assert said == "<mass> is '${1 + 2}': let xacro write its numbers first\n"
    assert "name files with one" in script("gazebo.py", "link.xacro", *size, code=1)
    Path("md.csv").write_text("1, 2\n3, 4\n")
    size = (*size, "--mass", "6e3")
    said = script("matrices.py", "md.csv", *size, code=1)
    assert said == "md.csv has 2 rows of 2; wanted 6 of 3, or 12 of 6\n"
