"""`examples/my_lab` as an installer leaves it, made without one, so that no network is needed."""

import shutil
import sys
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from command_samples import ROOT

from podusv_cli.core.plugins import installed_plugins

LAB = ROOT / "examples" / "my_lab"


def install(site: Path) -> Path:
    """The package and its .dist-info in the folder `site`, as pyproject.toml describes them."""
    project = tomllib.loads((LAB / "pyproject.toml").read_text())["project"]
    shutil.copytree(LAB / "my_lab", site / "my_lab", ignore=shutil.ignore_patterns("__pycache__"))
    info = site / f"my_lab-{project['version']}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n"
    )
    groups = project["entry-points"].items()
    sections = [
        f"[{group}]\n" + "".join(f"{name} = {place}\n" for name, place in points.items())
        for group, points in groups
    ]
    (info / "entry_points.txt").write_text("\n".join(sections))
    return site


@contextmanager
def importable(site: Path) -> Iterator[None]:
    """Packages in the folder `site` are installed, in this process and its children."""
    with suppress(ImportError):
        import importlib_metadata  # noqa: F401  as Dask does; it replaces Python's own
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(site))
        patch.setenv("PYTHONPATH", str(site), prepend=":")
        installed_plugins.cache_clear()
        yield
    installed_plugins.cache_clear()
    for name in [name for name in sys.modules if name.partition(".")[0] == "my_lab"]:
        del sys.modules[name]
