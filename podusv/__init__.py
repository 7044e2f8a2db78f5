"""podusv: experiments with controllers for pod-propelled surface vessels.

`podusv docs python` has examples. All names are those of `podusv_cli`, which imports what is behind
a name when it is first used.
"""

from podusv_cli import __all__ as __all__
from podusv_cli import __dir__ as __dir__
from podusv_cli import __getattr__ as __getattr__
from podusv_cli import __version__ as __version__
