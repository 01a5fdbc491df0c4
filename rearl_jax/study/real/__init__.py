"""The discovery loop in real recordings: verdicts, errors under every protocol, and known facts as a score."""
