"""Figures from recordings: one file a family, one style for all."""
