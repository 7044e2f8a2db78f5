"""`podusv compare` of runs with a log of a boat: its track beside theirs, and how far they are."""

import csv
import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_samples import Command
from measured_samples import METRICS, ROWS, TASK, compared, log, made_run, numbers, warnings_of
from rotation import one_in
from scenario_samples import write

import podusv as p
from podusv_cli.core.errors import PodusvError
from podusv_cli.storage.run_folder import open_run
from podusv_cli.workflows.measured import track

LEGS = "path: {kind: legs, points: [[0, 0], [3, 0], [3, 3]], speed: 0.2}"


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write("task.yaml", TASK)
    write("pods.yaml", TASK.replace("{kind: ideal}", "{kind: pod, preset: cybership2_pod}"))


def test_a_track_beside_a_run_is_as_far_away_as_it_was_put():
    alone = {"controllers": None, "controller": {"kind": "momentum_vector"}}
    run = p.run("task.yaml", alone, out="run", figures=False)
    t, x, y, psi = (run[name][3:61:4] for name in ("time", "x", "y", "psi"))
    aside = np.where(np.arange(len(t)) == 5, 1.7, 0.5)
    turned = np.degrees(psi + 0.31 + 2.0 * np.pi) % 360.0
    log(
        "LOG.csv",
        "x,time [ms],psi [deg],y",
        np.column_stack([x + 0.6 * aside, 1e3 * t, turned, y - 0.8 * aside]),
    )
    done = compared("run", "LOG.csv")
    rms = math.sqrt((1.7**2 + (len(t) - 1) * 0.5**2) / len(t))
    assert numbers(done, "run") == pytest.approx([rms, 1.7, 0.31, len(t)], rel=1e-9)
    assert all(math.isnan(x) for x in numbers(done, "LOG"))
    measured = done.result.runs[-1]
    assert measured.label == "LOG"
    assert measured.recording["z_e"] == pytest.approx(
        np.hypot(run["x_d"][3:61:4] - x - 0.6 * aside, run["y_d"][3:61:4] - y + 0.8 * aside)
    )


def test_sensors_may_come_at_different_times_and_the_log_last_longer():
    """Positions once a second, on a straight line that no run is on; heading in between."""
    times = np.arange(0.0, 12.01, 0.25)
    nothing = np.full(len(times), np.nan)
    x, psi = nothing.copy(), nothing.copy()
    x[::4], psi[2::4] = 0.3 * times[::4], 0.1
    log("LOG.csv", "t,x,y,psi", np.column_stack([times, x, 0.0 * x + 1.3, psi]))
    names = "identify: {columns: {time: t}}"
    longer = "simulation: {duration: 11.9, step: 0.02}"
    write("names.yaml", f"extends: task.yaml\n{names}\n{longer}\n")
    done = compared("names.yaml", "LOG.csv")
    for label in ("velocity", "momentum"):
        run = p.open_run(Path("both") / label)
        at = np.arange(0.0, 11.5)
        off = np.hypot(
            np.interp(at, run["time"], run["x"]) - 0.3 * at,
            np.interp(at, run["time"], run["y"]) - 1.3,
        )
        assert numbers(done, label)[:2] == pytest.approx(
            [math.sqrt(np.mean(off**2)), off.max()], rel=1e-9
        )
    assert done.result.table.rows["log_distance_rms"][0] > 0.1


def test_the_command_draws_it_and_tells_the_numbers(podusv: Command):
    log("LOG.csv", "time,x,y,psi", ROWS)
    podusv("compare", "task.yaml", "LOG.csv", "--out", "both")
    assert {file.name for file in Path("both").iterdir()} >= {"report.html", "velocity", "momentum"}
    assert not Path("both/missing.json").exists()
    assert {"trajectory.png", "errors.png"} <= {f.name for f in Path("both/figures").iterdir()}
    with Path("both/comparison.csv").open() as file:
        rows = {row["metric"]: row for row in csv.DictReader(file)}
    assert set(METRICS) <= rows.keys()
    assert float(rows["log_distance_rms"]["momentum"]) > 0.0
    assert rows["iae"]["LOG"] == ""
    again = podusv(
        "compare", "both/momentum", "LOG.csv", "--json", "--out", "third", "--no-figures"
    )
    runs = json.loads(again.out)["runs"]
    assert [run["controller"] for run in runs] == ["momentum_vector", "measured"]


