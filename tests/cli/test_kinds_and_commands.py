"""Every kind of run through every command: each cell runs, or is refused with a sentence."""

import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from command_samples import Said, commanded
from plugin_samples import LAW
from policy_samples import content, symmetric

HULL = "vessel: {preset: paper_nonlinear}\nstart: {x: -2.0, y: -1.0, u: 0.3}\n"
TASK = "path: {kind: line}\ndisturbance: {kind: none}\nactuator: {kind: saturated}\n"
SHORT = "simulation: {duration: 2.0, step: 0.02}\nmetrics: {settling_radius: 50.0}\n"
OTTER = "vessel: {preset: otter}\nactuator: {kind: pod, preset: otter}\n"
PID = "controller: {kind: pid}\n"
STILL = "start: {u: 1.0}\npath: {kind: line, speed: 0.0}\ndisturbance: {kind: none}\n"
LEGS = "path: {kind: legs, points: [[0, 0], [6, 0], [6, 6]]}\n"
POSES = "path: {kind: poses, poses: [[0, 0, 0], [1, 0.5, 0.5]], travel: 9.0, dwell: 1.5}\n"
# What a scenario of each kind has.
KINDS = {
    "trial": OTTER
    + STILL
    + SHORT
    + "controller: {kind: zigzag, thrust: 78.0, lever: 0.5, execute: 0.2}\n",
    "legs": HULL
    + TASK.replace("path: {kind: line}\n", LEGS)
    + SHORT
    + "controller: {kind: los_pid}\n",
    "policy": HULL
    + TASK
    + SHORT
    + f"controller: {{kind: policy, content: '{content(symmetric())}'}}\n",
    "pods": OTTER + STILL.replace("speed: 0.0", "speed: 1.0") + SHORT + PID,
    "sensors": HULL + TASK + SHORT + PID + "measurement: {kind: sensors}\nestimator: {kind: ekf}\n",
    "poses": "vessel: {preset: cybership2}\nstart: {x: 0.1}\n"
    + POSES
    + "disturbance: {kind: none}\nactuator: {kind: saturated_full}\n"
    + SHORT
    + "controller: {kind: pose_pid}\n",
    "stations": "vessel: {preset: cybership2}\nstart: {x: 0.1}\n"
    + "path: {kind: stations, poses: [[0, 0, 0], [1, 0.5, 0.5]], travel: 9.0, keep: 0.5}\n"
    + "disturbance: {kind: none}\nactuator: {kind: saturated_full}\n"
    + SHORT
    + "controller: {kind: pose_backstepping, k_i: 0.02}\n",
    "plug-in": HULL + TASK + SHORT + "plugins: [law.py]\ncontroller: {kind: cross_track}\n",
}
STUDY = (
    "sweep: {draws: 2, vary: {vessel.m: {times: {uniform: [0.9, 1.1]}}}}\n"
    "tune: {budget: 16, train: 2, validate: 2, repeats: 1, objective: median(effort_u), batch: 8}\n"
)
SAMPLED = ("--set", "control.period=0.1")
Command = Callable[..., Said]
FINISHED: dict[str, Path] = {}  # runs of this session, by kind


def bench(podusv: Command, kind: str) -> Said:
    """A bench whose only task is this scenario."""
    text = Path("a.yaml").read_text()
    law = re.search("controller: .*\n", text)
    assert law
    own = text.replace(law[0], "").replace("law.py", "../law.py")
    for name, layer in {
        "laws.yaml": own + law[0].replace("controller: ", "controllers: {mine: ").rstrip() + "}\n",
        "tasks/one.yaml": "{}\n",
        "vessels/one.yaml": "{}\n",
        "conditions/one.yaml": "{}\n",
    }.items():
        Path("bench", name).parent.mkdir(parents=True, exist_ok=True)
        Path("bench", name).write_text(layer)
    return podusv("bench", "bench", "--no-figures", "--out", "benched")


def doubt(podusv: Command, kind: str) -> Said:
    """A claim that holds, on draws of what the scenario has."""
    text = Path("a.yaml").read_text()
    law = re.search(r"controller: {kind: (\w+)", text)
    assert law
    claim = f"claims: {{C: {{says: It ends., expect: finished({law[1]})}}}}\ndoubt: {{draws: 2}}\n"
    Path("d.yaml").write_text(text + claim)
    return podusv("doubt", "d.yaml", "--no-figures", "--workers", "1")


def gym(podusv: Command, kind: str) -> Said:
    """Two steps of an environment."""
    pytest.importorskip("gymnasium")
    import podusv.gym
    from podusv_cli.core.errors import PodusvError

    try:
        count = 3 if kind in ("poses", "stations") else 2
        limits, action = (8.0, 2.5, 8.0)[:count], (1.0, 0.1, 0.2)[:count]
        env = podusv.gym.Env("a.yaml", period=0.1, reward="effort_u", limits=limits)
        env.reset(seed=0)
        gained = [env.step(action)[1] for _ in range(2)]
    except PodusvError as error:
        return Said(error.exit_code, "", "\n".join(error.lines()))
    return Said(0, str(gained), "")


