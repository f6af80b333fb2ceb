"""Questions: studies that the laboratory answers as a whole, with fixed inputs and seeds."""
