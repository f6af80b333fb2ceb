"""Figures and reports: what people would rather see than read. Only `report.figures` draws."""
