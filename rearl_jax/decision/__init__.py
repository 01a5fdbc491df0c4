"""Decisions: admissible actions of the vehicles that need a decision, choice by a policy, execution."""
