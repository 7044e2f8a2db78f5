"""A law out of the simulator: as C for a program of one's own, and as a functional mock-up unit."""
