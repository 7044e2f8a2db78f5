"""Scenarios as environments of Gymnasium; needs `pip install 'podusv[gym]'`."""

from podusv_cli.interface.gym import Env as Env
from podusv_cli.interface.gym import VectorEnv as VectorEnv

__all__ = ["Env", "VectorEnv"]