def test_python_has_the_same():
    log("LOG.csv", "time,x,y,psi", ROWS)
    made = p.compare(["task.yaml", "LOG.csv"], out="made", figures=False)
    assert [*made.table.columns] == ["velocity", "momentum", "LOG"]
    done = compared("task.yaml", "LOG.csv")
    assert made.table.loc["log_distance_rms", "velocity"] == numbers(done, "velocity")[0]
    assert made["LOG"]["x"].tolist() == [row[1] for row in ROWS]


@pytest.mark.long
def test_a_path_that_is_followed_has_no_target_to_be_off(podusv: Command):
    alone = "controllers: null\ncontroller: {kind: alos}\n"
    write("legs.yaml", f"extends: task.yaml\n{LEGS}\n{alone}")
    log("LOG.csv", "time,x,y,psi", ROWS)
    podusv("compare", "legs.yaml", "LOG.csv", "--out", "both", "--figure", "all")
    assert not Path("both/missing.json").exists()


@pytest.mark.long
def test_recorded_commands_have_no_target_and_the_distance_to_the_log_is_the_headline(
    podusv: Command,
):
    """Of a hull at rest in calm water 3 m from the track; the path's target is far away."""
    write("commands.csv", "t,n_1,n_2\n0,0,0\n7.9,0,0\n")
    write(
        "replay.yaml",
        "vessel: {preset: otter}\nactuator: {kind: pod, preset: otter}\ndisturbance: {kind: none}\n"
        "path: {kind: line, speed: 9.0}\ncontroller: {kind: schedule, file: commands.csv}\n"
        "simulation: {duration: 7.9, step: 0.02}\nidentify: {columns: {x: north, y: east}}\n",
    )
    log("LOG.csv", "time,north,east,psi", [[0.7 * i, 0.0, 3.0, 0.2] for i in range(11)])
    said = podusv("compare", "replay.yaml", "LOG.csv", "--out", "both", "--figure", "trajectory")
    assert "warning" not in said.out + said.err
    run = p.open_run(Path("both/schedule"))
    with pytest.raises(KeyError, match="z_e"):
        run["z_e"]
    assert not {"iae", "e_steady", "settling_time"} & {*run.metrics.index}
    with Path("both/comparison.csv").open() as file:
        rows = {row["metric"]: row for row in csv.DictReader(file)}
    assert float(rows["log_distance_rms"]["schedule"]) == pytest.approx(3.0, abs=1e-9)
    answer = Path("both/report.html").read_text().partition('id="answer"')[2]
    first = answer.partition("ms distance from the measured track, at equal times: 3 m")
    assert first[1]
    assert "target" not in first[0]
    assert not Path("both/missing.json").exists()


def test_columns_alone_are_no_logs_to_identify_from(podusv: Command):
    write("names.yaml", "extends: task.yaml\nidentify: {columns: {time: t}}\n")
    said = podusv("identify", "names.yaml")
    assert "names no logs; write them under identify.logs" in said.err


