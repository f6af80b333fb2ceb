"""The five software parts of the test machine: what acts on measured samples, watches, shows and stores them."""
