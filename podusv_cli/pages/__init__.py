"""What HTML reports have in common: one file each that needs nothing else, and one look."""
