"""One YAML file a vessel."""
