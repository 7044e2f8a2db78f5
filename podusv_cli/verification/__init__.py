"""Can the numbers of a run be trusted: the same run at finer steps."""

TOLERANCE = 0.01  # relative error up to which a number is converged, if nothing else is asked
