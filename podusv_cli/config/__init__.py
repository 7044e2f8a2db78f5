"""Scenarios: from YAML text to one validated value, with every error at its place."""
