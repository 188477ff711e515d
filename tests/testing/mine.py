"""A stranger's PID, right, and with the mistakes that people make."""

from __future__ import annotations

from pidemu.settings.settings import Settings


class Mine:
    """generic/standard, written anew: backward rules, back-calculation with Tt = Ti, a bumpless first scan."""

    derivative_sign = 1.0
    winds_up = False
    starts_from_zero = False

    def __init__(self, settings: Settings, scan: float, limits: tuple[float, float] | None, initial_output: float) -> None:
        self.scan_interval, self.limits, self.last = scan, limits or (0.0, 100.0), initial_output
        self.integral, self.was_auto = 0.0, False
        self.before: float | None = None
        self.change(settings)

    def change(self, settings: Settings) -> None:
        self.K, self.Ti, self.Td = (settings[name].value for name in ("K", "Ti", "Td"))

    def scan(self, sp: float, pv: float, auto: bool, manual: float | None) -> float:
        h, e = self.scan_interval, sp - pv
        P = self.K * e
        D = 0.0 if self.before is None else self.derivative_sign * self.K * self.Td / h * (e - self.before)
        self.before = e
        if self.was_auto or self.starts_from_zero:
            self.integral += self.K * h / self.Ti * e
        else:
            self.integral = self.last - P - D
        v = P + self.integral + D
        out = min(max(v, self.limits[0]), self.limits[1])
        if not self.winds_up:
            self.integral += h / self.Ti * (out - v)
        self.last = out if auto else self.last if manual is None else manual
        self.was_auto = auto
        return self.last


class WrongSignOfD(Mine):
    derivative_sign = -1.0


class WindsUp(Mine):
    winds_up = True


class StartsFromZero(Mine):
    starts_from_zero = True
