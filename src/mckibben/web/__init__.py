"""The web interface: one server, eight pages, one state; `laboratory` is that state, `server` serves it."""
