"""What podusv promises of every part, asked of this package's law, path, metric and figure."""

from pathlib import Path
from typing import Any

import my_lab
import pytest

from podusv_cli.testing import contract

FILES = sorted(Path(my_lab.__file__).parent.glob("*.py"))


@pytest.mark.parametrize(("check", "part"), [case for file in FILES for case in contract(file)])
def test_contract(check: Any, part: Any) -> None:
    """The check passes; its name says what it asks."""
    check(part)
