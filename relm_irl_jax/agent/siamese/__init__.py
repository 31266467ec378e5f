"""The paper's agent: a siamese actor-critic trained by n-step advantages."""
