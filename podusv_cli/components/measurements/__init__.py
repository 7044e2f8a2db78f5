"""What the law sees of the vessel."""
