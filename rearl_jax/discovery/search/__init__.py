"""Search for effects: candidates are screened, fitted, checked on other drivers, and accepted or rejected."""
