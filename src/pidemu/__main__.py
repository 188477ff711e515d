"""``python -m pidemu``."""

from pidemu.cli import main

main()
