"""The web interface: one server, seven pages, one state; `laboratory` is that state, `server` serves it."""
