"""Settings with ranges and options stated, and what a conversion of them comes to."""

from __future__ import annotations

import pidemu
from pidemu.conversion.refused import ConversionRefusedError
from pidemu.conversion.result import Conversion
from pidemu.settings.settings import Settings
from tests.conversion.support import HUNDRED


def load(card: str, **dials: object) -> Settings:
    """Settings with ranges of 0 to 100 and, where they are not named, the options as the card delivers them."""
    named = {d.casefold() for d in dials}
    options = {n: c for n, c in pidemu.load_card(card).variant({}).chosen.items() if n.casefold() not in named}
    return pidemu.load_card(card).settings({**HUNDRED, **options, **dials})


def settled(source: Settings, target: str, **arguments: object) -> tuple[Conversion | None, str]:
    """Return the conversion and no reason, or what a refusal offers and its reason."""
    try:
        return pidemu.convert(source, target, emulate=False, **arguments), ""  # type: ignore[arg-type]
    except ConversionRefusedError as refusal:
        return refusal.nearest, str(refusal)
