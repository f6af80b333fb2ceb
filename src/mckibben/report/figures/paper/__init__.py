"""Figures of the papers in the papers' own form, drawn from our computations."""
