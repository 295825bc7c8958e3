"""Trained bundles: what they hold (`bundle`), how they run (`runtime`), and the denoiser's sampler (`diffusion`)."""
