"""The mapping agent: it draws a map of an unseen room while it searches for the target."""
