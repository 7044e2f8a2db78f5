"""Costs, names and progress of a comparison."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from comparison_samples import past_run
from known_signals import ABOUT

from podusv_cli.cli import progress
from podusv_cli.cli.progress import progress_bars
from podusv_cli.comparison import outputs
from podusv_cli.core.recording import Recording
from podusv_cli.metrics import cost
from podusv_cli.process.extras import Extras
from podusv_cli.workflows import members


def test_costs_are_median_and_quartiles(monkeypatch):
    clock = iter(range(1, 51))
    monkeypatch.setattr(cost, "replayer", lambda loop, recording: lambda: float(next(clock)))
    first, second = cost.law_costs([(None, None), (None, None)])  # 1, 3 .. 49 and 2, 4 .. 50
    assert first == {"law_ns": 25.0, "law_ns_low": 13.0, "law_ns_high": 37.0}
    assert second == {"law_ns": 26.0, "law_ns_low": 14.0, "law_ns_high": 38.0}


def test_names_are_told_apart():
    assert members.number_names(["a", "a", "a_2", "b", "a"]) == ["a", "a_2", "a_2_2", "b", "a_3"]
    assert members.number_names(["figures", "unit"], outputs.RESERVED) == ["figures_2", "unit_2"]
    assert members.number_names(["pid", "Pid"]) == ["pid", "Pid_2"]


@pytest.mark.slow
def test_drawing_is_progress_too():
    seen = []
    t = np.linspace(0, 1, 5)
    signals = dict.fromkeys(("time", "x", "y", "x_d", "y_d", "psi", "u", "v", "r"), t)
    run = replace(past_run({}), log=Recording("finished", "pid", signals, about=ABOUT))
    result = outputs.Result({}, [run], {}, {}, pd.DataFrame(), [], {}, {})

    def tell(name, fraction):
        seen.append((name, fraction))

    drawn = outputs.draw_comparison(result, Extras(), tell, ("all",))
    assert "velocities.png" in drawn
    assert {name for name, _ in seen} == {"drawing figures"}
    fractions = [fraction for _, fraction in seen]
    assert fractions == sorted(fractions)
    assert (fractions[0], fractions[-1]) == (0.0, 1.0)


def test_there_is_no_bar_without_a_terminal():
    with progress_bars(wanted=True) as advance:
        assert advance is None


def test_what_stays_is_printed_in_place_of_what_is_being_done(monkeypatch, capsys):
    monkeypatch.setattr(progress, "supports_colours", lambda stream: True)
    with progress.StudyLine(wanted=True) as line:
        line.say("looking for gains")
        line.note("64 runs; in results", "and no more")
        line.say("drawing")
        line.warn("other kernels")
    erased = progress.ERASED.replace("\x1b[K", "")  # typer writes codes to terminals only
    assert capsys.readouterr().err == (
        f"{erased}looking for gains{erased}64 runs; in results\nand no more\n"
        f"{erased}drawing{erased}warning: other kernels\n{erased}"
    )


def test_what_stays_is_printed_without_a_terminal_too(capsys):
    with progress.StudyLine(wanted=False) as line:
        line.say("looking for gains")
        line.note("64 runs; in results")
    assert capsys.readouterr().err == "64 runs; in results\n"
