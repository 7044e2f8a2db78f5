"""Ways to damage a finished run: each changes its folder, by an argument in words."""

import io
import json
import os
import random
import socket
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np

Damage = Callable[[Path, str], None]
Change = Callable[[h5py.File], object]
LOG = "log.h5"
PIPE = "pipe"  # beside the folder: whoever reads there waits for ever


def flip(folder: Path, argument: str) -> None:
    """`name seed`: turn a bit anywhere in a file."""
    name, seed = argument.split()
    data = bytearray((folder / name).read_bytes())
    bit = random.Random(int(seed)).randrange(8 * len(data))
    data[bit >> 3] ^= 1 << (bit & 7)
    (folder / name).write_bytes(data)


def cut(folder: Path, argument: str) -> None:
    """`name length`: leave the first bytes of a file."""
    name, length = argument.split()
    os.truncate(folder / name, int(length))


def become(folder: Path, argument: str) -> None:
    """`name what`: put something else in place of a file."""
    name, what = argument.split()
    (folder / name).unlink()
    OTHERS[what](folder / name)


def _socket(path: Path) -> None:
    before = os.getcwd()
    os.chdir(path.parent)  # names of sockets are short
    with socket.socket(socket.AF_UNIX) as end:
        end.bind(path.name)
    os.chdir(before)


OTHERS: dict[str, Callable[[Path], object]] = {
    "nothing": lambda path: None,
    "folder": Path.mkdir,
    "pipe": os.mkfifo,
    "socket": _socket,
    "device": lambda path: path.symlink_to("/dev/zero"),  # a device of one's own takes root
    "link": lambda path: path.symlink_to(path.parent.parent / PIPE),
    "hole": lambda path: (path.touch(), os.truncate(path, 2**40)),
    "empty": Path.touch,
    "zeros": lambda path: path.write_bytes(bytes(100_000)),
    "noise": lambda path: path.write_bytes(random.Random(1).randbytes(100_000)),
}


def text(folder: Path, argument: str) -> None:
    """`name which`: put a text in place of a file."""
    name, which = argument.split()
    content = TEXTS[which]
    if "{whole}" in content:
        whole = (folder / name).read_text().strip()
        content = content.replace("{whole}", whole.removeprefix("{").removesuffix("}"))
    (folder / name).write_bytes(content.encode("utf-8", "surrogateescape"))


# `{whole}` stands for what is between the outer brackets of the file as it was.
TEXTS = {
    "list": "[]",
    "open": "{{whole}",
    "twice": "{{whole}}{}",
    "no_text": "{\udcff}",
    "zero": "{{whole}, \0}",
    "deep": "[" * 100_000,
    "nan": '{{whole}, "a": NaN}',
    "large": '{{whole}, "a": 1e999}',
    "digits": '{{whole}, "a": ' + "9" * 1_000_000 + "}",
    "same": '{{whole}, "a": 1, "a": 2}',
    "escape": '{{whole}, "\\u001b[2J\\n": 1}',
    "long": '{{whole}, "a": "' + "a" * 20_000_000 + '"}',
}


def entry(folder: Path, argument: str) -> None:
    """`name a.b value`: set an entry of a JSON file, the value in JSON, or drop it."""
    name, route, value = argument.split(maxsplit=2)
    content = json.loads((folder / name).read_text())
    *above, last = route.split(".")
    place = content
    for key in above:
        place = place[key]
    if value == "drop":
        del place[last]
    else:
        place[last] = json.loads(value)
    (folder / name).write_text(json.dumps(content))


def yaml(folder: Path, argument: str) -> None:
    """`which`: put a text in place of the resolved scenario, or in front of it."""
    path = folder / "resolved.yaml"
    content = YAML[argument].replace("{pipe}", str(folder.parent / PIPE))
    path.write_text(content.replace("{whole}", path.read_text()), errors="surrogateescape")


YAML = {
    "empty": "",
    "open": "{a: [",
    "no_text": "a: \udcff",
    "deep": "a: " + "[" * 100_000,
    "aliases": "a: &a [1]\nb: [*a, *a]\n{whole}",
    "extends": "extends: {pipe}\n{whole}",
    "file": "path: {kind: waypoints, file: {pipe}}\n",
    "escaped": '"\\e[2J": 1\n{whole}',
    "tag": "a: !!python/object/apply:os.abort []\n{whole}",
}


def hdf5(folder: Path, argument: str) -> None:
    """`which`: change the log as a program with HDF5 can."""
    content = io.BytesIO((folder / LOG).read_bytes())
    with h5py.File(content, "r+") as file:
        HDF5[argument](file, folder.parent / PIPE)
    (folder / LOG).write_bytes(content.getvalue())


def _linked(name: str, link: Callable[[Path], object]) -> Callable[[h5py.File, Path], object]:
    def change(file: h5py.File, pipe: Path) -> None:
        if name in file:
            del file[name]
        file[name] = link(pipe)

    return change


def _external(file: h5py.File, pipe: Path) -> None:
    shape = file["u"].shape
    del file["u"]
    file.create_dataset("u", shape, dtype="<f8", external=[(str(pipe), 0, 8 * shape[0])])


HDF5: dict[str, Callable[[h5py.File, Path], object]] = {
    "external": _external,
    "external_link": _linked("u", lambda pipe: h5py.ExternalLink(str(pipe), "/u")),
    "external_provenance": _linked("provenance", lambda pipe: h5py.ExternalLink(str(pipe), "/")),
}


def foreign(folder: Path, argument: str) -> None:
    """`which`: a file of another program in place of the log."""
    (folder / LOG).unlink()
    FOREIGN[argument](folder / LOG)


def _table(path: Path) -> None:
    with h5py.File(path, "w", libver="latest") as file:
        file["data/values"] = np.zeros((100, 100))


FOREIGN: dict[str, Callable[[Path], object]] = {
    "table": _table,
    "signature_and_noise": lambda path: path.write_bytes(
        b"\x89HDF\r\n\x1a\n" + random.Random(2).randbytes(5000)
    ),
    "picture": lambda path: path.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100)),
}


DAMAGES: dict[str, Damage] = {
    f.__name__: f for f in (flip, cut, become, text, entry, yaml, hdf5, foreign)
}
