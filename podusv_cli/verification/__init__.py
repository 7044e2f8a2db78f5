"""Can the numbers of a run be trusted: the same run at finer steps."""
