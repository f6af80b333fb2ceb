"""Complete studies of one question each, with fixed inputs and seeds."""
