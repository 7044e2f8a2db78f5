"""Chunks packed as HDF5's filters shuffle, deflate and Fletcher would, in a third of the time.

Shuffled, the numbers of a chunk lie in planes: all first bytes, all second bytes, and so on. Most
planes of a computed signal are noise, on which deflate spends its time and gains nothing. They are
stored as they are, which a deflate stream may do; every reader unpacks the result.
"""

from __future__ import annotations

import zlib

import numpy as np

from podusv_cli.kernels import Vector

LEVEL = 4  # of the planes that are worth it
WORTH = 0.95  # of its size is what a plane has to come down to
SAMPLE = 4096  # bytes of a plane that are tried
RAW = -zlib.MAX_WBITS  # a deflate stream without head and sum, to be put together
HEAD = b"\x78\x5e"  # of a zlib stream
MODULUS = 0xFFFF
BLOCK = 512  # words
WEIGHTS = np.column_stack([np.ones(BLOCK), np.arange(BLOCK, 0, -1.0)])


def packed(numbers: Vector) -> bytes:
    """A chunk of float64 as it lies in the file, for `write_direct_chunk`."""
    little = np.ascontiguousarray(numbers, dtype="<f8")
    planes = np.ascontiguousarray(little.reshape(-1).view(np.uint8).reshape(-1, 8).T)
    parts = [_deflated(memoryview(plane), last=i == 7) for i, plane in enumerate(planes)]
    content = b"".join([HEAD, *parts, zlib.adler32(planes.data).to_bytes(4, "big")])
    return content + fletcher32(content).to_bytes(4, "little")


def _deflated(plane: memoryview, *, last: bool) -> bytes:
    stream = zlib.compressobj(LEVEL if _worth_it(plane) else 0, wbits=RAW)
    return stream.compress(plane) + stream.flush(zlib.Z_FINISH if last else zlib.Z_FULL_FLUSH)


def _worth_it(plane: memoryview) -> bool:
    middle = max(0, (len(plane) - SAMPLE) // 2)
    sample = plane[middle : middle + SAMPLE]
    trial = zlib.compressobj(1, wbits=-12, memLevel=6)
    return len(trial.compress(sample)) + len(trial.flush()) < WORTH * len(sample)


def fletcher32(content: bytes) -> int:
    """HDF5's checksum: the sum of all 16-bit words, and that of all its partial sums."""
    # Zeros in front change neither sum. All sums here are whole numbers that float64 holds.
    even = content + b"\0" if len(content) % 2 else content
    words = np.zeros(-(-len(even) // (2 * BLOCK)) * BLOCK)
    words[len(words) - len(even) // 2 :] = np.frombuffer(even, ">u2")
    sums = words.reshape(-1, BLOCK) @ WEIGHTS
    later = BLOCK * np.arange(len(sums) - 1, -1, -1)  # words behind each block
    first, second = int(sums[:, 0].sum()), int((sums[:, 1] + sums[:, 0] % MODULUS * later).sum())
    return _folded(second) << 16 | _folded(first)


def _folded(total: int) -> int:
    # HDF5 folds carries back in, so that only a sum of nothing gives 0.
    return (total - 1) % MODULUS + 1 if total else 0
