"""The bench: all laws over standard tasks, vessels and conditions, with ranks and failures."""
