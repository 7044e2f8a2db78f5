"""Make run folders of this podusv's format, to be read by all that come after.

    python tests/old_runs.py

For every scenario in SCENARIOS an archive and, in plain text, the numbers that it holds, as h5py
finds them, into tests/fixtures/format_<number>. What is there already stays as it is.
"""

import gzip
import io
import json
import tarfile
import tempfile
from pathlib import Path
from typing import Any

import h5py
from rerun_samples import copied, made
from storage_samples import files

from podusv_cli.storage import json_files, manifest

BASE = """
vessel: {preset: paper_nonlinear}
path: {kind: line_circle}
disturbance: {kind: harmonic}
start: {x: -5.0, y: -2.0, u: 0.3}
simulation: {duration: 0.2, step: 0.01, compiled: false}
log: {every: 5}
"""
SCENARIOS = {
    "adaptive_neural": BASE + "actuator: {kind: saturated}\ncontroller: {kind: adaptive_neural}\n",
    "pid": BASE + "actuator: {kind: saturated}\ncontroller: {kind: pid}\n",
    "diverged": BASE.replace("every: 5", "every: 1")
    + "actuator: {kind: ideal}\ncontroller: {kind: pid, K_Pu: 2e+4}\n",
    "pods": BASE + "actuator: {kind: pod, preset: cybership2_pod, neglect_sway_force: false}\n"
    "controller: {kind: dsc, anti_windup: auxiliary}\n",
}  # fmt: skip
# In place of what tells where and when it was made.
ORIGIN = {
    "platform": {"system": "Linux", "machine": "x86_64"}, "git": None, "argv": ["podusv", "run"],
    "started": "2026-01-01T00:00:00.000+00:00", "finished": "2026-01-01T00:00:01.000+00:00",
    "duration_s": 1.0,
}  # fmt: skip


def _anonymous(content: bytes) -> bytes:
    return json_files.encode(json.loads(content) | ORIGIN)


def _packed(folder: Path) -> bytes:
    """The folder as an archive; the same files give the same bytes."""
    archive = io.BytesIO()
    with tarfile.open(fileobj=archive, mode="w") as tar:
        for name, content in sorted(files(folder).items()):
            entry = tarfile.TarInfo(name)
            entry.size = len(content)
            tar.addfile(entry, io.BytesIO(content))
    return gzip.compress(archive.getvalue(), mtime=0)


def _numbers(folder: Path) -> dict[str, Any]:
    """What has to be read from the folder."""
    with h5py.File(folder / "log.h5") as file:
        arrays = {name: dataset[()].tolist() for name, dataset in file.items()
                  if isinstance(dataset, h5py.Dataset) and dataset.dtype == "<f8"}  # fmt: skip
        facts = {name: file.attrs[name].decode() for name in ("status", "controller")}
    metrics = json.loads((folder / "metrics.json").read_text())["metrics"]
    return {**facts, "metrics": metrics, "arrays": arrays}


def main() -> None:
    """Make what is missing."""
    place = Path(__file__).with_name("fixtures") / f"format_{manifest.FORMAT}"
    place.mkdir(parents=True, exist_ok=True)
    for name, text in SCENARIOS.items():
        if (place / f"{name}.tar.gz").exists():
            continue
        with tempfile.TemporaryDirectory() as room:
            run = made(Path(room) / name, text=f"name: {name}\n{text}")
            status = manifest.read(run).status
            run = copied(run, Path(room) / "kept", status, provenance_json=_anonymous)
            (place / f"{name}.tar.gz").write_bytes(_packed(run))
            (place / f"{name}.json").write_text(json.dumps(_numbers(run), indent=1) + "\n")


if __name__ == "__main__":
    main()
