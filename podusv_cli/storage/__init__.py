"""Run folders, logs, manifests: everything that is written to and read from the disk."""
