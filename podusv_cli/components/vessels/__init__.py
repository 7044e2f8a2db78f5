"""Vessels: parameter sets as data files, and the one plant kernel that serves them all."""
