"""Write the LLVM bitcode of podusv's own kernels into the package; `make dist` calls it."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import podusv_cli
from podusv_cli.core.errors import PodusvError
from podusv_cli.engine.machine import compile, shipped, signatures
from podusv_cli.engine.running import lanes
from podusv_cli.engine.step import rk4
from podusv_cli.scenario.load import load

CONFIGS = Path(podusv_cli.__file__).with_name("configs")


def pieces() -> Iterator[Any]:
    """Every kernel that is compiled for a run, a comparison or a study of what podusv has."""
    yield compile.Piece(rk4.advance, signatures.ADVANCE)
    yield compile.Piece(rk4.evaluate_all, signatures.EVALUATE_ALL)
    yield compile.Piece(rk4.rates_along, signatures.RATES_ALONG)
    for file in sorted(CONFIGS.rglob("*.yaml")):
        try:
            plans = dict(load(str(file)).plans).values()
        except PodusvError:  # a layer, which is no scenario by itself
            continue
        for plan in plans:
            yield from (compile.adapter(*part) for part in plan.functions)
            yield from lanes._pieces(plan)


def main() -> None:
    """Each of them once."""
    kernels: dict[str, bytes] = {}
    for function, prototype, _, compiler in pieces():
        name = shipped.digest(function, prototype, compiler)
        if name not in kernels:
            module = import_module(f"podusv_cli.engine.machine.{compiler}")
            kernels[name] = module.bitcode(function, prototype)
    shipped.write(kernels)
    print(len(kernels), "kernels,", shipped.FILE.stat().st_size, "bytes")


if __name__ == "__main__":
    main()
