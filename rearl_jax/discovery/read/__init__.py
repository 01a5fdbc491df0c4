"""From recordings to measured drivers: positions, speeds and gaps, each with its noise."""
