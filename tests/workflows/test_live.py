"""`podusv live`: moved values give the numbers of `podusv run`; only this page may move them."""

from __future__ import annotations

import inspect
import json
import re
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from http.client import HTTPConnection, HTTPResponse
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from podusv_cli.process import local_page
from podusv_cli.workflows.live import Live

OWN = "podusv:own_vessel.yaml"
SHORT = ("simulation.duration=20.0",)
# Of every part, at numbers that nobody chose; a hull's also change what the law is told.
MOVED: list[dict[str, float | str]] = [
    {"controller.K_Pu": 77.7},
    {"vessel.m": 51.3, "vessel.X_u": -13.7},
    {"start.psi": -2.13},
    {"path.speed": 0.613, "path.course": 1.9},
    {"actuator.surge_limit": 31.7},
    {"path.kind": "circle", "path.radius": 7.3},
    {"control.period": 0.1125, "simulation.step": 0.0125},
]


def framed(live: Live, moved: Mapping[str, float | str], *, rest: bool) -> dict[str, Any]:
    return live.answer("frame", {"moved": moved, "signals": [], "rest": rest, "controls": False})


@pytest.fixture(scope="module")
def live() -> Live:
    live = Live(OWN, SHORT)
    live.frame({}, (), rest=True, wanted=True)
    return live


@pytest.mark.parametrize("moved", MOVED, ids=lambda moved: next(iter(moved)))
def test_both_ways_to_a_scenario_give_the_numbers_of_run(live: Live, moved, podusv) -> None:
    moving, rest = (framed(live, moved, rest=rest) for rest in (False, True))
    for part in ("numbers", "curves", "chase", "endings", "command"):
        assert moving[part] == rest[part], part
    said = podusv(*rest["command"].split()[1:], "--no-figures", "--out", "r", "--json")
    assert said.code == 0, said.err
    metrics = json.loads(said.out)["metrics"]
    shown = {row["name"]: row["values"][0] for row in rest["numbers"]}
    numbers = {name: x for name, x in shown.items() if isinstance(x, float) and name != "law_ns"}
    assert len(numbers) > 3
    assert numbers == {name: metrics[name] for name in numbers}


EVERY = (
    OWN,
    "podusv:demo.yaml",
    "podusv:mu_2017/corrected.yaml",
    "podusv:pod/kept.yaml",
    "podusv:laws/rivals.yaml",
    "podusv:laws/legs.yaml",
)


def moved_at_random(control: Mapping[str, Any], drawn: np.random.Generator) -> float:
    """A number that a control's slider leads to; one of few figures, as the page sends it."""
    low, high, now = control["low"], control["high"], control["value"]
    far = now * drawn.uniform(0.5, 2.0) if control["log"] else drawn.uniform(low, high)
    quantum = control["quantum"]
    number = float(f"{round(far / quantum) * quantum if quantum else far:.3g}")
    return int(number) if quantum == 1.0 else number


@pytest.mark.slow
@pytest.mark.parametrize("source", EVERY)
def test_every_value_gives_the_same_both_ways(source: str) -> None:
    live, drawn = Live(source), np.random.default_rng(1)
    found = live.frame({}, (), rest=True, wanted=True)["controls"]
    numbers = [one for one in found if not one["choices"]]
    assert len(numbers) > 40
    for control in numbers:
        if control["key"] in ("simulation.duration", "simulation.step"):
            continue
        moved = {control["key"]: moved_at_random(control, drawn)}
        moving, rest = (framed(live, moved, rest=rest) for rest in (False, True))
        if "refused" in rest:
            keys = [[fault["key"] for fault in one["refused"]] for one in (moving, rest)]
            assert keys[0] == keys[1], moved
        else:
            for part in ("numbers", "curves", "chase", "endings", "command"):
                assert moving[part] == rest[part], (moved, part)


