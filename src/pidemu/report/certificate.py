"""The certificate of a conversion as one page to print and sign: it stands alone, and the same conversion gives the same bytes."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Final

from pidemu.conversion.result import Conversion
from pidemu.cutover.plan import TransferPlan
from pidemu.errors import PidemuError
from pidemu.report.contents import Contents

if TYPE_CHECKING:
    from jinja2 import Template

_TEMPLATE: Final = "certificate.html.j2"


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
    return _template().render(page=Contents(conversion, plan))


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
    page = certificate_page(conversion, plan)
    try:
        Path(path).write_text(page, encoding="utf-8", newline="\n")
    except OSError as error:
        raise PidemuError(f"{path}: cannot be written: {error.strerror}") from None


def _template() -> Template:
    try:
        import jinja2
        import matplotlib.figure  # noqa: F401
    except ImportError as error:
        name = "Jinja" if (error.name or "").startswith("jinja2") else "matplotlib"
        raise PidemuError(f"the page needs {name}, which is not installed; pip install 'pidemu[report]'") from None
    text = resources.files("pidemu.report").joinpath(_TEMPLATE).read_text(encoding="utf-8")
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    return environment.from_string(text)
