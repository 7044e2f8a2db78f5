"""Run folders: what a simulation leaves behind, written whole and read with care."""
