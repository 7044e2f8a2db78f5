"""An installed package of components as a wheel, which pip installs elsewhere.

The format: https://packaging.python.org/specifications/binary-distribution-format.
"""

from __future__ import annotations

import base64
import hashlib
import io
import re
import zipfile
from importlib.metadata import distribution

from podusv_cli.core.plugins import Plugin, package_files
from podusv_cli.storage.archive import entry_of

ABOUT = "Wheel-Version: 1.0\nGenerator: podusv\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
TOLD = ("METADATA", "entry_points.txt")  # files about the package that are taken as they are
COMPILED = (".so", ".pyd")  # for one system alone


def name_of(package: str, version: str) -> str:
    """What the wheel of a package is called."""
    return f"{_stem(package, version)}-py3-none-any.whl"


def _stem(package: str, version: str) -> str:
    """The beginning of the names of a package's wheel and of its metadata's folder."""
    return f"{re.sub(r'[-_.]+', '_', package)}-{version}"


def wheel(package: Plugin) -> bytes | None:
    """The bytes of the wheel of an installed package; None for one with compiled modules.

    They depend on the package's files and metadata alone.
    """
    files = {place: path.read_bytes() for place, path in package_files(package).items()}
    if any(place.endswith(COMPILED) for place in files):
        return None
    installed = distribution(package.name)
    stem = _stem(package.name, installed.version)
    told = {name: installed.read_text(name) or "" for name in TOLD} | {"WHEEL": ABOUT}
    files |= {f"{stem}.dist-info/{name}": text.encode() for name, text in told.items()}
    record = f"{stem}.dist-info/RECORD"
    lines = [
        f"{place},sha256={_digest(content)},{len(content)}" for place, content in files.items()
    ]
    files[record] = "\n".join([*lines, f"{record},,", ""]).encode()  # its own digest is left out
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for place, content in files.items():
            archive.writestr(entry_of(place), content)
    return packed.getvalue()


def _digest(content: bytes) -> str:
    """The SHA-256 of a file's content as RECORD has it: in base64 without padding."""
    digest = hashlib.sha256(content).digest()
    return base64.urlsafe_b64encode(digest).decode().rstrip("=")
