"""Car-following models compared: the first step of a discovery, which goes on with the best."""
