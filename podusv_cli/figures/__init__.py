"""Figures from recordings: one file a family, one style for all."""

import os
from importlib.util import find_spec

# A notebook names its own backend to all that it starts. Where that is not installed, the import of
# matplotlib ends in ValueError, and no figure here needs a backend.
INLINE = "matplotlib_inline"
if INLINE in os.environ.get("MPLBACKEND", "") and find_spec(INLINE) is None:
    del os.environ["MPLBACKEND"]
