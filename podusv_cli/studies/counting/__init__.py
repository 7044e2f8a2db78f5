"""What the runs of a study have to offer, and what is counted in them; knows no scenario."""
