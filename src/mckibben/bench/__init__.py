"""Where it happens: circuits, rigs and the runs on them."""
