"""The closed loop: once a second it determines which vehicles need a decision and their admissible actions, lets a
policy choose one action per vehicle, and executes the action as a target speed or lane.
"""
