"""Everything in the repository that is generated: ``python -m tools.regenerate``.

`files` lists the generated files, each with the function that makes its text; the other modules are those functions. They are no
part of the package: an installed pidemu has no repository to write to.
"""

from typing import Final

RENEW: Final = "run python -m tools.regenerate, and read what it changes"
"""What a test says when a generated file is not what it would be today."""
