"""``python -m tools.fuzz``."""

from tools.fuzz.cli import command

if __name__ == "__main__":
    command()
