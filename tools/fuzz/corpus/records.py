"""Records that were faults once."""

from __future__ import annotations

from tools.fuzz.case import OLD, Case

_ROWS = "".join(f"{i},{50 + i},1\n" for i in range(5))
_RUN = ("run", "generic/standard", "K=2", "Ti=10", "Td=1", "--scan", "1", "--record", "record.csv")
_OLD = {f"{OLD}.csv": b"sp,pv,emulated\n1,2,3\n"}


def _case(content: str | bytes, *more: str, direct: bool = False) -> Case:
    raw = content.encode() if isinstance(content, str) else content
    return Case((*_RUN, *more), {"record.csv": raw, **_OLD}, direct=direct)


def corpus() -> dict[str, Case]:
    """Return the records by name."""
    usual = f"sp,pv,auto\n{_ROWS}"
    damaged: dict[str, str | bytes] = {
        "excel-error-in-first-cell": f"sp,pv,auto\n#REF!,50,1\n{_ROWS}",
        "comment-among-the-rows": f"sp,pv,auto\n{_ROWS}# 1,2,3\n{_ROWS}",
        "underscore-in-number": f"sp,pv,auto\n1_0,50,1\n{_ROWS}",
        "arabic-digits": f"sp,pv,auto\n٣,50,1\n{_ROWS}",
        "two-byte-order-marks": b"\xef\xbb\xbf\xef\xbb\xbf" + usual.encode(),
        "vertical-tab": f"sp,pv,auto\n1\x0b,50,1\n{_ROWS}",
        "line-separator": f"sp,pv,auto\n1,50,1\u20282,50,1\n{_ROWS}",
        "next-line": f"sp,pv,note\n1,50,a\x85b\n{_ROWS}",
        "null": f"sp,pv,note\n1,50,a\x00b\n{_ROWS}",
        "escape-in-a-cell": f"sp,pv,note\n1,50,\x1b[31mred\n{_ROWS}",
        "escape-in-a-number": f"sp,pv,auto\n1\x1b[2J,50,1\n{_ROWS}",
        "escape-in-a-heading": f"sp,p\x1b[2Jv\n1,50\n{_ROWS}",
        "cell-beyond-the-reader": f"sp,pv,note\n1,50,{'x' * 131_073}\n",
        "number-of-a-megabyte": f"sp,pv\n1,{'9' * 1_000_000}\n",
        "utf-16-big-endian": usual.encode("utf-16-be"),
        "utf-16-with-mark": usual.encode("utf-16"),
        "one-measurement-of-1e300": "sp,pv\n" + "50,50\n" * 5 + "50,1e300\n" + "50,50\n" * 20,
        "recorded-output-beyond-all": f"sp,pv,output\n1,50,1e200\n{_ROWS}",
        "hostile-spreadsheet": f"sp,pv,note\n1,50,=cmd|'/c calc'!A0\n{_ROWS}",
    }
    found = {name: _case(content) for name, content in damaged.items()}
    found |= {f"{name}-read": _case(content, direct=True) for name, content in damaged.items()}
    found["output-is-the-record"] = _case(usual, "-o", "record.csv")
    found["refused-with-an-old-result"] = _case("sp,pv\nx,50\n", "-o", "old.csv")
    found["disk-full"] = _case(usual, "-o", "/dev/full")
    found["limits-upside-down"] = _case(usual, "--limits", "100,0")
    found["name-that-is-not-utf-8"] = Case(("run", "generic/standard", "K=1", "Ti=1", "--record", "\udcff.csv"))
    found["link-to-itself"] = Case(("run", "generic/standard", "K=1", "Ti=1", "--record", "x.csv"), links={"x.csv": "x.csv"})
    return found
