"""Run folders, logs, manifests: reading and writing."""