@pytest.mark.parametrize(
    ("items", "head", "says"),
    [
        (["task.yaml", "LOG.csv"], "time,north,east,heading", "write identify.columns in"),
        (["task.yaml", "LOG.csv"], "clock,x,y,psi", "no column is called time"),
        (["task.yaml", "LOG.csv"], "time [min],x,y,psi [furlong]", "is given in 'furlong'"),
        (["task.yaml", "NO.csv"], "time,x,y,psi", "NO.csv: there is no such file"),
        (["task.yaml", "LOG.csv", "LOG.csv"], "time,x,y,psi", "one log at a time"),
        (["LOG.csv"], "time,x,y,psi", "one log at a time"),
    ],
)
def test_what_is_wrong_with_the_log_is_a_sentence(items, head, says):
    log("LOG.csv", head, [[0.0, 0.1, 0.2, 0.3], [1.0, 0.7, 0.9, 0.2]])
    with pytest.raises(PodusvError) as caught:
        compared(*items)
    assert says in str(caught.value)


@pytest.mark.parametrize(
    ("times", "says"),
    [
        (
            [1.78e9 + 0.1 * i for i in range(79)],
            "to 1780000008 s.*with 0 common positions.*another one, --align start takes",
        ),
        (
            [1.78e12 + 1e2 * i for i in range(79)],
            r'in ms since 1970: .*"COLUMN \[ms\]".*--align start if',
        ),
        ([1.78e15 + 1e5 * i for i in range(79)], r'in us since 1970: .*"COLUMN \[us\]"'),
        ([100.0 * i for i in range(79)], r'if its times are in ms, write time: "COLUMN \[ms\]"'),
        ([1e5 * i for i in range(79)], r'if its times are in us, write time: "COLUMN \[us\]"'),
        ([0.8 * i for i in range(9)], "to 6.4 s.*with 9 common positions, where 10 are needed"),
        ([7.0 + 0.101 * i for i in range(79)], "with 9 common positions.*--align start takes"),
        ([0.8 * i for i in range(9)], "needed; take a run that lasts longer"),
        ([7.85 + 0.1 * i for i in range(79)], "with 1 common position, where"),
        ([37_200.0 + 100.0 * i for i in range(79)], r'"COLUMN \[ms\]".*and --align start if'),
        ([5e8 + 20.0 * i for i in range(400)], r'times are in ms, .*"COLUMN \[ms\]"'),
    ],
)
def test_times_that_are_not_those_of_the_run_are_told(times, says):
    log("LOG.csv", "time,x,y,psi", [[t, 0.1 * i, 0.2, 0.3] for i, t in enumerate(times)])
    with pytest.raises(PodusvError, match=says):
        compared("task.yaml", "LOG.csv")


def test_a_track_of_one_position_is_none():
    log("LOG.csv", "time,x,y,psi", [[1.0, 0.1, 0.2, 0.3]])
    with pytest.raises(PodusvError, match=r"fewer than two positions|has 1 row"):
        compared("task.yaml", "LOG.csv")


def test_a_run_that_ends_early_has_no_distance_over_a_few_instants():
    log("LOG.csv", "time,x,y,psi", [[0.79 * i, 0.1 * i, 0.0, 0.0] for i in range(11)])
    made_run()
    run = open_run(Path("run")).recording
    short = replace(run, signals={n: values[:58] for n, values in run.signals.items()})
    known = track(Path("LOG.csv"), ())
    assert short["time"][-1] == pytest.approx(5.7)
    assert known.departures(short) == {"log_instants": 8.0}
    assert known.departures(run).keys() == {*METRICS}


def test_mistakes_that_a_motion_shows_are_refused_as_identify_does():
    write("longer.yaml", "extends: task.yaml\nsimulation: {duration: 30, step: 0.02}\n")
    times = np.arange(0.0, 29.9, 0.1)
    psi = 0.4 + 1.5 * np.sin(0.3 * times)
    x, y = np.cumsum(np.cos(psi)) * 0.1, np.cumsum(np.sin(psi)) * 0.1
    head = "time,x,y,psi,u"
    u = np.ones(len(times))
    log("LOG.csv", head, np.column_stack([times, x, y, psi, u]))
    assert not warnings_of(compared("longer.yaml", "LOG.csv"))
    for changed, says in (
        ([times, x, y, np.degrees(psi) % 360.0, u], r'psi: "COLUMN \[deg\]"'),
        ([times, x, y, psi, u / 0.5144444], r'u: "COLUMN \[kn\]"'),
        ([times, 59.0 + x / 111e3, 10.0 + y / 57e3, psi, u], "x and y .*latitude and longitude"),
        ([times / 3600.0, x, y, psi, u], r'if its times are in hours .*time: "COLUMN \[h\]"'),
    ):
        log("LOG.csv", head, np.column_stack(changed))
        with pytest.raises(PodusvError, match=says):
            compared("longer.yaml", "LOG.csv")


