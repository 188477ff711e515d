"""The certificate of a conversion as one page to print and sign: it stands alone, and the same conversion gives the same bytes."""

from __future__ import annotations

from pathlib import Path

from pidemu.conversion.result import Conversion
from pidemu.cutover.plan import TransferPlan
from pidemu.errors import PidemuError
from pidemu.report.contents import Contents
from pidemu.report.pages import template, write


def certificate_page(conversion: Conversion, plan: TransferPlan | None = None) -> str:
    """Return the certificate as an HTML page that needs nothing else: no script, no style sheet, no picture from elsewhere.

    Parameters
    ----------
    conversion : Conversion
        The conversion.
    plan : TransferPlan, optional
        How to change over, as `Conversion.transfer_plan` gives it.

    Returns
    -------
    str
        The page. It bears no date: the same conversion gives the same page.

    Raises
    ------
    PidemuError
        Matplotlib or Jinja is not installed.
    """
    _check_extra()
    return template("certificate.html.j2").render(page=Contents(conversion, plan))


def write_page(path: str | Path, conversion: Conversion, plan: TransferPlan | None = None) -> None:
    """Write the certificate as an HTML page.

    Parameters
    ----------
    path : path
        The file; its name ends in ``.html``.
    conversion, plan
        As for `certificate_page`.

    Raises
    ------
    PidemuError
        The file has another ending or cannot be written, or what `certificate_page` raises.
    """
    if Path(path).suffix.lower() != ".html":
        raise PidemuError(f"{path}: the certificate is written as .html; give the file this ending")
    write(path, certificate_page(conversion, plan))


def _check_extra() -> None:
    try:
        import jinja2  # noqa: F401
        import matplotlib.figure  # noqa: F401
    except ImportError as error:
        name = "Jinja" if (error.name or "").startswith("jinja2") else "matplotlib"
        raise PidemuError(f"the page needs {name}, which is not installed; pip install 'pidemu[report]'") from None
