"""`python -m lightproof`: the command, as `python -m renderer`."""

from renderer.__main__ import command

if __name__ == "__main__":
    command()
