"""Studies, one command each: the paper's tables and figures with this package's beside them, and real traffic."""
