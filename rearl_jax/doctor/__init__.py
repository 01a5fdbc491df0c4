"""`rearl doctor`: is everything there and in order? One module per subject; each check is one line with a remedy."""
