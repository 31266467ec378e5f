"""Rewards of the methods: the models that training looks up, and how they are learned from demonstrations."""