def test_an_empty_heading_is_a_sentence():
    log("LOG.csv", "time,x,y,psi", [[*row[:3], math.nan] for row in ROWS])
    with pytest.raises(PodusvError, match=r"LOG\.csv: psi has no numbers"):
        compared("task.yaml", "LOG.csv")


def test_what_is_doubtful_about_a_log_is_told_and_in_the_report(podusv: Command):
    rows = [",".join(map(str, row)) for row in ROWS]
    write("LOG.csv", "\n".join(["time,x,y,psi", *rows, "6.5,oops,0.2,0.3", ""]))
    said = podusv("compare", "task.yaml", "LOG.csv", "--out", "both", "--no-figures")
    line = "x has 1 cell that is no number, the first 'oops' in line 13; they are left out"
    assert line in " ".join(said.err.split())
    assert "that is no number" in Path("both/report.html").read_text()


def test_a_track_in_other_units_than_the_run_s_is_doubted():
    """Cybership II makes 0.2 m/s or so; no boat of its size makes 60."""
    run = made_run()
    rows = slice(0, 79)
    columns = [run[name][rows] for name in ("time", "x", "y", "psi")]
    log("LOG.csv", "time,x,y,psi", np.column_stack(columns))
    assert warnings_of(compared("run", "LOG.csv")) == []
    columns[1:3] = [30.0 * column for column in columns[1:3]]
    log("LOG.csv", "time,x,y,psi", np.column_stack(columns))
    (line,) = warnings_of(compared("run", "LOG.csv"))
    assert "m/s on average and run" in line
    columns[1:3] = [10.0 * column for column in columns[1:3]]
    log("LOG.csv", "time,x,y,psi", np.column_stack(columns))
    with pytest.raises(PodusvError, match=r"track makes .* m/s, and the boat .* at full thrust"):
        compared("pods.yaml", "LOG.csv")


# Places on earth


@pytest.fixture
def sailed_on_earth():
    """The run's own track as latitude and longitude that begin at its eighth row, 2 s late."""
    run = made_run()
    t, x, y, psi = (run[name][8:68:3] for name in ("time", "x", "y", "psi"))
    lat = 59.0 + (x - x[0]) / 111_393.5  # WGS 84 at 59 deg, from the tables of a degree's length
    lon = 10.0 + (y - y[0]) / 57_477.0
    log("LOG.csv", "time,lat,lon,psi", np.column_stack([t, lat, lon, psi]))
    return run


def test_a_log_on_earth_has_no_common_place_with_a_run(sailed_on_earth):
    done = compared("run", "LOG.csv")
    (line,) = warnings_of(done)
    assert line.startswith("the log and the runs have no common place")
    off = math.hypot(*(sailed_on_earth[name][8] - 0.0 for name in ("x", "y")))
    assert numbers(done, "run")[0] == pytest.approx(off, rel=1e-3)


