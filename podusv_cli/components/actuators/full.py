"""What actuators of fully actuated vessels have in common."""

from __future__ import annotations

from typing import ClassVar

from podusv_cli.components.actuators.base import Actuator
from podusv_cli.components.actuators.command import FullCommand
from podusv_cli.core.component import value


class FullActuator(Actuator):
    """Takes a surge force, a yaw moment and a sway force, and gives each by itself.

    A law that asks for surge force and yaw moment alone leaves the sway force 0.
    """

    feels_motion: ClassVar[bool] = False
    cuts: ClassVar[bool] = True
    command: FullCommand | None = value(
        None, "", "how the law's demand reaches the actuator; at once and as it is by default"
    )

    @property
    def takes_sway(self) -> bool:
        """Whether a demand has a sway force: always."""
        return True
