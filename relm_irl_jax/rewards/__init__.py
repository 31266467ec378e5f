"""Rewards of the methods: the reward equation, reward functions, and how rewards are learned and predicted."""
