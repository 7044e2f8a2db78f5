"""All arrays of three shipped scenarios have their committed bits, whatever computes them."""

import json
import os
import platform
import subprocess
import sys
from pathlib import Path

import pytest
from array_digests import SCENARIOS, digests_of

HERE = Path(__file__).parent
COMMITTED = json.loads((HERE / "array_digests.json").read_text())
# Libraries asked to compute as on other processors; each of them is free in the order of sums.
OTHERS = {
    "OPENBLAS_CORETYPE": "Prescott",
    "OPENBLAS_NUM_THREADS": "2",
    "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL AVX512_SPR",
}


@pytest.mark.parametrize("name", SCENARIOS)
def test_arrays_have_their_committed_bits(name):
    made = digests_of(name)
    assert [
        key for key in {**COMMITTED[name], **made} if made.get(key) != COMMITTED[name].get(key)
    ] == []
    assert {"adaptive_neural V", "adaptive_neural W_star_u", "adaptive_neural x"} <= {*made}


@pytest.mark.long
@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="names processors of x86")
def test_they_are_the_same_where_libraries_compute_as_on_another_processor():
    done = subprocess.run(
        [sys.executable, "-W", "ignore", str(HERE / "array_digests.py")],
        env={**os.environ, "PYTHONPATH": str(HERE.parents[1]), **OTHERS},
        capture_output=True,
        text=True,
        check=True,
        timeout=300,
    )
    assert json.loads(done.stdout) == COMMITTED