def test_a_moved_waypoint_moves_what_counts_as_settled() -> None:
    """The scale of the cross-track error follows the settled part, which begins on the legs."""
    live = Live("podusv:laws/legs.yaml", laws=("velocity_vector", "pid"))
    live.frame({}, (), rest=True, wanted=True)
    moved = {"path.points[0][1]": -8.24}
    moving, rest = (framed(live, moved, rest=rest) for rest in (False, True))
    assert moving["curves"] == rest["curves"]


def test_a_refused_value_has_the_sentence_of_podusv_at_its_key_and_the_page_goes_on(live) -> None:
    for rest in (False, True):
        answer = framed(live, {"vessel.X_u": 200.0}, rest=rest)
        (fault,) = answer["refused"]
        assert fault["key"] == "vessel.X_u"
        assert "must be a number not above 0 [kg/s]" in fault["text"]
    assert "refused" not in framed(live, {}, rest=False)


def test_what_is_saved_is_what_is_shown(live: Live, podusv) -> None:
    moved = {"controller.K_Pu": 77.7, "vessel.m": 51.3, "start.psi": -2.13}
    saved = live.answer("save", {"moved": moved, "name": "mine"})
    assert saved["command"] == "podusv run mine.yaml"
    assert podusv("run", "mine.yaml", "--no-figures", "--out", "r").code == 0
    other = framed(live, moved, rest=True)["command"].split()[1:]
    assert podusv(*other, "--no-figures", "--out", "s").code == 0
    with h5py.File("r/log.h5") as saved_log, h5py.File("s/log.h5") as shown_log:
        arrays = [
            {name: x[()] for name, x in log.items() if isinstance(x, h5py.Dataset)}
            for log in (saved_log, shown_log)
        ]
    assert arrays[0].keys() == arrays[1].keys()
    for name, array in arrays[0].items():
        np.testing.assert_array_equal(array, arrays[1][name])
    again = live.answer("save", {"moved": moved, "name": "mine"})["refused"][0]["text"]
    assert again == "mine.yaml is there already; take another name"


@pytest.mark.parametrize("name", ["../evil", "a/b", "", "a.yaml", "a\n", "/tmp/x", "-"])
def test_a_name_that_is_none_writes_nothing(live: Live, name: str, podusv) -> None:
    before = sorted(Path().rglob("*"))
    assert "is no name" in live.answer("save", {"moved": {}, "name": name})["refused"][0]["text"]
    assert sorted(Path().rglob("*")) == before


@pytest.mark.parametrize(
    "moved",
    [
        {"plugins.x.py": "evil.py"},
        {"extends": "evil.yaml"},
        {"name": "x"},
        {"path.kind": "../x"},
        {"controller.K_Pu": "{evil}"},
        {"controller.K_Pu": [1.0]},
        {"disturbance.file": "secret.csv"},
    ],
)
def test_only_what_was_offered_may_move(live: Live, moved: dict[str, Any]) -> None:
    (refused,) = live.answer(
        "frame", {"moved": moved, "signals": [], "rest": True, "controls": False}
    )["refused"]
    assert "not among the values that this page moves" in refused["text"]


@pytest.fixture
def address() -> Iterator[tuple[str, str]]:
    """Host and path of a page that is served, which Ctrl-C ends with exit code 130."""
    command = [sys.executable, "-m", "podusv_cli", "live", OWN, "--no-open", "--set", *SHORT]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout
        found = re.search(r"http://([^/]+)(/\S+)", process.stdout.readline())
        assert found
        try:
            yield found[1], found[2]
            process.send_signal(signal.SIGINT)
            assert process.wait(30) == 130
        finally:
            process.kill()


QUESTION = json.dumps({"moved": {}, "signals": [], "rest": False, "controls": False})


def asked(host: str, path: str, headers: Mapping[str, str], body: str = QUESTION) -> int:
    connection = HTTPConnection(host, timeout=60)
    connection.request("POST", path, body, {"Content-Type": "application/json", **headers})
    return connection.getresponse().status


