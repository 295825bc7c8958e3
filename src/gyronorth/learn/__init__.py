"""Training of the networks with PyTorch, and their export to bundles."""
