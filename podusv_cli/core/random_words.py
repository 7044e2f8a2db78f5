"""Random numbers that are functions of names and a position, and of nothing else.

Number i of a stream is the first word of block i of a counter-based generator (Philox), whose key
is a digest of the stream's names. So it does not depend on who asks for it, in which order, or for
how many.
"""

from __future__ import annotations

import json
import math
from hashlib import sha256

import numpy as np
import numpy.typing as npt

from podusv_cli.core.elementary import exponential
from podusv_cli.core.kernel import Vector
from podusv_cli.core.portable import standard_normal

Words = npt.NDArray[np.uint64]
BLOCK = 4  # words of Philox that share a counter
BITS = 52  # of a word: more, and u + 1/2 would round to 1


def words(stream: tuple[int | str, ...], first: int, count: int) -> Words:
    """The `count` random words from number `first` on of the stream with these names, (count,)."""
    key = int.from_bytes(sha256(json.dumps(stream).encode()).digest()[:16], "little")
    generator = np.random.Philox(key=key).advance(first)
    return np.asarray(generator.random_raw(BLOCK * count)[::BLOCK])


def in_unit_interval(drawn: Words) -> Vector:
    """A number in (0, 1), without the ends, for each word."""
    return np.asarray(((drawn >> np.uint64(64 - BITS)) + 0.5) * 2.0**-BITS, float)


def uniforms(stream: tuple[int | str, ...], first: int, count: int) -> Vector:
    """Numbers (count,) from `first` on of a stream, uniform in (0, 1) without the ends."""
    return in_unit_interval(words(stream, first, count))


def gauss_markov(stream: tuple[int | str, ...], count: int, lag: float) -> Vector:
    """A first-order Gauss-Markov process (count,) of variance 1, from its steady distribution on.

    `stream` names its random numbers; `lag` is the time between two of its numbers in time
    constants. The steps are exact for any lag: x+ = exp(-lag) x + sqrt(1 - exp(-2 lag)) n.
    """
    # The first number has variance 1 already; the others are noise until the loop adds what is kept
    kept, process = exponential(-lag), normals(stream, 0, count)
    process[1:] *= math.sqrt(1.0 - kept * kept)
    for i in range(1, count):
        process[i] += kept * process[i - 1]
    return process


def normals(stream: tuple[int | str, ...], first: int, count: int) -> Vector:
    """Numbers (count,) from `first` on of a stream, standard normal; the same on every machine."""
    return standard_normal(uniforms(stream, first, count))
