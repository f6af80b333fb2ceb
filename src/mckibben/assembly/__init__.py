"""Joining: muscle, circuit, load and joint become one state equation; nothing here integrates."""
