"""The kinds of inputs, a module each."""

from __future__ import annotations

from typing import Final

from tools.fuzz.case import Kind
from tools.fuzz.kinds import cards, certificates, commands, conversions, loop_files, plants, records, signals, tables

KINDS: Final[dict[str, Kind]] = {
    module.KIND.name: module.KIND
    for module in (records, tables, commands, cards, loop_files, conversions, signals, certificates, plants)
}
