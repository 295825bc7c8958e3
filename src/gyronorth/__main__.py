"""`python -m gyronorth`: the command, where no folder of programs is on the PATH."""

from gyronorth.cli import main

if __name__ == "__main__":
    main()
