"""Features of views: the image encoder, its weights and the cache."""
