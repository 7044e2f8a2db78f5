"""Chunks packed as HDF5's filters shuffle, deflate and Fletcher would, in a third of the time.

Shuffled, the numbers of a chunk lie in planes: all first bytes, all second bytes, and so on. Most
planes of a computed signal are noise, on which deflate spends its time and gains nothing. They are
stored as they are, which a deflate stream may do; every reader unpacks the result.

Unpacked here, too, a chunk can neither hold more than it should nor less. HDF5's deflate makes room
for whatever comes out, be it gigabytes, and reads on behind what is too short.
"""

from __future__ import annotations

import math
import zlib

import numpy as np

from podusv_cli.core.kernel import Vector

LEVEL = 1  # of the planes that are worth it; 4 takes half as long again for 1 % of the file
SAMPLE = 1024  # bytes at a plane's begin, middle and end that are looked at
WORTH = 1.2  # times as often as in noise two bytes of the sample have to be the same
RAW = -zlib.MAX_WBITS  # a deflate stream without head and sum, to be put together
HEAD = b"\x78\x5e"  # of a zlib stream
MODULUS = 0xFFFF
BLOCK = 512  # words that are added at a time
CHECKSUM = 4  # bytes that Fletcher's adds to a chunk


def packed(numbers: Vector) -> bytes:
    """A chunk of float64 as it lies in the file, for `write_direct_chunk`."""
    little = np.ascontiguousarray(numbers, dtype="<f8")
    planes = np.ascontiguousarray(little.reshape(-1).view(np.uint8).reshape(-1, 8).T)
    parts = [_deflated(memoryview(plane), last=i == 7) for i, plane in enumerate(planes)]
    content = b"".join([HEAD, *parts, zlib.adler32(planes.data).to_bytes(4, "big")])
    return content + fletcher32(content).to_bytes(CHECKSUM, "little")


def unpacked(content: bytes, shape: tuple[int, ...]) -> Vector:
    """The numbers of a chunk of that shape; ValueError where it does not hold exactly these."""
    stream, stated = content[:-CHECKSUM], int.from_bytes(content[-CHECKSUM:], "little")
    if not stream or fletcher32(stream) != stated:
        raise ValueError("a chunk does not fit its checksum")
    planes = _inflated(stream, 8 * math.prod(shape))
    numbers = np.frombuffer(planes, np.uint8).reshape(8, -1).T
    return np.ascontiguousarray(numbers).view("<f8").reshape(shape)


def _inflated(stream: bytes, size: int) -> bytes:
    unpacker = zlib.decompressobj()
    try:
        content = unpacker.decompress(stream, size)
        beyond = unpacker.decompress(unpacker.unconsumed_tail, 1)  # the sum, and no byte more
    except zlib.error as error:
        raise ValueError(f"a chunk cannot be unpacked: {error}") from error
    if len(content) != size or beyond or not unpacker.eof or unpacker.unused_data:
        raise ValueError(f"a chunk does not unpack to {size} bytes")
    return content


def _deflated(plane: memoryview, *, last: bool) -> bytes:
    level, memory = (LEVEL, zlib.DEF_MEM_LEVEL) if _worth_it(plane) else (0, 1)
    stream = zlib.compressobj(level, wbits=RAW, memLevel=memory)
    return stream.compress(plane) + stream.flush(zlib.Z_FINISH if last else zlib.Z_FULL_FLUSH)


def _worth_it(plane: memoryview) -> bool:
    middle = len(plane) // 2
    sample = b"".join([plane[:SAMPLE], plane[middle : middle + SAMPLE], plane[-SAMPLE:]])
    counts = np.bincount(np.frombuffer(sample, np.uint8))
    return int(counts @ counts) * 256 > WORTH * len(sample) ** 2


def fletcher32(content: bytes) -> int:
    """HDF5's checksum: the sum of all 16-bit words, and that of all its partial sums."""
    # Zeros in front change neither sum. Words whose bytes are swapped add up to 256 times as much,
    # modulo 65535.
    even = content + bytes(len(content) % 2)
    words = np.frombuffer(bytes(-len(even) % (2 * BLOCK)) + even, "<u2").reshape(-1, BLOCK)
    rows, columns = (words.sum(axis=axis, dtype=np.uint64) for axis in (1, 0))
    left = np.arange(len(rows), 0, -1, dtype=np.uint64) * BLOCK  # words from each row's start on
    first = int(rows.sum())
    second = int(left @ rows) - int(np.arange(BLOCK, dtype=np.uint64) @ columns)
    return _folded(256 * second) << 16 | _folded(256 * first)


def _folded(total: int) -> int:
    # HDF5 folds carries back in, so that only a sum of nothing gives 0.
    return (total - 1) % MODULUS + 1 if total else 0
