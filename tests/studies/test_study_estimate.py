"""A study that fits neither on the disk nor into memory."""

from types import SimpleNamespace

from small_study import written


def test_a_study_that_cannot_fit_is_refused_before_the_first_run(tmp_path, podusv, monkeypatch):
    config = written(tmp_path / "small.yaml")
    out, draws = tmp_path / "results/study", 1_000_000_000
    said = podusv("sweep", "run", config, "--out", out, "--draws", draws)
    assert said.code == 5
    assert "2,000,000,000 runs (sweep.draws: 1,000,000,000) were asked for" in said.err
    assert not out.exists()
    valid = podusv("validate", config, "--set", f"sweep.draws={draws}")
    assert (valid.code, valid.out) == (5, "")
    assert valid.err == said.err.replace(str(out), "results/small-sweep")
    free = SimpleNamespace(free=1e15)
    monkeypatch.setattr("podusv_cli.storage.run_folder.shutil.disk_usage", lambda path: free)
    monkeypatch.setattr("podusv_cli.studies.making.estimate.physical_memory", lambda: 10**10)
    said = podusv("sweep", "run", config, "--out", out, "--draws", draws)
    assert said.code == 5
    assert "its tables take 64 GB of memory or more, and this machine has 10 GB" in said.err
    assert not out.exists()
