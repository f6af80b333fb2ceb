"""The web interface: one server, eight pages, one state; `workspace` is that state, `server` serves it."""
