"""Data only: one folder a bundle, which `gyronorth heading --method paper` and `--method baseline` find here."""
