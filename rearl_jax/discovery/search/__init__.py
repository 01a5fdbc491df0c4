"""Search for effects: candidates are scored without a fit (screen), the best fitted and checked on other drivers."""