def identify(podusv: Command, kind: str) -> Said:
    """The hull from the log of a run of this scenario."""
    long = ("--set", "simulation.duration=5.0")  # of 5 Hz at least 20 positions
    assert podusv("run", "a.yaml", "--no-figures", "--out", "r", *long).code == 0
    logs = "identify: {free: [m11], logs: [{file: r/log.h5, delay: 0.0}], draws: 2}\n"
    Path("i.yaml").write_text(Path("a.yaml").read_text() + logs)
    return podusv("identify", "i.yaml", "--no-figures")


def of_run(*words: str) -> Callable[[Command, str], Said]:
    """A command about a finished run, which is made once for each kind."""

    def made(podusv: Command, kind: str) -> Said:
        if kind not in FINISHED:
            FINISHED[kind] = Path("r").resolve()
            assert podusv("run", "a.yaml", "--no-figures", "--out", "r").code == 0
        else:
            shutil.copytree(FINISHED[kind], "r")
        return podusv(*words)

    return made


def of_scenario(*words: str) -> Callable[[Command, str], Said]:
    """A command about a scenario."""
    return lambda podusv, kind: podusv(*words)


COMMANDS: dict[str, Callable[[Command, str], Said]] = {
    "run": of_scenario("run", "a.yaml", "--no-figures"),
    "compare": of_scenario("compare", "a.yaml", "b.yaml", "--no-figures", "--workers", "1"),
    "sweep": of_scenario("sweep", "run", "a.yaml", "--no-figures", "--workers", "1"),
    "tune": of_scenario("tune", "a.yaml", "--no-figures", "--workers", "1"),
    "bench": bench,
    "doubt": doubt,
    "verify": of_scenario("verify", "a.yaml", "--tolerance", "1e9"),
    "margins": of_scenario("margins", "a.yaml"),
    "capability": of_scenario("capability", "a.yaml", "--every", "90"),
    "optimum": of_scenario("optimum", "a.yaml", "--no-figures"),
    "export": of_scenario("export", "a.yaml", "--no-fmu", "--to", "law", *SAMPLED),
    "gym": gym,
    "identify": identify,
    "plot": of_run("plot", "r", "--figure", "trajectory"),
    "rerun": of_run("rerun", "r", "--trust"),
    "diff": of_run("diff", "r", "r"),
}
POD, LEG = "actuator.kind: pod does not fit", "path.kind: legs does not fit"
REFUSED = {
    ("trial", "margins"): "it takes samples, and margins are those of a law that acts continuously",
    ("trial", "optimum"): POD,
    ("legs", "margins"): "its target moves with the vessel, and margins are those of a law that",
    ("legs", "optimum"): LEG,
    (
        "stations",
        "margins",
    ): "its target moves with the vessel, and margins are those of a law that",
    ("stations", "optimum"): "path.kind: stations does not fit",
    ("policy", "tune"): "no number of policy is a gain that changes a run",
    ("policy", "margins"): "no steady motion was found",
    ("pods", "optimum"): POD,
    ("plug-in", "margins"): "no steady motion was found",
}
# These compile C code of their own, search, or wait for a vessel that never settles.
SLOW = {
    *((kind, "export") for kind in KINDS if kind != "plug-in"),
    *((kind, "tune") for kind in ("pods", "sensors", "legs", "stations", "plug-in")),
    ("policy", "margins"),
    ("plug-in", "margins"),
    *((kind, "doubt") for kind in KINDS if kind != "plug-in"),
    *((kind, "identify") for kind in ("legs", "policy", "pods", "stations")),
}


@pytest.fixture
def cell(tmp_path, monkeypatch, capsys) -> Command:
    """The command line in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    return commanded(monkeypatch, capsys)


ALSO = {("plug-in", "export")}  # the one export that is not slow


def cells() -> list[Any]:
    """Every kind with every command; one cell in four is not long, in every row and column."""
    return [
        pytest.param(
            kind,
            command,
            marks=[pytest.mark.slow] * ((kind, command) in SLOW)
            + [pytest.mark.long] * ((row + column) % 4 != 0 and (kind, command) not in ALSO),
        )
        for row, kind in enumerate(KINDS)
        for column, command in enumerate(COMMANDS)
    ]


@pytest.mark.parametrize(("kind", "command"), cells())
def test_every_kind_goes_through_every_command(cell, recwarn, kind, command):
    Path("law.py").write_text(LAW)
    for name in ("a.yaml", "b.yaml"):
        Path(name).write_text(KINDS[kind] + STUDY)
    said = COMMANDS[command](cell, kind)
    if told := REFUSED.get((kind, command)):
        assert said.code in (2, 3)
        assert told in " ".join(said.err.split())
        assert ".py" not in said.err  # of podusv, whose source is no place to look for a remedy
    else:
        assert (said.code, bool(said.out)) == (0, True), said.err
    assert "Traceback" not in said.err
    assert not [*Path().rglob("missing.json")], "parts that could not be made: page, tables"
    assert not recwarn.list
