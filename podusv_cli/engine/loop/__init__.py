"""The closed loop as values: parts, contents of its vectors, names of what it logs."""
