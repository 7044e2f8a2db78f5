from podusv_cli.interface import Comparison as Comparison
from podusv_cli.interface import Run as Run
from podusv_cli.interface import Scenario as Scenario
from podusv_cli.interface import compare as compare
from podusv_cli.interface import load as load
from podusv_cli.interface import open_run as open_run
from podusv_cli.interface import run as run
from podusv_cli.interface import simulate as simulate
from podusv_cli.interface import simulate_many as simulate_many
from podusv_cli.interface import verify as verify

__version__: str
