"""Rewards of the methods: the reward equation, the functions that pay transitions, and how rewards are learned."""
