"""Metrics: numbers that characterise a run."""
