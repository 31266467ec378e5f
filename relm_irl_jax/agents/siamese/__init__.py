"""The paper's agent: a siamese actor-critic."""
