"""What the paper's stability proof promises, and whether a run keeps it."""
