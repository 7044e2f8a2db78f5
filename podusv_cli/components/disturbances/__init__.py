"""Forces and moments that the sea puts on the hull."""
