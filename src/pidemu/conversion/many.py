"""Many conversions to one card: a table of what came of each, and each conversion itself when it is asked for."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Final, overload

import numpy as np
import numpy.typing as npt

from pidemu.card.library import load_card
from pidemu.card.load import Card
from pidemu.conversion.convert import convert
from pidemu.conversion.refused import ConversionRefusedError, QuestionError
from pidemu.conversion.result import Conversion
from pidemu.errors import PidemuError, SettingError
from pidemu.processes import processors, shared
from pidemu.settings.settings import Settings

_SHARE: Final = 100
"""Conversions that a process does before it reports."""
_FEW: Final = 400
"""Conversions below which starting processes takes longer than it saves."""
FIGURES: Final = {"feedback": "1", "gain": "dB", "phase": "deg", "setpoint": "1"}
"""Largest differences in the loop band, with units: of the feedback path, of its gain and phase, and of the setpoint path."""
_ABSENT: Final = float("nan")


@dataclass(frozen=True, slots=True)
class ConversionRow:
    """What came of one of many conversions.

    Attributes
    ----------
    outcome : {"converted", "question", "refused", "failed"}
        What came of it; ``failed``: an error of its own, such as a wrong setting.
    verdict, match : str
        Verdict, and how the settings were found; empty where there are none.
    reason : str
        What is asked, why the target refuses, or what is wrong.
    figures : tuple of float
        What `FIGURES` names; NaN where there are none.
    dials, options : dict
        The dials in use, in the card's units, and all options.
    """

    outcome: str
    verdict: str = ""
    match: str = ""
    reason: str = ""
    figures: tuple[float, ...] = (_ABSENT,) * len(FIGURES)
    dials: Mapping[str, float] = field(default_factory=dict)
    options: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class ConversionTable(Sequence[Conversion]):
    """Many conversions: columns over all of them, and each by its index.

    A conversion is worked out anew when it is asked for, so that a table of a whole plant needs little room; it is what `convert`
    gives, and where `convert` raises, asking for it raises.

    Attributes
    ----------
    sources : sequence of Settings or SettingError
        What was converted; the error where there are no such settings.
    card : Card
        The target.
    how : mapping
        The arguments of `convert`.
    rows : tuple of ConversionRow
        What came of each.
    """

    sources: Sequence[Settings | PidemuError]
    card: Card
    how: Mapping[str, Any]
    rows: tuple[ConversionRow, ...]

    def __len__(self) -> int:
        return len(self.rows)

    @overload
    def __getitem__(self, index: int) -> Conversion: ...

    @overload
    def __getitem__(self, index: slice) -> list[Conversion]: ...

    def __getitem__(self, index: int | slice) -> Conversion | list[Conversion]:
        if isinstance(index, slice):
            return [self[i] for i in range(len(self))[index]]
        source = self.sources[index]
        if isinstance(source, PidemuError):
            raise source
        return convert(source, self.card, **self.how)

    @cached_property
    def columns(self) -> dict[str, npt.NDArray[Any]]:
        """Arrays over all conversions, shape (n,).

        ``outcome``, ``verdict``, ``match``, ``reason`` (str); ``feedback``, ``gain``, ``phase``, ``setpoint`` (see `FIGURES`); then
        every dial of the target that is in use anywhere [the card's units], NaN where it is not; and its options (str).
        """
        dials = list(dict.fromkeys(name for row in self.rows for name in row.dials))
        texts = {name: np.array([getattr(row, name) for row in self.rows], dtype=object) for name in _TEXTS}
        figures = np.array([row.figures for row in self.rows]).reshape(-1, len(FIGURES)).T
        return {
            **texts,
            **dict(zip(FIGURES, figures, strict=True)),
            **{name: np.array([row.dials.get(name, _ABSENT) for row in self.rows]) for name in dials},
            **{name: np.array([row.options.get(name, "") for row in self.rows], dtype=object) for name in self.card.options},
        }

    @property
    def failed(self) -> dict[int, str]:
        """Why there are no settings, by index, where there are none."""
        return {i: row.reason for i, row in enumerate(self.rows) if row.outcome != "converted"}


_TEXTS: Final = ("outcome", "verdict", "match", "reason")


def convert_many(
    sources: Sequence[Settings] | Mapping[str, Collection[Any]],
    target: str | Path | Card,
    *,
    source: str | Path | Card | None = None,
    jobs: int | None = None,
    progress: Callable[[int, int], None] | None = None,
    **how: Any,
) -> ConversionTable:
    """Convert many settings to one card.

    Each is converted as by `convert`: what is asked of one, or refused, or wrong with it, costs no other.

    Parameters
    ----------
    sources : sequence of Settings, or mapping of str to sequence
        The settings; or columns of them, by the names of dials and options of the card `source`, with the values that its
        ``settings`` takes. ``None`` and empty cells are not given.
    target : str, path or Card
        The card to convert to.
    source : str, path or Card, optional
        The card that columns are of.
    jobs : int, optional
        Processes; by default as many as there are processors, and none beside this one where there is little to do.
    progress : callable, optional
        Called with the number of conversions done, and of all.
    **how
        As for `convert`, for all of them. Name the options of the target to have all loops alike; what is not named is chosen for
        each.

    Returns
    -------
    ConversionTable
        Columns over all, and each conversion by its index.

    Raises
    ------
    SettingError
        Columns have no card, or not the same length.
    CardError
        A card is unknown or wrong.

    Examples
    --------
    >>> import pidemu
    >>> loops = {"GAIN": [2.0, 1.5, 0.0], "RESET": [4, 2, 1], "RATE": [0, "6 s", 0]}
    >>> table = pidemu.convert_many(loops, "generic/series", source="fisher/provox")
    >>> table.columns["verdict"].tolist(), table.columns["Ti"].tolist()
    (['exact', 'exact-feedback', ''], [15.0, 30.0, nan])
    >>> table.failed[2]
    'generic/series cannot do what fisher/provox does: the source has no action, every term is off; no settings of it come near'
    """
    card = target if isinstance(target, Card) else load_card(target)
    read = _read(sources, source) if isinstance(sources, Mapping) else list(sources)
    places = range(len(read))
    shares = [tuple((i, read[i]) for i in places[start : start + _SHARE]) for start in range(0, len(read), _SHARE)]
    count = jobs or (1 if len(read) < _FEW else processors())
    rows: dict[int, ConversionRow] = {}
    for share, found in shared(partial(_converted, card, how), shares, count):
        error = ConversionRow("failed", reason=f"{type(found).__name__}: {found}") if isinstance(found, BaseException) else None
        rows.update({i: error or found[k] for k, (i, _) in enumerate(share)})  # type: ignore[index]  # a list, without an error
        if progress is not None:
            progress(len(rows), len(read))
    return ConversionTable(read, card, how, tuple(rows[i] for i in places))


def _read(columns: Mapping[str, Collection[Any]], source: str | Path | Card | None) -> list[Settings | PidemuError]:
    """Return the settings of each row of columns, or what is wrong with them."""
    if source is None:
        raise SettingError('columns are settings of a card; name it, such as source="fisher/provox"')
    lengths = {len(column) for column in columns.values()}
    if len(lengths) > 1:
        raise SettingError(f"the columns have different lengths: {', '.join(f'{n} {len(c)}' for n, c in columns.items())}")
    card = source if isinstance(source, Card) else load_card(source)
    rows = (dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True))
    return [_settings(card, {n: x for n, x in row.items() if x is not None and x != ""}) for row in rows]


def _settings(card: Card, given: Mapping[str, object]) -> Settings | PidemuError:
    try:
        return card.settings(given)
    except PidemuError as error:
        return error


def _converted(card: Card, how: Mapping[str, Any], share: Sequence[tuple[int, Settings | PidemuError]]) -> Sequence[ConversionRow]:
    return [_row(card, how, source) for _, source in share]


def _row(card: Card, how: Mapping[str, Any], source: Settings | PidemuError) -> ConversionRow:
    """Convert one, and return what came of it."""
    try:
        if isinstance(source, PidemuError):
            raise source
        return _told(convert(source, card, **how))
    except QuestionError as error:
        return ConversionRow("question", reason=str(error))
    except ConversionRefusedError as error:
        return ConversionRow("refused", reason=str(error))
    except PidemuError as error:
        return ConversionRow("failed", reason=str(error))


def _told(c: Conversion) -> ConversionRow:
    feedback, setpoint = c.certificate.headline.loop_band, c.certificate.setpoint_headline.loop_band
    return ConversionRow(
        "converted",
        c.verdict,
        c.match,
        c.refusal,
        (feedback.max_deviation, feedback.gain_db, feedback.phase_deg, setpoint.max_deviation),
        {name: value.value for name, value in c.settings.items() if value.active},
        c.settings.options,
    )
