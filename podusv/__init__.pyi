from podusv_cli import *  # noqa: F403
from podusv_cli import __version__ as __version__
