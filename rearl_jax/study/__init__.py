"""Studies of the paper's tables and figures, one command each: this package's figures beside the paper's."""