def test_with_an_origin_a_log_on_earth_lies_where_it_was(sailed_on_earth):
    """Of its run, by the tables of a degree's length; the run's own lat and lon say the same."""
    lat = 59.0 - sailed_on_earth["x"][8] / 111_393.5
    lon = 10.0 - sailed_on_earth["y"][8] / 57_477.0
    write("placed.yaml", f"extends: task.yaml\nname: placed\norigin: {{lat: {lat}, lon: {lon}}}\n")
    p.run(
        "placed.yaml",
        {"controllers": None, "controller": {"kind": "momentum_vector"}},
        out="placed",
        figures=False,
    )
    done = compared("placed", "LOG.csv")
    assert warnings_of(done) == []
    assert numbers(done, "placed")[1] < 1e-3
    own = p.open_run("placed")
    assert own["lat"][8] == pytest.approx(59.0, abs=1e-8)
    assert own["lon"][8] == pytest.approx(10.0, abs=1e-8)
    write("far.yaml", f"extends: placed.yaml\nname: far\norigin: {{lat: {lat + 0.1}}}\n")
    (line,) = warnings_of(compared("far.yaml", "LOG.csv"))
    assert "it lies 11.1 km from" in line
    with pytest.raises(PodusvError, match="origins that differ"):
        compared("placed", "far.yaml", "LOG.csv")
    with pytest.raises(PodusvError, match="no `origin`, which other runs have"):
        compared("placed", "run", "LOG.csv")


def test_a_log_on_earth_is_moved_to_the_run_when_asked(podusv: Command, sailed_on_earth):
    done = compared("run", "LOG.csv", align="place")
    (line,) = warnings_of(done)
    assert line.startswith("--align place moves x by ")
    assert numbers(done, "run")[1] < 1e-4
    measured = done.result.runs[-1].recording
    assert measured["x"][0] == pytest.approx(sailed_on_earth["x"][8], abs=1e-12)
    podusv(
        "compare", "run", "LOG.csv", "--align", "place", "--out", "both", "--force", "--no-figures"
    )
    with Path("both/comparison.csv").open() as file:
        rows = {row["metric"]: row for row in csv.DictReader(file)}
    assert float(rows["log_distance_max"]["run"]) < 1e-4
    made = p.compare(["run", "LOG.csv"], out="made", figures=False, align="place")
    assert made.table.loc["log_distance_max", "run"] < 1e-4


@pytest.mark.long
def test_a_log_is_moved_to_the_first_argument_finished_or_not():
    """Two tasks that begin 5 m apart: the first one named has the log, whichever is a run."""
    made_run()  # of the task, into the folder `run`
    write("aside.yaml", "extends: task.yaml\nname: aside\nstart: {x: 3.0, y: -4.0}\n")
    log("LOG.csv", "time,x,y,psi", ROWS)
    begins = {}
    for items in (("aside.yaml", "run"), ("run", "aside.yaml")):
        done = compared(*items, "LOG.csv", align="start")
        first, *_, measured = (one.recording for one in done.result.runs)
        begins[items[0]] = [measured[name][0] for name in ("x", "y")]
        assert begins[items[0]] == [first[name][0] for name in ("x", "y")]
    assert math.dist(*begins.values()) == pytest.approx(5.0, abs=1e-9)


def test_a_log_in_metres_stays_where_it_is_unless_asked():
    run = made_run()
    columns = np.column_stack([run[name][4:60:5] for name in ("time", "x", "y", "psi")])
    log("LOG.csv", "time,x,y,psi", columns + np.array([0.0, 3.0, -4.0, 0.0]))
    assert numbers(compared("run", "LOG.csv"), "run")[:2] == pytest.approx([5.0, 5.0])
    done = compared("run", "LOG.csv", align="place")
    assert numbers(done, "run")[1] == pytest.approx(0.0, abs=1e-9)
    (line,) = warnings_of(done)
    assert line.startswith("--align place moves x by -3 m, y by +4 m: ")


@pytest.mark.parametrize(
    ("items", "align", "says"),
    [
        (["task.yaml"], "start", "--align start: no log is given that could be moved"),
        (
            ["task.yaml", "LOG.csv"],
            "end",
            "--align end: unknown; write --align start .* --align place",
        ),
    ],
)
def test_aligning_needs_a_log_and_a_word(items, align, says):
    log("LOG.csv", "time,x,y,psi", ROWS)
    with pytest.raises(PodusvError, match=says):
        compared(*items, align=align)


