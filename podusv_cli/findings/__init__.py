"""What podusv notices about a scenario before a run, and about a run after it."""
