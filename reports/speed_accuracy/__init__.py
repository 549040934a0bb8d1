"""Speed against accuracy: what every method, sampler and renderer gets for its seconds."""
