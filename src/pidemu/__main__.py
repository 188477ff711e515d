"""The command ``pidemu``, also ``python -m pidemu``; Ctrl-C while it is still being loaded ends it with a word, too."""

import gc
import sys


def main() -> None:
    """Run the command line and exit."""
    gc.disable()  # nothing that is imported is garbage; `pidemu.cli` enables it when the command is loaded
    try:
        from pidemu.cli import main as run
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        sys.exit(130)
    run()


if __name__ == "__main__":
    main()
