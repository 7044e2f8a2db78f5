"""Reference paths: where the target is, how it moves, and when it does not move smoothly."""
