"""What is remarkable about a loop's settings: never tuned, without gain, unused, out of proportion."""

from __future__ import annotations

from pidemu.card.model.base import Form
from pidemu.plant.reading_model import LoopReading
from pidemu.settings.settings import Settings
from pidemu.units import Role


def note_settings(reading: LoopReading, settings: Settings) -> None:
    """Note what is remarkable about settings: never tuned, without gain, unused, out of proportion.

    Parameters
    ----------
    reading : LoopReading
        Gets the findings.
    settings : Settings
        The settings.
    """
    dials = {role: settings.by_role(role) for role in (Role.GAIN, Role.INTEGRAL, Role.DERIVATIVE)}
    gain, integral, derivative = (dials[role] for role in (Role.GAIN, Role.INTEGRAL, Role.DERIVATIVE))
    values = [v for v in (gain, integral, derivative) if v is not None]
    if values and all(not v.value or v.off for v in values):
        reading.find("D-unused", "all settings are zero: nothing was ever set")
    elif gain is not None and not gain.value:
        reading.find("D-zero-gain", f"{gain.name} is 0, and other settings are not")
    tuned = [v for v in (gain, integral) if v is not None]
    delivered = len(tuned) == 2 and all(v.setting.default is not None and v.value == v.setting.default for v in tuned)
    if delivered and (derivative is None or derivative.off or derivative.value == derivative.setting.default):
        reading.find("D-default", f"the settings are those that {settings.card.id} is delivered with")
    law = settings.algorithm()
    if not law.ki and not {"D-no-integral", "D-unused", "D-zero-gain"} & set(reading.codes):
        reading.find("D-no-integral", "there is no integral action")
    times = times_of(settings)
    if times is not None and times[1] > times[0]:
        reading.find("F-td-ti", f"the derivative time, {times[1]:g} s, is longer than the integral time, {times[0]:g} s")


def times_of(settings: Settings) -> tuple[float, float] | None:
    """Return integral and derivative time [s], those on the dials, or of gains of their own those that these amount to.

    Parameters
    ----------
    settings : Settings
        The settings.

    Returns
    -------
    tuple of float or None
        ``None`` without gain or integral action.
    """
    law = settings.algorithm()
    if not (law.ki and law.kp):
        return None
    integral, derivative = settings.by_role(Role.INTEGRAL), settings.by_role(Role.DERIVATIVE)
    if settings.equation.form is Form.PARALLEL or integral is None:
        return law.kp / law.ki, law.kd / law.kp
    return 1 / integral.canonical, 0.0 if derivative is None else derivative.canonical
