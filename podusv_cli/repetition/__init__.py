"""What two recordings of the same, or nearly the same, run differ in, and why they may."""
