"""The target-driven actor-critic: networks, rollout, update, training."""
