"""Candidates screened, fitted, checked on other drivers, and decided on."""
