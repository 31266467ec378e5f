"""Inverse reinforcement learning: reward weights from expert trajectories."""