@pytest.mark.long
def test_the_page_is_answered_under_its_own_name_alone(address: tuple[str, str]) -> None:
    host, base = address
    assert host.startswith("127.0.0.1:")
    own = f"http://{host}"
    assert asked(host, f"{base}frame", {"Origin": own}) == 200
    assert asked(host, f"{base}frame", {}) == 200
    refused = {
        "another page": ({"Origin": "http://evil.example"}, f"{base}frame", QUESTION),
        "a page of no origin": ({"Origin": "null"}, f"{base}frame", QUESTION),
        "a foreign name": ({"Host": "evil.example"}, f"{base}frame", QUESTION),
        "a form": ({"Content-Type": "text/plain"}, f"{base}frame", QUESTION),
        "no token": ({}, "/frame", QUESTION),
        "another token": ({}, f"/{'x' * (len(base) - 2)}/frame", QUESTION),
        "no question": ({}, f"{base}frame", "{"),
    }
    codes = {what: asked(host, path, sent, body) for what, (sent, path, body) in refused.items()}
    assert all(code in (400, 403, 404) for code in codes.values()), codes
    assert asked(host, f"{base}frame", {"Origin": own}) == 200  # and goes on


@pytest.mark.long
def test_the_page_names_no_other_place(address: tuple[str, str]) -> None:
    host, base = address
    connection = HTTPConnection(host, timeout=60)
    connection.request("GET", base)
    answer = connection.getresponse()
    page, policy = answer.read().decode(), answer.getheader("Content-Security-Policy") or ""
    assert answer.status == 200
    assert "default-src 'none'" in policy
    assert "frame-ancestors 'none'" in policy
    assert not re.search(r"""(src|href)=["']?(https?:)?//""", page)


@pytest.fixture
def served(capfd: pytest.CaptureFixture[str]) -> Iterator[tuple[str, str]]:
    """Host and path of a page that answers what it was asked; nothing is said in the terminal."""
    told, begun = list[str](), threading.Event()

    def answer(name: str, asked: Mapping[str, Any]) -> Mapping[str, Any]:
        if name == "end":
            raise KeyboardInterrupt  # as Ctrl-C does
        return {"name": name, "asked": asked, "value": {"set": {1}}.get(name, 0.5)}

    def started(address: str) -> None:
        told.append(address)
        begun.set()

    def serve() -> None:
        with suppress(KeyboardInterrupt):
            local_page.serve(lambda base: base, answer, started)

    page = threading.Thread(target=serve)
    page.start()
    assert begun.wait(10)
    host, base = told[0].removeprefix("http://").split("/", 1)
    yield host, f"/{base}"
    with suppress(OSError):  # it ends before it answers
        answered(host, "POST", f"/{base}end", None, b"{}", patience=0.1)
    page.join(10)
    assert not page.is_alive()
    left = [thread.name for thread in threading.enumerate() if "serve_forever" in thread.name]
    assert not left, "it spins on a socket that is closed"
    assert capfd.readouterr() == ("", "")


QUESTIONS = {  # method, path behind the token, length that is said, body, code
    "good": ("POST", "x", None, b"{}", 200),
    "no page": ("GET", "x", None, b"", 404),
    "a path of other letters": ("GET", "\xff\xfe", None, b"", 404),
    "a length of letters": ("POST", "x", "x", b"{}", 400),
    "a length below 0": ("POST", "x", "-1", b"{}", 400),
    "no length": ("POST", "x", "", b"", 400),
    "too long": ("POST", "x", "65537", b"{}", 413),
    "far too long": ("POST", "x", "9" * 17, b"{}", 413),
    "deeply nested": ("POST", "x", None, b"[" * 60_000, 400),
    "deep mappings": ("POST", "x", None, b'{"a":' * 13_000, 400),
    "a list": ("POST", "x", None, b"[]", 400),
    "a number": ("POST", "x", None, b"1", 400),
    "no text": ("POST", "x", None, b"\xff", 400),
    "no number in the answer": ("POST", "x", None, b'{"a": NaN}', 500),
    "no value in the answer": ("POST", "set", None, b"{}", 500),
}


