from podusv_cli.interface import Bench as Bench
from podusv_cli.interface import Comparison as Comparison
from podusv_cli.interface import IdentifiedHull as IdentifiedHull
from podusv_cli.interface import PodusvError as PodusvError
from podusv_cli.interface import Run as Run
from podusv_cli.interface import Scenario as Scenario
from podusv_cli.interface import Study as Study
from podusv_cli.interface import Tuning as Tuning
from podusv_cli.interface import bench as bench
from podusv_cli.interface import compare as compare
from podusv_cli.interface import doubt as doubt
from podusv_cli.interface import identify as identify
from podusv_cli.interface import load as load
from podusv_cli.interface import open_run as open_run
from podusv_cli.interface import open_session as open_session
from podusv_cli.interface import open_study as open_study
from podusv_cli.interface import optimum as optimum
from podusv_cli.interface import run as run
from podusv_cli.interface import simulate as simulate
from podusv_cli.interface import simulate_many as simulate_many
from podusv_cli.interface import sweep as sweep
from podusv_cli.interface import tune as tune
from podusv_cli.interface import verify as verify

__version__: str
