"""The only place that draws: figures from values, in the colours of the quantities."""
