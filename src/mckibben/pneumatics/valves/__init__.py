"""Valves, one file each."""
