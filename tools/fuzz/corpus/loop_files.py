"""Loop files that were faults once."""

from __future__ import annotations

from tools.fuzz.case import Case

_BODY = "card: fisher/provox\nsettings: {GAIN: 2, RESET: 4}\nto: emerson/deltav\n"


def corpus() -> dict[str, Case]:
    """Return the files by name."""
    texts = {
        "l5x": '<?xml version="1.0" encoding="UTF-8"?>\n<RSLogix5000Content>\n<Controller/>\n</RSLogix5000Content>\n',
        "deep": "card: " + "[" * 5000,
        "laughs": "a: &a [x, x]\nb: &b [*a, *a]\ncard: *b\n",
        "tag-of-python": "card: !!python/object/apply:os.system [true]\n",
        "escape-in-a-tag": _BODY + 'tag: "\\e[31mred"\n',
        "turned-tag": _BODY + 'tag: "\\u202eevil"\n',
        "null-in-a-card": _BODY.replace("fisher/provox", '"a/b\\0"'),
        "long-card": _BODY.replace("fisher/provox", "a/" + "b" * 300),
        "limits-upside-down": _BODY + "limits: [100, 0]\n",
        "scan-of-no-time": _BODY + "scan: 5e-324\n",
        "scan-of-all-time": _BODY + "scan: 1e300\n",
        "number-of-5000-digits": _BODY + f"bias: {'9' * 5000}\n",
        "unknown-keys-20000": _BODY + "".join(f"unknown{i}: 1\n" for i in range(20_000)),
        "line-of-five-megabytes": _BODY + "unknown: [" + "1, " * 1_700_000 + "1]\n",
        "loop-gain-of-one-per-scan": "card: generic/standard\nsettings: {K: 1, Ti: 10}\nto: generic/parallel\n"
        "process: gain=1,integrators=1\nscan: 1\n",
    }
    found = {name: Case(("convert", "--loop", "loop.yaml"), {"loop.yaml": text.encode()}) for name, text in texts.items()}
    found["link-to-itself"] = Case(("convert", "--loop", "loop.yaml"), links={"loop.yaml": "loop.yaml"})
    return found
