"""The figures of the papers in the papers' own form, drawn from what the laboratory computes."""
