"""Experiments of many runs: studies over draws, searches for gains, and the bench of laws."""
