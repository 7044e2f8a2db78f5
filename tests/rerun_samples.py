"""A finished run made in a second without a compiler, and copies of it with a planted change."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scenario_samples import SOUND
from storage_samples import files, log

import podusv_cli
from podusv_cli.core import json_text
from podusv_cli.core.recording import Recording, Status
from podusv_cli.storage import log_reader
from podusv_cli.storage.run_folder import RunWriter
from podusv_cli.workflows import run

SCENARIO = SOUND + "name: sample\nsimulation: {step: 0.01, duration: 0.5, compiled: false}\n"


def made(folder: Path, *overrides: str, text: str = SCENARIO) -> Path:
    """The run folder of this scenario."""
    config = folder.with_suffix(".yaml")
    config.write_text(text)
    return run.run(config, run.Request(overrides, folder, figures=False)).folder


def copied(
    folder: Path, target: Path, status: Status = "finished", **changes: Callable[[bytes], bytes]
) -> Path:
    """A finished copy, manifest included, with changed files: `log_h5` changes log.h5."""
    with RunWriter(target) as writer:
        for name, content in files(folder).items():
            if name != "manifest.json":
                change = changes.pop(name.replace(".", "_"), lambda content: content)
                writer.add(name, change(content))
        assert not changes
        return writer.finish(status)


def relogged(folder: Path, change: Callable[[dict[str, Any]], None]) -> Callable[[bytes], bytes]:
    """A change of log.h5: `change` works on its signals by name."""
    recorded: Recording = log_reader.read_log(folder / "log.h5")
    signals = {name: np.array(array) for name, array in recorded.signals.items()}
    change(signals)
    texts = {
        "resolved_yaml": log_reader.resolved_yaml(folder / "log.h5"),
        "title": "t",
        "source": "s",
        "version": podusv_cli.__version__,
    }
    return lambda _: log(replace(recorded, signals=signals), **texts)


def flip(array: Any, row: int) -> None:
    """Turn the last bit of a number."""
    array.view(np.int64)[row] ^= 1


def told_otherwise(**facts: Any) -> Callable[[bytes], bytes]:
    """A change of a JSON file: these packages' versions."""

    def change(content: bytes) -> bytes:
        told = json.loads(content)
        told["packages"] |= facts
        return json_text.encode(told)

    return change


def replaced(old: str, new: str) -> Callable[[bytes], bytes]:
    """A change of a text file."""

    def change(content: bytes) -> bytes:
        text = content.decode()
        assert old in text
        return text.replace(old, new).encode()

    return change
