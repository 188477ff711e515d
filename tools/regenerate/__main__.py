"""``python -m tools.regenerate``."""

from tools.regenerate.cli import command

if __name__ == "__main__":
    command(prog_name="python -m tools.regenerate")
