"""What a scenario takes from elsewhere: vessel files, waypoints, the file's name, shared keys."""

import os
import signal
from importlib.resources import files
from pathlib import Path

import pytest
from scenario_samples import SOUND, VESSEL_NAMES, findings, loaded, told, write

from podusv_cli.components.actuators.pod import Pods
from podusv_cli.components.vessels.vessel import VESSELS, Vessel
from podusv_cli.core.errors import ScenarioError, StorageError
from podusv_cli.scenario import presets
from podusv_cli.scenario.load import load, load_stored, load_text, tree_yaml
from podusv_cli.scenario.point_files import MAX_POINTS
from podusv_cli.scenario.presets import preset_names, preset_values
from podusv_cli.scenario.resolved import resolved_yaml
from podusv_cli.scenario.yaml_tree import plain


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path, monkeypatch):
    """Messages show file names as a user gives them."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sub").mkdir()


@pytest.mark.parametrize("name", preset_names(VESSELS))
def test_a_preset_is_its_file(name):
    faults: list[object] = []
    node = preset_values(VESSELS, name, faults)
    assert node is not None
    assert faults == []
    vessel = loaded(SOUND.replace("preset: paper", f"preset: {name}")).scenario.vessel
    assert vessel == Vessel(preset=name, **plain(node))


def test_a_preset_is_parsed_once_however_many_scenarios_have_it(monkeypatch):
    first, parsed = loaded(SOUND).scenario, []
    monkeypatch.setattr(presets, "read", lambda text, source, *more, **how: parsed.append(source))
    assert loaded(SOUND).scenario == first
    assert not parsed


def test_a_vessel_can_change_some_values_of_its_preset():
    got = loaded(SOUND.replace("preset: paper", "preset: paper, X_u: -2"))
    assert (got.scenario.vessel.X_u, got.scenario.vessel.Y_v) == (-2.0, -0.8896)
    assert got.origins["vessel.X_u"] == "a.yaml:1:30"
    assert got.origins["vessel.Y_v"] == "vessel file paper.yaml"
    assert got.origins["vessel.N_vv"] == "default"


def test_a_nominal_vessel_without_preset_is_the_vessel_but_for_what_it_says():
    got = loaded(SOUND, ["vessel.m=30", "nominal.X_u=-1"]).scenario
    source = got.vessel.source.replace("; m changed", "; m, X_u changed")
    assert source != got.vessel.source
    assert got.nominal == got.vessel.model_copy(update={"X_u": -1.0, "source": source})


def test_a_nominal_vessel_with_preset_starts_from_it():
    got = loaded(SOUND, ["vessel.m=30", "nominal={preset: cybership2, X_u: -1}"]).scenario
    whole = loaded(SOUND.replace("paper", "cybership2")).scenario.vessel
    source = whole.source.removesuffix(".") + "; X_u changed by the scenario."
    assert got.nominal == whole.model_copy(update={"X_u": -1.0, "source": source})


OWN = "length: 2.0, beam: 1.0, m: 60.0, I_z: 20.0, X_u: -9.0"


@pytest.mark.parametrize("given", [OWN, OWN + ", preset: ''"])
def test_a_vessel_without_preset_has_what_it_says_and_no_more(given):
    text = SOUND.replace("preset: paper", given)
    own = Vessel(length=2.0, beam=1.0, m=60.0, I_z=20.0, X_u=-9.0)
    assert loaded(text).scenario.vessel == own
    write("base.yaml", SOUND)
    other = loaded(f"extends: base.yaml\nvessel: {{{given}}}\n").scenario.vessel
    assert (other == own) == ("preset" in given), "without the key it changes what it extends"


@pytest.mark.parametrize("given", [OWN, OWN + ", preset: ''", OWN + ", source: my tank"])
def test_a_nominal_vessel_over_one_without_preset_changes_what_it_says(given):
    text = SOUND.replace("preset: paper", given) + "nominal: {m: 66.0}\n"
    got = loaded(text).scenario
    assert got.nominal == got.vessel.model_copy(update={"m": 66.0})


@pytest.mark.parametrize("given", ["3", "{preset: x}", "{preset: []}", "{preset: 3}", "{m: 3}"])
def test_a_vessel_that_is_wrong_is_told_once_under_a_nominal_vessel(given):
    text = SOUND.replace("{preset: paper}", given)
    assert told(text)
    assert told(text + "nominal: {m: 66.0}\n") == told(text)


def test_a_source_tells_what_the_scenario_changed_and_is_the_same_when_loaded_again():
    changed = loaded(SOUND, ["vessel.I_z=2", "vessel.m=30", "vessel.X_u=-0.72", "vessel.X_uu=0"])
    whole = loaded(SOUND).scenario.vessel.source
    told = whole.removesuffix(".") + "; m, I_z changed by the scenario."
    assert changed.scenario.vessel.source == told
    resolved = resolved_yaml(changed.scenario)
    assert loaded(resolved).scenario == changed.scenario
    assert loaded(resolved, ["vessel.m=23.8", "vessel.I_z=1.76"]).scenario.vessel.source == whole
    own = loaded(SOUND, ["vessel.m=30", "vessel.source=my tank"]).scenario.vessel
    assert own.source == "my tank"


HULL = """\
source: "my tank."
length: 1.37
beam: 0.43
m: 31.7
I_z: 2.91
X_u: -0.83
Y_vdot: -7.1
envelope: {speed: 0.61, drift: 0.9, yaw_rate: 0.37}
"""


def test_a_hull_comes_from_a_file_beside_the_scenario():
    write("sub/hull.yaml", HULL)
    write("sub/a.yaml", SOUND.replace("paper", "hull.yaml, X_u: -1.9"))
    got = load("sub/a.yaml")
    vessel = got.scenario.vessel
    assert (vessel.m, vessel.X_u, vessel.Y_vdot, vessel.X_uu) == (31.7, -1.9, -7.1, 0.0)
    assert vessel.envelope
    assert vessel.envelope.speed == 0.61
    assert vessel.source == "my tank; X_u changed by the scenario."
    assert got.scenario.nominal == vessel
    assert got.origins["vessel.m"] == "sub/hull.yaml:4:4"
    assert got.origins["vessel.X_u"] == "sub/a.yaml:1:34"


def test_what_comes_from_a_file_runs_elsewhere_without_it():
    write("hull.yaml", HULL)
    given = loaded(SOUND.replace("paper", "hull.yaml"), ["nominal.m=33"])
    texts = resolved_yaml(given.scenario), tree_yaml(given)
    Path("hull.yaml").unlink()
    for text in texts:
        assert load_stored(text, "a.yaml").scenario == given.scenario
    other = loaded(texts[1], ["vessel.preset=cybership2"]).scenario.vessel
    assert other == loaded(SOUND.replace("paper", "cybership2")).scenario.vessel


def test_every_section_with_presets_takes_a_file():
    own = (files(Pods.presets.package) / "otter.yaml").read_text("utf-8")
    write("mine.yaml", own.replace("n_max: 16.54", "n_max: 13.7"))
    write("hull.yaml", HULL + "preset: cybership2\n")
    changes = ["actuator.preset=mine.yaml", "nominal={preset: hull.yaml}"]
    got, shipped = loaded(POD_SOUND, changes).scenario, loaded(POD_SOUND).scenario
    assert isinstance(got.actuator, Pods)
    assert isinstance(shipped.actuator, Pods)
    pods = got.actuator.pods, shipped.actuator.pods
    assert [pod.n_max for pod in pods[0]] == [13.7, 13.7]
    assert [pod.T_nn for pod in pods[0]] == [pod.T_nn for pod in pods[1]]
    below = loaded(SOUND.replace("paper", "cybership2")).scenario.vessel
    assert (got.nominal.m, got.nominal.N_vv) == (31.7, below.N_vv), (
        "a file may have a preset itself"
    )


def test_what_is_wrong_with_a_file_of_a_hull_is_told_at_its_place():
    write("hull.yaml", HULL.replace("beam", "bema: 0.43\nbeam").replace("-0.83", "0.83"))
    write("list.yaml", "- 1\n")
    assert told(SOUND.replace("paper", "hul.yaml"))[0].startswith(
        "a.yaml:1:18: vessel.preset: 'hul.yaml' cannot be read: no such file or directory"
    )
    wrong = told(SOUND.replace("paper", "hull.yaml"))
    assert wrong[0].startswith("hull.yaml:3:1: vessel.bema: unknown key; did you mean 'beam'?")
    assert wrong[1].startswith("hull.yaml:7:6: vessel.X_u: must be a number not above 0")
    assert told(SOUND.replace("paper", "list.yaml")) == [
        "a.yaml:1:18: vessel.preset: list.yaml is no vessel file: it has no keys"
    ]


def test_what_podusv_keeps_in_a_folder_names_no_file_of_a_hull():
    write("hull.yaml", HULL)
    text = resolved_yaml(loaded().scenario).replace("preset: paper", "preset: hull.yaml")
    with pytest.raises(StorageError, match=r"a.yaml:5:11: vessel.preset: refers to another file"):
        load_stored(text, "a.yaml")
    whole = resolved_yaml(loaded().scenario)
    taken = load_stored(whole, "a.yaml", ["vessel.preset=hull.yaml"]).scenario.vessel
    assert taken.m == 31.7


def test_a_wrong_nominal_value_is_told_at_its_place():
    assert told(SOUND + "nominal: {X_u: 1, preset: x}\n") == [
        "a.yaml:6:16: nominal.X_u: must be a number not above 0 [kg/s], found 1; it is "
        "negative here, as it is published with the force: -1?",
        "a.yaml:6:27: nominal.preset: unknown vessel 'x' (allowed: " + VESSEL_NAMES + ")",
    ]


def test_the_name_is_that_of_the_file_unless_given():
    assert load_text(SOUND, "dir/my-run.v2.yaml").scenario.name == "my-run.v2"
    assert load_text(SOUND + "name: other\n", "dir/my-run.yaml").scenario.name == "other"


def test_a_file_name_that_is_no_name_is_told():
    with pytest.raises(ScenarioError) as raised:
        load_text(SOUND, "my run.yaml")
    assert str(raised.value) == (
        "my run.yaml: name: cannot be the file's name 'my run'; give one of letters, digits, '_', "
        "'.' and '-', starting with a letter or digit, at most 80 long"
    )


ROUTE = "path: {kind: waypoints, file: route.csv}\n"


def with_route(text: str = ROUTE) -> str:
    return SOUND.replace("path: {kind: line}\n", text)


def test_waypoints_come_from_a_file_beside_the_scenario():
    write("sub/route.csv", 'x, "y"\n# first leg\n0, 0\n\n10.5,-1e1  # bend\n"20",5\n')
    write("sub/a.yaml", with_route())
    got = load("sub/a.yaml")
    assert got.scenario.path.points == ((0.0, 0.0), (10.5, -10.0), (20.0, 5.0))
    assert got.scenario.path.file is None
    assert got.origins["path.points"] == "sub/route.csv"
    assert got.origins["path.file"] == "default"


def test_a_route_is_beside_the_file_that_names_it():
    write("sub/route.csv", "0,0\n1,1\n")
    write("sub/base.yaml", with_route())
    write("a.yaml", "extends: sub/base.yaml\n")
    assert len(load("a.yaml").scenario.path.points) == 2
    assert len(load("a.yaml", ["path.file=sub/route.csv"]).scenario.path.points) == 2


def test_a_file_saved_by_a_spreadsheet_is_read():
    Path("route.csv").write_bytes(b"\xef\xbb\xbfx,y\r\n0,0\r\n3,4\r\n")
    write("a.yaml", with_route())
    assert load("a.yaml").scenario.path.points == ((0.0, 0.0), (3.0, 4.0))


def test_the_header_of_a_route_says_which_column_is_which():
    write("route.csv", "# route\ny [m],x [m]\n0,1\n3,4\n")
    write("a.yaml", with_route())
    assert load("a.yaml").scenario.path.points == ((1.0, 0.0), (4.0, 3.0))


@pytest.mark.parametrize(
    ("rows", "says"),
    [
        ("0,0\n1;1\n", ["route.csv:2:1: must be two numbers x,y [m], found 1 between commas"]),
        (
            "0,0\n1,1,1\n2\n",
            [
                "route.csv:2:1: must be two numbers x,y [m], found 3 between commas",
                "route.csv:3:1: must be two numbers x,y [m], found 1 between commas",
            ],
        ),
        ("nan,0\n1,1\n", ["route.csv:1:1: must be two numbers x,y [m]; the first is no number"]),
        ("0,0\n017,1\n", ["route.csv:2:1: must be two numbers x,y [m]; the first is no number"]),
        ("0,0\n1,\n", ["route.csv:2:1: must be two numbers x,y [m]; the second is no number"]),
        ("0,0\n1e999,1\n", ["route.csv:2:1: path.points[1][0]: must be a number [m], found 1e999"]),
        ("O,5\n1,1\n2,2\n", ["route.csv:1:1: must be two numbers x,y [m]; the first is no number"]),
        (
            "a,b\n0,0\n1,1\n",
            [
                "route.csv:1:1: line 1 of the file names columns that are not x [m], y [m] (in any "
                "order, units may be left out): column 1 is none of these"
            ],
        ),
        ("x,y\n0,0\n", ["a.yaml:2:7: path: needs at least two points, has 1"]),
        ("0,0\n0,0\n", ["a.yaml:2:7: path: two neighbouring points are the same"]),
        ("", ["a.yaml:2:7: path: needs at least two points, has 0"]),
    ],
)
def test_a_wrong_row_is_told_at_its_line(rows, says):
    write("route.csv", rows)
    write("a.yaml", with_route())
    assert findings("a.yaml") == says


def test_faults_of_a_route_end_before_they_fill_the_screen():
    write("route.csv", "a;b\n" * 5000)
    write("a.yaml", with_route())
    assert len(findings("a.yaml")) < 20


def test_a_missing_route_is_told_at_the_key():
    write("a.yaml", with_route())
    (said,) = findings("a.yaml")
    assert said.startswith("a.yaml:2:31: path.file: 'route.csv'")
    assert said.endswith(os.getcwd())


def test_points_and_file_together_are_told():
    write("route.csv", "0,0\n1,1\n")
    write(
        "a.yaml", with_route("path: {kind: waypoints, file: route.csv, points: [[0, 0], [1, 1]]}\n")
    )
    assert findings("a.yaml") == ["a.yaml:2:31: path.file: give either file or points, not both"]


def test_a_route_stays_short_enough_to_be_written_out():
    write("route.csv", "".join(f"{i},0\n" for i in range(MAX_POINTS + 1)))
    write("a.yaml", with_route())
    assert findings("a.yaml") == [f"route.csv: more than {MAX_POINTS:,} points"]


POD_SOUND = SOUND.replace("{kind: ideal}", "{kind: pod, preset: otter}")


def test_pods_come_from_their_file_and_what_is_given_goes_over_it():
    actuator = loaded(POD_SOUND, ["actuator.priority=surge"]).scenario.actuator
    assert isinstance(actuator, Pods)
    assert [pod.y for pod in actuator.pods] == [-0.395, 0.395]
    assert "otter.m" in actuator.source
    own = "[{x: -1, T_nn: 1, T_nn_astern: 1, n_max: 1, n_max_astern: 1, n_rate: 1, n_lag: 1, "
    own += "angle_rate: 1, angle_lag: 1}]"
    (pod,) = loaded(POD_SOUND, [f"actuator.pods={own}"]).scenario.actuator.pods
    assert pod.x == -1.0


def test_what_is_wrong_with_pods_is_one_sentence_at_its_place():
    assert told(POD_SOUND.replace("otter", "oter")) == [
        "a.yaml:4:31: actuator.preset: unknown set of pods 'oter'; did you mean 'otter'? "
        f"(allowed: {', '.join(preset_names(Pods.presets))}, any FILE.yaml)"
    ]
    one = "{x: 0, T_nn: 1, T_nn_astern: 1, n_max: 1, n_max_astern: 1, n_rate: 1, n_lag: 1, "
    one += "angle_rate: 1, angle_lag: 1}"
    (said,) = told(SOUND, [f"actuator={{kind: pod, pods: [{one}]}}"])
    assert "actuator: has no authority" in said
    (said,) = told(SOUND, [f"actuator={{kind: pod, pods: [{one.replace('T_nn: 1', 'T_nn: -1')}]}}"])
    assert "actuator.pods[0].T_nn: " in said
    assert said.endswith(" found -1")
    (said,) = told(SOUND, ["actuator={kind: pod}"])
    assert "actuator.pods: missing; must be a list of" in said


def along(file: str) -> str:
    return f"path: {{kind: waypoints, file: {file}}}\n"


SECRET = "root:x:0:0:root:/root:/bin/sh\n'sync':s3cret,4:65534:sync,/bin\ns3cret,1\n"


@pytest.mark.parametrize("option", ["path.file", "extends", "scenario"])
def test_what_a_file_holds_that_is_no_file_of_podusv_is_not_repeated(option):
    write("passwd", SECRET)
    write("a.yaml", with_route(along("passwd")) if option == "path.file" else "extends: passwd\n")
    said = "\n".join(findings("passwd" if option == "scenario" else "a.yaml"))
    assert "passwd:" in said
    for word in ("root", "s3cret", "sync", "65534"):
        assert word not in said


@pytest.fixture
def patience():
    """What waits for ever is interrupted."""

    def give_up(*_: object) -> None:
        raise TimeoutError("waited for somebody to write")

    before = signal.signal(signal.SIGALRM, give_up)
    signal.alarm(60)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize("special", ["pipe", "/dev/zero", "/dev/tty"])
@pytest.mark.usefixtures("patience")
def test_pipes_and_devices_are_not_waited_for(special):
    os.mkfifo("pipe")
    write("a.yaml", with_route(along(special)))
    write("b.yaml", f"extends: {special}\n")
    for name in ("a.yaml", "b.yaml", special):
        (said,) = findings(name)
        assert "cannot be read: " in said


@pytest.mark.usefixtures("patience")
def test_a_pipe_is_told_what_to_do_instead():
    os.mkfifo("pipe")
    assert findings("pipe") == ["pipe: cannot be read: a pipe or device; save it as a file first"]
