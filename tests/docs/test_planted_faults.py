"""The table of planted faults keeps up with code and tests that move."""

from pathlib import Path

from benchmarks.mutants import CHECKOUT, CODE, PACKAGE, TESTS, mutants


def read_all(folder: Path) -> str:
    files = (path for path in sorted(folder.rglob("*")) if path.suffix in CODE)
    return "\0".join(path.read_text("utf-8") for path in files)


def test_every_fault_stands_once_and_its_test_is_there() -> None:
    code, tests = read_all(CHECKOUT / PACKAGE), read_all(CHECKOUT / TESTS)
    lost = [
        f"{mutant} ({mutant.test}): {code.count(mutant.old)} times"
        for mutant in mutants()
        if code.count(mutant.old) != 1 or f"def {mutant.test.split()[0]}(" not in tests
    ]
    assert lost == []
