"""`python -m gyronorth.cli` is the same as `gyronorth`."""

from gyronorth.cli import main

main()
