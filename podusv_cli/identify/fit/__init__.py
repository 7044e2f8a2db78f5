"""The fit: which numbers are looked for, the filter along a log, and the search."""
