"""Making the runs of a study: cells, draws, units, and the folder that they are written to."""
