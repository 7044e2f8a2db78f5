"""Warnings about a scenario before a run, and about the run afterwards."""
