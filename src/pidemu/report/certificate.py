"""The certificate of a conversion as a page to print and sign: it stands alone; the same conversion and date, the same bytes."""

from __future__ import annotations

import datetime
from dataclasses import replace
from pathlib import Path

from pidemu.conversion.request import DIGITS
from pidemu.conversion.result import Conversion
from pidemu.cutover.plan import TransferPlan
from pidemu.errors import PidemuError
from pidemu.report.contents import Contents
from pidemu.report.pages import template, write


def certificate_page(conversion: Conversion, plan: TransferPlan | None = None, *, date: datetime.date | None = None) -> str:
    """Return the certificate as an HTML page that needs nothing else: no script, no style sheet, no picture from elsewhere.

    Parameters
    ----------
    conversion : Conversion
        The conversion. Where its dials were not rounded, the page is about them rounded to five digits: it is right about the
        numbers that are printed.
    plan : TransferPlan, optional
        How to change over, as `Conversion.transfer_plan` gives it.
    date : datetime.date, optional
        Date of the certificate; by default today. The same conversion and date give the same page.

    Returns
    -------
    str
        The page.

    Raises
    ------
    PidemuError
        Matplotlib or Jinja is not installed.
    """
    _check_extra()
    return template("certificate.html.j2").render(page=Contents(as_printed(conversion), plan, date or datetime.date.today()))


def as_printed(c: Conversion) -> Conversion:
    """Return a conversion with its dials rounded as they are printed."""
    if c.request.digits is not None:
        return c
    from pidemu.conversion.convert import converted

    emulated = c.certificate.scan_by_scan is not None or bool(c.certificate.not_emulated)
    request = replace(c.request, digits=DIGITS, allow_approximate=c.request.allow_approximate or bool(c.refusal))
    return converted(c.source, c.settings.card, request, emulate=emulated)


def write_page(
    path: str | Path, conversion: Conversion, plan: TransferPlan | None = None, *, date: datetime.date | None = None
) -> None:
    """Write the certificate as an HTML page.

    Parameters
    ----------
    path : path
        The file; its name ends in ``.html``.
    conversion, plan, date
        As for `certificate_page`.

    Raises
    ------
    PidemuError
        The file has another ending or cannot be written, or what `certificate_page` raises.
    """
    if Path(path).suffix.lower() != ".html":
        raise PidemuError(f"{path}: the certificate is written as .html; give the file this ending")
    write(path, certificate_page(conversion, plan, date=date))


def _check_extra() -> None:
    try:
        import jinja2  # noqa: F401
        import matplotlib.figure  # noqa: F401
    except ImportError as error:
        name = "Jinja" if (error.name or "").startswith("jinja2") else "matplotlib"
        raise PidemuError(f"the page needs {name}, which is not installed; pip install 'pidemu[report]'") from None
