"""The metric agent: an embedding of views in which distances are costs to go."""
