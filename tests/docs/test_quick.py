"""`make quick`: which tests are nearest to a change."""

import pytest
import quick


@pytest.fixture(scope="module")
def graph():
    """Made once; it takes two seconds."""
    return quick.users()


@pytest.mark.parametrize(
    ("file", "tests"),
    [
        ("podusv_cli/studies/counting/statistics.py", {"test_study_statistics"}),  # imported
        ("podusv_cli/components/estimators/ekf.py", {"test_estimators_ekf"}),  # by its kind
        ("podusv_cli/cli/margins.py", {"test_margins"}),  # a command by its name
        ("podusv_cli/verification/verify.py", {"test_verify"}),  # by a name of Python users
        ("tests/studies/tuning/tune_samples.py", {"test_tune", "test_tune_idle"}),
        ("tests/components/actuators/test_pod.py", {"test_pod"}),
        ("docs/metrics.md", {"test_docs"}),
    ],
)
def test_the_nearest_are_found_by_imports_and_by_names(graph, monkeypatch, file, tests):
    monkeypatch.setattr(quick, "users", lambda: graph)
    found = [path.stem for path in quick.nearest([quick.node(file)])]
    assert tests <= {*found[:25]}
    assert len(found) < len([*quick.ROOT.glob("tests/**/test_*.py")]), "it chooses"


def test_of_equally_near_files_those_of_the_room_come_first(graph, monkeypatch):
    monkeypatch.setattr(quick, "users", lambda: graph)
    found = [*quick.nearest([quick.node("podusv_cli/engine/step/rk4.py")])]
    assert [path.parent.name for path in found[:4]] == ["engine"] * 4  # not components first


def test_nothing_is_near_to_what_nothing_uses(graph, monkeypatch):
    monkeypatch.setattr(quick, "users", lambda: graph)
    assert not [*quick.nearest(["nobody_uses_this.txt"])]
