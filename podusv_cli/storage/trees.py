"""HDF5's trees, looked at before HDF5 follows them.

Nodes of the trees in which HDF5 1.8 keeps chunks and the members of old groups have no checksum.
Where a node leads back to one above it, HDF5 descends until its stack is used up and the process
ends.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator

# Signature; version 2; addresses and lengths of 8 bytes. After a byte of flags: no base address.
START, BASE = b"\x89HDF\r\n\x1a\n\x02\x08\x08", slice(12, 20)
NODE, HEAD = b"TREE", 24
ADDRESS = struct.Struct("<Q")
# First child's place behind the head and the way to the next one: members of a group; chunks of
# arrays with one, two and three dimensions.
STRIDES = {0: [(8, 16)], 1: [(24, 32), (32, 40), (40, 48)]}


def check(image: bytes) -> None:
    """ValueError where a file is not built as podusv builds one, or a tree goes round in a circle.

    Every tree ends, if each child lies lower than its parent.
    """
    if not image.startswith(START) or any(image[BASE]):
        raise ValueError("no HDF5 file of the kind that podusv writes")
    levels = {at: image[at + 5] for at in _nodes(image) if image[at + 5]}  # leaves lead nowhere
    for at, level in levels.items():
        if any(levels.get(child, 0) >= level for child in _children(image, at)):
            raise ValueError("an index in it goes round in a circle")


def _nodes(image: bytes) -> Iterator[int]:
    at = image.find(NODE)
    while 0 <= at <= len(image) - HEAD:
        yield at
        at = image.find(NODE, at + 1)


def _children(image: bytes, at: int) -> Iterator[int]:
    """All that can be addresses of a node's children; of how many dimensions, it does not say."""
    kind, count = image[at + 4], int.from_bytes(image[at + 6 : at + 8], "little")
    for first, stride in STRIDES.get(kind, ()):
        places = range(at + HEAD + first, len(image) - ADDRESS.size + 1, stride)
        for place in places[:count]:
            (child,) = ADDRESS.unpack_from(image, place)
            yield child
