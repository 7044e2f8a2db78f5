"""Chunks packed here are what HDF5's own filters would have made of the numbers."""

from __future__ import annotations

import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from podusv_cli.core.kernel import Vector
from podusv_cli.storage import packing

RANDOM = np.random.default_rng(7)
SIGNALS = {
    "noise": RANDOM.standard_normal(5000),
    "smooth": np.sin(np.linspace(0, 20, 5000)),
    "constant": np.full(5000, 3.0),
    "no numbers": np.full(300, np.nan),
    "one": np.array([-0.0]),
    "node weights": RANDOM.standard_normal((700, 27)).cumsum(axis=0),
    "noise at last": np.concatenate([np.zeros(4000), RANDOM.standard_normal(4000)]),
}


def dataset(path: Path, numbers: Vector, **filters: object) -> h5py.Dataset:
    file = h5py.File(path, "w")
    return file.create_dataset("a", numbers.shape, "<f8", chunks=numbers.shape, **filters)


@pytest.mark.parametrize("name", SIGNALS)
def test_hdf5_reads_back_every_bit(tmp_path: Path, name: str) -> None:
    numbers = SIGNALS[name]
    made = dataset(tmp_path / "a.h5", numbers, compression=4, shuffle=True, fletcher32=True)
    made.id.write_direct_chunk((0,) * numbers.ndim, packing.packed(numbers))
    made.file.flush()
    with h5py.File(tmp_path / "a.h5") as file:
        assert file["a"][...].tobytes() == numbers.tobytes()


def test_the_checksum_is_hdf5s(tmp_path: Path) -> None:
    for count in (1, 3, 64, 1000, 5000):
        numbers = RANDOM.standard_normal(count)
        made = dataset(tmp_path / f"{count}.h5", numbers, fletcher32=True)
        made[...] = numbers
        _, chunk = made.id.read_direct_chunk((0,))
        content, checksum = chunk[:-4], int.from_bytes(chunk[-4:], "little")
        assert packing.fletcher32(content) == checksum


@given(content=st.binary(max_size=3000))
def test_the_checksum_is_what_its_definition_gives(content: bytes) -> None:
    even = content + b"\0" * (len(content) % 2)
    first = second = 0
    for i in range(0, len(even), 2):
        first += even[i] << 8 | even[i + 1]
        second += first
    folded = [(total - 1) % 65535 + 1 if total else 0 for total in (first, second)]
    assert packing.fletcher32(content) == folded[1] << 16 | folded[0]


def test_checksums_of_large_chunks_lose_no_digit() -> None:
    content = b"\xff\xfe" * 2**20
    count = 2**20
    first, second = 0xFFFE * count, 0xFFFE * count * (count + 1) // 2
    assert packing.fletcher32(content) == (second % 65535) << 16 | first % 65535


def test_planes_of_noise_are_stored_and_the_others_deflated() -> None:
    noise, smooth = SIGNALS["noise"], SIGNALS["constant"]
    assert len(packing.packed(noise)) < 0.95 * noise.nbytes
    assert len(packing.packed(smooth)) < 0.02 * smooth.nbytes
    by_hdf5 = zlib.compress(noise.view(np.uint8).reshape(-1, 8).T.copy(), 4)
    assert len(packing.packed(noise)) < 1.02 * len(by_hdf5)


def test_the_same_numbers_give_the_same_bytes() -> None:
    for numbers in SIGNALS.values():
        assert packing.packed(numbers) == packing.packed(numbers.copy())


@pytest.mark.parametrize("name", SIGNALS)
def test_what_was_packed_is_unpacked_to_the_last_bit(name: str) -> None:
    numbers = SIGNALS[name]
    found = packing.unpacked(packing.packed(numbers), numbers.shape)
    assert (found.shape, found.tobytes()) == (numbers.shape, numbers.tobytes())


def test_no_bit_of_a_chunk_can_be_flipped() -> None:
    content = packing.packed(np.sin(np.arange(20.0)))
    for bit in range(8 * len(content)):
        damaged = bytearray(content)
        damaged[bit >> 3] ^= 1 << (bit & 7)
        with pytest.raises(ValueError, match="chunk"):
            packing.unpacked(bytes(damaged), (20,))


@pytest.mark.parametrize("shape", [(19,), (21,), (0,), (20, 2)])
def test_a_chunk_holds_exactly_its_shape(shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="does not unpack to"):
        packing.unpacked(packing.packed(np.arange(20.0)), shape)
