"""Test rigs, simulated and real, and the runs on them and on circuits."""
