"""The eight pages; each module has `build(workspace, request)`, which builds the page."""
