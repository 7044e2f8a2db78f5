"""A signal in `podusv.simulate_many` ends the loop around it, and runs that are done are kept."""

import signal
import subprocess
import sys

import pytest

SWEEP = """
import podusv
scenario = podusv.load("podusv:own_vessel.yaml", {"simulation.duration": 3000.0})
podusv.simulate_many(scenario, {"vessel.m": [50.0]})
print("begun", flush=True)
for turn in range(20):
    try:
        podusv.simulate_many(scenario, {"vessel.m": [50.0 + i for i in range(400)]}, workers=1)
    except KeyboardInterrupt as stop:
        runs = stop.runs
        words = runs["status"].value_counts()
        assert {*words.index} <= {"finished", "interrupted"}, words
        done = runs[runs["status"] == "finished"]
        assert done["iae"].notna().all()
        print(f"kept {len(done)} of {len(runs)} in turn {turn}: {stop}", flush=True)
        raise
"""


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_in_a_batch_ends_the_loop_around_it(number, tmp_path):
    command = [sys.executable, "-c", SWEEP]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, cwd=tmp_path) as child:
        assert child.stdout.readline() == "begun\n"
        with pytest.raises(subprocess.TimeoutExpired):
            child.wait(0.5)
        child.send_signal(number)
        try:
            out, err = child.communicate(timeout=20)
        finally:
            child.kill()
    (kept,) = out.splitlines()
    assert " of 400 in turn " in kept
    assert kept.endswith(" of 400 runs are finished, in the attribute `runs` of this exception")
    assert err.splitlines()[-1].startswith("KeyboardInterrupt: interrupted; ")
    assert child.returncode == -signal.SIGINT  # as Python ends after KeyboardInterrupt
