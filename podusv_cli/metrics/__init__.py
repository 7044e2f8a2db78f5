"""Numbers that sum up a run."""
