"""Certificates that were faults once."""

from __future__ import annotations

from tools.fuzz.case import Case


def corpus() -> dict[str, Case]:
    """Return the files by name."""
    texts = {
        "deep": "[" * 100_000,
        "deep-mapping": '{"a":' * 50_000,
        "number-of-5000-digits": '{"pidemu": ' + "9" * 5000 + "}",
        "half-a-pair": '{"pidemu": "\\ud800"}',
        "not-a-number": '{"pidemu": NaN}',
        "escape": '{"\\u001b[31m": 1}',
        "empty": "",
    }
    return {name: Case(("verify", "certificate.json"), {"certificate.json": text.encode()}) for name, text in texts.items()}
