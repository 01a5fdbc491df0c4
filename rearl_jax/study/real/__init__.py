"""Discovery in real recordings: verdicts, errors under every protocol, and comparison with known facts."""
