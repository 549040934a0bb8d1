"""What a cluster costs and how far it carries: measured with few workers, simulated."""
