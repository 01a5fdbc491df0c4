"""Studies, one command each: the paper's tables and figures compared with this package's, and recorded traffic."""
