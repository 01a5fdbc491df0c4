"""Decision: who needs one -> what they may do -> what a policy chooses -> what is executed."""