def answered(
    host: str, method: str, path: str, said: str | None, body: bytes, patience: float = 2.0
) -> tuple[int, str]:
    """Code and text of the answer to a question as it stands, in this time [s]."""
    length = str(len(body)) if said is None else said
    lines = [f"{method} {path} HTTP/1.1", f"Host: {host}", "Content-Type: application/json"]
    lines += [f"Content-Length: {length}"] if length else []
    name, _, port = host.partition(":")
    with socket.create_connection((name, int(port)), timeout=patience) as connection:
        connection.sendall("\r\n".join([*lines, "", ""]).encode("latin-1") + body)
        answer = HTTPResponse(connection, method=method)
        answer.begin()
        return answer.status, answer.read().decode()


@pytest.mark.parametrize("question", QUESTIONS)
@pytest.mark.parametrize("is_known", [True, False])
def test_every_question_is_answered_and_the_page_goes_on(
    served: tuple[str, str], question: str, is_known: bool
) -> None:
    host, base = served
    method, path, said, body, code = QUESTIONS[question]
    found, text = answered(host, method, f"{base if is_known else '/'}{path}", said, body)
    assert found == (code if is_known else 404)
    assert text
    assert "<" not in text
    assert answered(host, "POST", f"{base}x", None, b"{}")[0] == 200


@pytest.mark.parametrize("resets", [True, False])
def test_a_browser_that_leaves_before_its_answer_prints_nothing(
    served: tuple[str, str], capfd: pytest.CaptureFixture[str], resets: bool
) -> None:
    """Reset, as a browser that is killed, or closed while answers are on their way."""
    host, base = served
    name, _, port = host.partition(":")
    question = f"POST {base}x HTTP/1.1\r\nHost: {host}\r\nContent-Type: application/json\r\n"
    asked = f"{question}Content-Length: 2\r\n\r\n{{}}".encode()
    with socket.create_connection((name, int(port)), timeout=2.0) as connection:
        if resets:
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        connection.sendall(asked * (1 if resets else 500))
    assert answered(host, "POST", f"{base}x", None, b"{}")[0] == 200
    time.sleep(0.5)  # the other thread has found out by now
    assert capfd.readouterr() == ("", "")


def test_what_goes_wrong_but_for_that_is_printed(capfd: pytest.CaptureFixture[str]) -> None:
    server = local_page._Server(0, lambda base: base)
    with server:
        for error in (BrokenPipeError(), ConnectionResetError(), ZeroDivisionError("seen")):
            try:
                raise error
            except (OSError, ArithmeticError):
                server.handle_error(None, ("here", 1))
    said = capfd.readouterr().err
    assert "ZeroDivisionError: seen" in said
    assert "BrokenPipe" not in said
    assert "Reset" not in said


def test_a_path_of_other_letters_is_no_token(served: tuple[str, str]) -> None:
    assert answered(served[0], "GET", "/\xff\xfe" + "\xe9" * 40, None, b"")[0] == 404


def test_a_question_that_lacks_something_is_answered_in_a_sentence(live: Live) -> None:
    (refused,) = live.answer("frame", {"moved": {}})["refused"]
    assert refused["text"] == "the question lacks signals, rest, controls"


def test_a_value_that_moves_has_no_source_code_looked_at(live: Live, monkeypatch) -> None:
    """To find where a class is written takes as long as a run; only an error says it."""
    framed(live, {"controller.K_Pu": 78.0}, rest=False)
    looked_at = []
    monkeypatch.setattr(inspect, "getsourcelines", lambda obj: looked_at.append(obj) or ([], 1))
    assert "refused" not in framed(live, {"controller.K_Pu": 79.0}, rest=False)
    assert looked_at == []
