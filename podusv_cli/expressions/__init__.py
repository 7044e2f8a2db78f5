"""The language of claims and objectives: reading, one walk with three answers, verdicts."""
