"""Interrupts, worker processes, names of temporary files."""
