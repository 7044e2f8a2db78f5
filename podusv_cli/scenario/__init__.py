"""Scenario files: text in, one validated scenario out."""
