"""`rearl doctor`: checks of the installation. One module per subject; each check is one line with a remedy."""
