"""Pods for tests, and twins of them."""

from typing import Any

from conftest import POD

from podusv_cli.components.actuators.pod import Pod, Pods


def pods(*several: dict[str, float], **options: Any) -> Pods:
    """Pods like `POD`, each with these fields changed; one on the centre line by default."""
    return Pods(pods=tuple(Pod(**POD | own) for own in several or ({},)), **options)


TWIN = ({"y": -0.078, "T_nn": 3.65e-3}, {"y": 0.078, "T_nn": 3.65e-3})
