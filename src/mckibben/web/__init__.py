"""The laboratory's screen: one server, seven pages, one state; `laboratory` is that state, `server` shows it."""
