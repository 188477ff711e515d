"""Files of loops that were faults once."""

from __future__ import annotations

from tools.fuzz.case import OLD, Case

_HEAD = "tag,card,settings,process,scan\n"
_GOOD = 'FIC-1,generic/standard,K=1;Ti=10;Td=0,"gain=1,lag=10,delay=1",1\n'
_LAST = 'FIC-2,fisher/provox,GAIN=1;RESET=4,"gain=1,lag=10,delay=1",1\n'
_FLEET = ("fleet", "loops.csv", "--time", "20", "--cores", "1", "--no-progress")


def _case(text: str, *more: str, direct: bool = False) -> Case:
    files = {"loops.csv": text.encode(), f"{OLD}.csv": b"tag,card,status\nA,x/y,done\n"}
    return Case((*_FLEET, *more), files, direct=direct, limit=10.0)


def _row(tag: str = "X", card: str = "generic/standard", settings: str = "K=1;Ti=10;Td=0", process: str = "gain=1,lag=10") -> str:
    return f'{tag},{card},{settings},"{process}",1\n'


def corpus() -> dict[str, Case]:
    """Return the files by name; a good loop stands before and after what is bad."""
    rows = {
        "tag-with-a-number-sign": _row("#1 boiler"),
        "excel-error-as-tag": _row("#REF!"),
        "tag-that-is-a-formula": _row("=1+1"),
        "tag-with-at": _row("@SUM(1)"),
        "tag-with-plus": _row("+1"),
        "tag-with-minus": _row("-1"),
        "tag-that-writes-to-the-terminal": _row("\x1b]0;title\x07"),
        "tag-that-turns-the-line": _row("\u202eevil"),
        "card-that-is-a-formula": _row(card="=1+1"),
        "eleven-lags": _row(process=",".join(["gain=1", *(f"lag={i}" for i in range(1, 12))])),
        "card-of-300-characters": _row(card="a/" + "b" * 300),
        "card-with-null": _row(card="a/b\x00"),
        "cell-beyond-the-reader": _row("x" * 131_073),
        "process-of-one-huge-lag": _row(process="gain=1,lag=1e300"),
        "process-of-no-gain-to-speak-of": _row(process="gain=5e-324,lag=1"),
    }
    found: dict[str, Case] = {}
    for name, row in rows.items():
        text = _HEAD + _GOOD + row + _LAST
        found[name] = _case(text, "--table", "old.csv")
        found[f"{name}-json"] = _case(text, "--json", "--no-margins")
        found[f"{name}-shown"] = _case(text, "--no-margins")
        found[f"{name}-read"] = _case(text, direct=True)
    good = _HEAD + _GOOD + _LAST
    dahlin = "".join(_row(f"D{i}", "generic/dahlin", "Kp=1;tau=10;theta=500;lambda=10") for i in range(2))
    found["dahlin-with-500-scans-of-delay"] = _case(_HEAD + _GOOD + dahlin + _LAST, "--engine", "numpy", "--table", "old.csv")
    found["table-is-the-file"] = _case(good, "--table", "loops.csv")
    found["refused-with-an-old-result"] = _case(good, "--table", "old.csv", "--load", "1e999")
    found["no-loop-with-an-old-result"] = _case(_HEAD, "--table", "old.csv")
    found["disk-full"] = _case(good, "--table", "/dev/full")
    return found
