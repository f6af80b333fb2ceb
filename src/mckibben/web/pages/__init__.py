"""The eight pages; each module has `build(lab, request)`, which builds the page."""
