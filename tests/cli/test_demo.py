"""`podusv demo`: what a newcomer sees first."""

from __future__ import annotations

import webbrowser
from pathlib import Path

import pandas as pd
import pytest
from command_samples import Command

from podusv_cli.cli import demo
from podusv_cli.core import system
from podusv_cli.workflows import compare


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Addresses that a browser was asked for; there is no display."""
    asked: list[str] = []
    monkeypatch.setattr(webbrowser, "open", lambda address: not asked.append(address))
    for name in system.DISPLAYS:
        monkeypatch.delenv(name, raising=False)
    return asked


def test_a_page_is_opened_where_there_is_a_display_and_always_named(
    opened: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    demo._open(Path("c/report.html"), True)
    assert (opened, capsys.readouterr().out) == ([], "open this page in a browser: c/report.html\n")
    monkeypatch.setenv("DISPLAY", ":0")
    demo._open(Path("c/report.html"), False)
    assert opened == []
    demo._open(Path("c/report.html"), True)
    assert opened == [Path("c/report.html").resolve().as_uri()]
    assert capsys.readouterr().out.endswith("\nopened c/report.html\n")


def test_there_is_something_to_read_before_anything_is_computed(
    podusv: Command, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def told_first(*given: object) -> None:
        assert "    controllers:\n      pid_winds_up: {" in capsys.readouterr().out
        raise KeyboardInterrupt

    monkeypatch.setattr(compare, "compare", told_first)
    assert podusv("demo", "--out", "d").code == 130


@pytest.mark.slow
def test_the_demo_shows_what_it_says(podusv: Command, opened: list[str]) -> None:
    said = podusv("demo", "--out", "d")
    assert said.code == 0
    table = pd.read_csv("d/comparison.csv", index_col=0)
    assert table.loc["e_steady", "pid"] < 0.1 * table.loc["e_steady", "pid_winds_up"]
    assert table.loc["settling_time", "momentum_vector"] < table.loc["settling_time", "pid"]
    assert len(Path("d/report.html").read_text()) > 100_000
    assert "d/report.html" in said.out
    shown = [line.split("  ")[1] for line in said.out.splitlines()[-3:]]
    assert [podusv(*words.split()[1:]).code for words in shown] == [0, 0, 0]
