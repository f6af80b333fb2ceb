"""The seven pages; each module has `build(lab, request)`, which fills the page that is being made."""