def test_a_log_that_begins_before_the_run_is_moved_by_the_first_common_instant():
    run = made_run()
    t, x, y, psi = (run[name][:75:3] for name in ("time", "x", "y", "psi"))
    before = np.column_stack([[-2.0, -1.0], [50.0, 51.0], [9.0, 9.0], [0.0, 0.0]])
    log("LOG.csv", "time,x,y,psi", [*before, *np.column_stack([t, x + 7.0, y - 2.0, psi])])
    done = compared("run", "LOG.csv", align="place")
    assert numbers(done, "run")[1] == pytest.approx(0.0, abs=1e-9)


# Headings that begin late or end early, and positions of a coarse receiver


def turning(duration=39.9, rate=5.0):
    """Times, x, y, psi of a boat at 1 m/s that turns to both sides."""
    times = np.arange(0.0, duration, 1.0 / rate)
    psi = 0.4 + 1.5 * np.sin(0.3 * times)
    return times, np.cumsum(np.cos(psi)) / rate, np.cumsum(np.sin(psi)) / rate, psi


@pytest.mark.parametrize(("begin", "end"), one_in(3, [(9.1, 21.3), (0.0, 17.0), (11.0, 40.0)]))
def test_a_heading_is_not_held_where_it_has_no_values(begin, end):
    times, x, y, psi = turning()
    known = (times >= begin) & (times <= end)
    log("LOG.csv", "time,x,y,psi", np.column_stack([times, x, y, np.where(known, psi, np.nan)]))
    own = track(Path("LOG.csv"), ())
    assert np.isfinite(own.signals["psi"]).tolist() == known.tolist()
    assert np.isfinite(own.signals["x"]).all()
    (line,) = [remark.text for remark in own.remarks]
    assert line.startswith(f"psi has values from {times[known][0]:.10g} to {times[known][-1]:.10g}")
    write("longer.yaml", "extends: task.yaml\nsimulation: {duration: 39.9, step: 0.02}\n")
    done = compared("longer.yaml", "LOG.csv")
    run = p.open_run(Path("both/momentum"))
    off = psi - np.interp(times, run["time"], run["psi"])
    off = [math.remainder(angle, 2.0 * math.pi) for angle in off[known]]
    expected = math.sqrt(sum(angle**2 for angle in off) / len(off))
    found = numbers(done, "momentum")
    assert found[2:] == pytest.approx([expected, len(times)], rel=1e-6)


def test_fewer_than_ten_headings_are_not_scored():
    times, x, y, psi = turning()
    log(
        "LOG.csv",
        "time,x,y,psi",
        np.column_stack([times, x, y, np.where(times < 1.7, psi, np.nan)]),
    )
    made_run()
    own = track(Path("LOG.csv"), ())
    assert math.isnan(own.departures(open_run(Path("run")).recording)[METRICS[2]])


@pytest.mark.parametrize("turned", [False, True])
def test_a_boat_that_goes_along_an_axis_moves_in_the_other_one(turned):
    """To 1 cm, what hardly changes is no sensor that repeats itself; nor at ten rows a value."""
    times = np.arange(0.0, 60.0, 0.1)
    along, aside = np.round(0.93 * times, 2), np.round(0.004 * times, 2)
    x, y = (along, aside) if turned else (aside, along)
    psi = 0.0 * times + (0.0 if turned else 0.5 * math.pi)
    log("LOG.csv", "time,x,y,psi", np.column_stack([times, x, y, psi]))
    assert track(Path("LOG.csv"), ()).times == pytest.approx(times)
    held = np.arange(len(times)) // 10 * 10
    log("LOG.csv", "time,x,y,psi", np.column_stack([times, x[held], y[held], psi]))
    assert track(Path("LOG.csv"), ()).times == pytest.approx(times[::10])
