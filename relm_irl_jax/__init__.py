"""Target-driven visual navigation with learned rewards, in JAX."""
