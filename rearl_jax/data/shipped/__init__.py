"""Recordings that come with the package, one folder per format, each with licence and attribution."""
