"""Logs of boats: read, put into podusv's units and frame, and looked at for mistakes."""
