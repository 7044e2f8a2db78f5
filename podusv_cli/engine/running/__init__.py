"""Runs of closed loops: alone, many at once, side by side, and again from a log."""
