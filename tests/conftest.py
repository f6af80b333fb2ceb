"""Puts this folder on the path of all tests: `machine_records` is shared by several rooms."""
