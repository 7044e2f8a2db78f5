"""What the verdict on a claim hangs on: moved one at a time, and all at once."""
