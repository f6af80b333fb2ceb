"""Models that take part in the benchmark, one file per kind."""
