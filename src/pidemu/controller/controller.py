"""A controller that runs: one scan at a time, or over recorded signals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import isnan, nan
from typing import TYPE_CHECKING, Literal

import numpy as np
import numpy.typing as npt

from pidemu.algorithm.model import Algorithm
from pidemu.arrays import Floats
from pidemu.backends.choice import Choice, checked, for_record
from pidemu.backends.engine_names import Engine
from pidemu.card.model.card_file import default_scan
from pidemu.card.model.operation import Faults
from pidemu.columns.functions import isfinite
from pidemu.controller.faults import bad_signal, largest_signal, usable_interval
from pidemu.controller.idle_terms import idle_dials, silenced, with_gains
from pidemu.controller.running import Running
from pidemu.controller.signals import FINITE, MODES, SIGNALS, Event, Mode, absent, broadcast, mode_of, modes_of, stretches
from pidemu.errors import PidemuError, ScanError, suggest
from pidemu.plausible import INTERVAL, LEVEL, SIGNAL, number, plausible, shown
from pidemu.program.builder import build
from pidemu.program.ir import Program, StateRole
from pidemu.settings.action import Action
from pidemu.settings.settings import Settings

if TYPE_CHECKING:
    from pidemu.backends.python import Compiled
    from pidemu.backends.runner import Runner


def _pair(limits: Sequence[float]) -> tuple[float, float]:
    try:
        low, high = (number(x) for x in limits)
    except (TypeError, ValueError):
        raise ScanError(f"output limits {shown(limits)} are not a pair of numbers such as (0, 100)") from None
    return _limit(low), _limit(high)


def _limit(x: float) -> float:
    """Return an output limit; an infinite one is none."""
    return plausible("output limit", x, LEVEL, ScanError) if isfinite(x) else x


def _number(name: str, given: object) -> float:
    """Return a signal, which may be NaN or infinite."""
    try:
        return number(given)
    except ValueError as error:
        raise ScanError(f"{name}: {error}") from None


def _gain_ratio(old: Settings, new: Settings) -> float:
    """Return what a derivative that is remembered without its gain becomes with another one."""
    before, now = old.algorithm(own_units=True).kd, new.algorithm(own_units=True).kd
    return now / before if before else 1.0


class Controller:
    """The controller of a card, with settings, running at a scan interval.

    Parameters
    ----------
    settings : Settings
        Card and settings.
    scan : float, optional
        Scan interval [s]; by default the card's.
    action : {"reverse", "direct"}
        Control action in the ISA sense: reverse means that the output falls when the measurement rises. The card's own words are in
        ``settings.equation.action.names``. Where the card has no such choice (``settings.equation.action.fixed``), the sign of the
        gain decides, and this argument does nothing.
    output_limits : tuple of float, optional
        Low and high output limit [% of span; engineering units for a card with ``signals: engineering``]; by default the card's.
    bias : float
        Output at zero error of a positional controller without integral action [as limits].
    initial_output : float
        Output before the first scan [as limits]; the first automatic scan is a transfer from there.
    engine : {"python", "numpy", "numba", "c"}, optional
        Which back end `run` uses; all give the same bits. By default the quickest for the length of the record
        (`pidemu.backends.choice`). Single scans are always plain Python.

    Attributes
    ----------
    settings : Settings
        The settings in force.
    interval : float
        Nominal scan interval [s].
    program : Program
        The scan program.
    events : list of Event
        Changes of mode with their bumps, changes of settings, what was wrong with signals and intervals, and states that stopped
        being finite numbers, as far as `run` and signals beyond 1e30 made them.
    engine : Choice
        Which back end the last `run` used, and why.

    Raises
    ------
    ScanError
        Scan interval, limits or action cannot be used.
    EngineError
        The engine is not there.

    Examples
    --------
    >>> import pidemu
    >>> s = pidemu.load_card("generic/standard").settings(K=2, Ti=10, Td=0)
    >>> ctl = pidemu.Controller(s, scan=1.0, initial_output=40.0)
    >>> [ctl.scan(sp=50.0, pv=50.0), ctl.scan(sp=51.0, pv=50.0)]
    [40.0, 42.2]
    """

    def __init__(
        self,
        settings: Settings,
        scan: float | None = None,
        action: Action = "reverse",
        output_limits: tuple[float, float] | None = None,
        *,
        bias: float = 0.0,
        initial_output: float = 0.0,
        engine: Engine | None = None,
    ) -> None:
        self._forced = checked(engine)
        self.engine = Choice(self._forced or "python", "asked for" if self._forced else "nothing has been run")
        if action not in ("reverse", "direct"):
            names = settings.equation.action.names
            words = ", ".join(f"'{k}' ({v})" for k, v in names.items())
            raise ScanError(f"action is '{action}'; it is one of {words}")
        self.interval = default_scan(settings.equation) if scan is None else plausible("scan interval", scan, INTERVAL, ScanError)
        self.events: list[Event] = []
        self._action: Action = "reverse" if settings.equation.action.fixed else action
        self._limits = _pair(settings.equation.output.limits if output_limits is None else output_limits)
        self._bias = plausible("bias", bias, LEVEL, ScanError)
        self._initial_output = plausible("initial output", initial_output, LEVEL, ScanError)
        self._kept = 0.0  # what an integral held that was switched off while running
        self._terms_run_on = not self._bias
        self._signals: tuple[str, ...] = ()
        self._mode: Mode = "power-up"
        self._count = 0
        self._last: tuple[float, ...] = ()
        self._use(settings, self._running_with(settings))

    def _use(self, settings: Settings, running: Running) -> None:
        """Go on with settings and their program."""
        self.settings = settings
        self._faults = settings.equation.faults or Faults()
        self._largest = largest_signal(settings.card)
        self._running = running
        self.program: Program = running.program
        self._scan, self._state = running.compiled.scan, running.state
        self._lost = set(running.not_finite())
        self._know_the_everyday_scan()

    def _running_with(self, settings: Settings) -> Running:
        """Return the program of settings, at its start."""

        def built(a: Algorithm, h: float) -> Program:
            alone = not (a.ki or a.velocity or a.dahlin)
            return build(
                a,
                h,
                action=self._action,
                limits=self._limits,
                bias=self._bias + self._kept if alone else self._bias,
                initial_output=self._initial_output,
                signals=self._signals,
                title=f"{settings.summary}; scan {self.interval:g} s, {self._action} acting",
            )

        idle = idle_dials(settings) if self._terms_run_on else {}
        whole = with_gains(settings, idle) if idle else None
        if whole is None:
            return Running(lambda h: settings.algorithm(own_units=True, scan=h), built, self.interval)
        sets = frozenset(idle.values())
        return Running(
            lambda h: whole.algorithm(own_units=True, scan=h),
            lambda a, h: silenced(built, a, h, sets),
            self.interval,
            built(settings.algorithm(own_units=True, scan=self.interval), self.interval),
        )

    def _know_the_everyday_scan(self) -> None:
        """Keep in mind whether a scan without anything special goes straight to the program."""
        self._plain = self._mode == "automatic" and not self._signals and self.program.precision == "float64"

    @property
    def state(self) -> dict[str, float]:
        """What the program keeps from scan to scan, by name."""
        return self._running.named()

    @property
    def lean_program(self) -> Program:
        """The scan program without terms that run on with a gain of 0: what is printed, as nothing changes there."""
        return self._running.plain or self.program

    @property
    def output(self) -> float:
        """The last output."""
        return self._running[StateRole.OUTPUT]

    @property
    def mode(self) -> Mode:
        """The mode of the last scan."""
        return self._mode

    def reset(self) -> None:
        """Go back to before the first scan; the settings stay."""
        if self._kept:
            self._kept = 0.0
            self._use(self.settings, self._running_with(self.settings))
        self._running.reset()
        self._lost = set(self._running.not_finite())
        self._mode, self._count, self._last = "power-up", 0, ()
        self.events.clear()
        self._know_the_everyday_scan()

    def start(self, **states: float) -> None:
        """Set what the program keeps from scan to scan, before the first scan.

        Nothing else is touched: the other states stay where they are before the first scan, most at zero. The first scan is a
        transfer from the output ``u``, which sets the integral anew. With ``I`` it is not: the controller goes on as if it had been
        running in automatic, ``on`` and ``begun`` are 1 where the program has them, and what is kept of signals and filters should
        be given too. All states of another controller, ``start(**other.state)``, let this one go on where that one is.

        Parameters
        ----------
        **states
            Values by the names that `state` shows.

        Raises
        ------
        ScanError
            There has been a scan, the program has no such state, or a value is not a finite number.
        """
        names = [q.name for q in self.program.states]
        if self._count:
            raise ScanError(f"states are set before the first scan, and there have been {self._count}; reset() first")
        for name, value in states.items():
            if name not in names:
                raise ScanError(f"no state '{name}'{suggest(name, names)}; states: {', '.join(names)}")
            if not isfinite(_number(f"the state {name}", value)):
                raise ScanError(f"the state {name} = {value} is not a finite number")
        running = {name: 1.0 for name in (StateRole.MODE, StateRole.BEGUN) if StateRole.INTEGRAL in states and name in names}
        for name, value in (running | states).items():
            self._running[name] = value

    def rest(self, sp: float, pv: float, output: float) -> None:
        """Start at rest, as if the controller had been in automatic with these signals and this output for ever.

        Parameters
        ----------
        sp, pv : float
            Setpoint and measurement, as in `scan`.
        output : float
            The output [as output limits].

        Raises
        ------
        ScanError
            There has been a scan, or a value is not a finite number.
        """
        if self._count:
            raise ScanError(f"a controller starts at rest before the first scan, and there have been {self._count}; reset() first")
        sp, pv, output = (_number(name, x) for name, x in (("sp", sp), ("pv", pv), ("output", output)))
        if not all(abs(x) <= self._largest for x in (sp, pv, output)):
            raise ScanError(f"setpoint {sp}, measurement {pv} and output {output} must be finite numbers of a signal's size")
        if self._terms_run_on and self._running.plain is not None:  # nothing has run yet that could run on
            self._terms_run_on = False
            self._use(self.settings, self._running_with(self.settings))
        last = self._running.rest(sp, pv, output)
        self._mode, self._last = "automatic", self._running.inputs(last)
        self._know_the_everyday_scan()

    def change(self, settings: Settings | Mapping[str, object] | None = None, /, **values: object) -> Settings:
        """Change settings while running, as the real controller takes it (specs/equations.md, section 6).

        The states stay. A gain that acts on what the integral holds bumps the output; a card with ``changes: bumpless`` sets the
        integral so that it does not. Where the new settings bring terms that were off, these start at rest, from the last signals.

        Parameters
        ----------
        settings : Settings or mapping, optional
            New settings of the same card; or a mapping of those that change.
        **values
            Settings and options that change, by name.

        Returns
        -------
        Settings
            The settings now in force.

        Raises
        ------
        ScanError
            The settings are another card's.
        SettingError
            A setting is unknown or out of range; the old ones stay in force.
        """
        old = self.settings
        if isinstance(settings, Settings):
            new = settings.changed(values) if values else settings
        else:
            new = old.changed({**(settings or {}), **values})
        if new.card.id != old.card.id:
            raise ScanError(f"the controller runs {old.card.id}; settings of {new.card.id} need a controller of their own")
        before, constant = self._running, self._kept
        self._kept = self._constant_left_by(new)
        try:
            after = self._running_with(new)
        except PidemuError:
            self._kept = constant
            raise
        last = self._last_inputs()
        weights = (old.algorithm().c, new.algorithm().c)
        other_signal = weights[0] != weights[1]  # what the derivative remembers is another signal's
        kept = {n: x for n, x in before.named().items() if not (other_signal and n in ("x1", "x2", "x3"))}
        if old.equation.derivative.holds == "d" and "D" in kept:
            kept["D"] *= _gain_ratio(old, new)
        after.take_over(kept, last)
        if last:
            if new.algorithm().transfer.changes == "bumpless" and self._mode in ("automatic", "cascade"):
                after.keep_output(before, last)
            bump = after.would_be(last) - before.would_be(last)
            changed = [f"{n} = {v.value:g}" for n, v in new.items() if n not in old or old[n].value != v.value]
            changed += [f"{n} = {c}" for n, c in new.options.items() if old.options[n] != c]
            self.events.append(Event(self._count, "settings", ", ".join(changed) or "no change", bump))
        self._use(new, after)
        return new

    def _last_inputs(self) -> dict[str, float]:
        """Return the inputs of the last scan by name; none before the first."""
        return dict(zip((q.name for q in self.program.inputs), self._last, strict=True)) if self._last else {}

    def _constant_left_by(self, new: Settings) -> float:
        """Return what the integral leaves behind where new settings switch it off and the card keeps it."""
        if self._terms_run_on and {"gain", "integral"} & set(idle_dials(new).values()):
            return 0.0
        old, a = self.settings.algorithm(own_units=True), new.algorithm(own_units=True)
        if a.ki or a.velocity or a.transfer.without_integral != "kept" or a.transfer.way.loads_output:
            return 0.0
        if not old.ki or StateRole.INTEGRAL not in self._running:
            return self._kept
        sign = 1.0 if self._action == "reverse" else -1.0
        scale = {"ki e": 1.0, "e/Ti": sign * a.kp, "e": 0.0}[old.integral.holds]
        return scale * self._running[StateRole.INTEGRAL]

    def scan(
        self,
        sp: float,
        pv: float,
        auto: bool = True,
        manual: float | None = None,
        *,
        cascade: float | None = None,
        track: float | None = None,
        external_reset: float | None = None,
        feedforward: float | None = None,
        hold: bool = False,
        interval: float | None = None,
    ) -> float:
        """Do one scan.

        Parameters
        ----------
        sp, pv : float
            Setpoint and measurement [% of span; engineering units for a card with ``signals: engineering``]. What happens with NaN
            and infinity is the card's (``faults.signal``); by default the output is held and `events` says so. The same holds for
            what is larger than any signal, beyond 1e30, except with software whose code is known.
        auto : bool
            Automatic; otherwise manual.
        manual : float, optional
            Output set by the operator in manual [as output limits]; without it the output is held.
        cascade : float, optional
            Remote setpoint: an automatic loop is in cascade while there is one.
        track : float, optional
            Output to follow: the loop is tracking while there is one, whatever `auto` says.
        external_reset : float, optional
            External reset signal, for cards whose windup scheme is external-reset [as output limits].
        feedforward : float, optional
            Feedforward signal, for cards that have one [as output limits].
        hold : bool
            Nothing is computed and the output stands. The next scan in automatic is a transfer as the card makes it
            (``transfer.start``): bumpless with most, with the real one's bump where the setpoint has moved meanwhile with others.
        interval : float, optional
            Time since the last scan [s]; by default the nominal one. It counts with cards that measure it (``scan.interval:
            measured``).

        Returns
        -------
        float
            The output.

        Raises
        ------
        ScanError
            The manual output is infinite, the card has no use for a signal, or it refuses the interval.
        """
        everyday = self._plain and auto is True and manual is None and interval is None and not hold
        everyday = everyday and type(sp) is float and type(pv) is float
        usual = everyday and not self._lost and -SIGNAL <= sp <= SIGNAL and -SIGNAL <= pv <= SIGNAL
        if usual and cascade is track is external_reset is feedforward is None:
            self._last = (sp, pv, 1.0, nan)
            self._count += 1
            return self._scan(self._state, sp, pv, 1.0, nan)
        signals = (cascade, track, external_reset, feedforward)
        given = {name: _number(name, x) for name, x in zip(SIGNALS, signals, strict=True) if x is not None}
        by_hand = nan if manual is None else _number("manual", manual)
        since = None if interval is None else _number("interval", interval)
        return self._any_scan(_number("sp", sp), _number("pv", pv), auto, by_hand, given, hold, since)

    def _any_scan(
        self, sp: float, pv: float, auto: bool, by_hand: float, given: Mapping[str, float], hold: bool, interval: float | None
    ) -> float:
        """Do a scan that is not the everyday one: another mode, other signals, what is wrong with them."""
        if given:
            self._read(given)
        for name, value in (("manual", by_hand), *given.items()):
            if name in FINITE and abs(value) > self._largest:
                raise ScanError(f"the {FINITE[name]} {value} is {self._beyond(value)}")
        signals = (
            absent(s) if s == "feedforward" and given.get(s) != given.get(s) else given.get(s, absent(s)) for s in self._names
        )
        inputs = (sp, pv, 1.0 if auto else 0.0, by_hand, *signals)
        mode = mode_of(auto, given)
        bad = not (abs(sp) <= self._largest and abs(pv) <= self._largest) or abs(given.get("cascade", nan)) > self._largest
        if hold or interval is not None or bad:
            return self._odd_scan(mode, inputs, hold, interval)
        return self._scanned(self._running.compiled, mode, inputs)

    @staticmethod
    def _beyond(value: float) -> str:
        """Return what is wrong with a signal that may not be infinite."""
        return f"larger than any signal, {SIGNAL:g}" if isfinite(value) else "not a finite number"

    def _note_lost(self, state: Sequence[float], scan: int) -> None:
        """Note which states are no longer finite numbers from a scan on."""
        found = self._running.not_finite(state)
        new = [f"{name} = {x}" for name, x in found.items() if name not in self._lost]
        if new:
            self.events.append(Event(scan, "state", f"state no longer finite: {', '.join(new)}"))
        self._lost = set(found)

    def _scanned(self, compiled: Compiled, mode: Mode, inputs: tuple[float, ...]) -> float:
        """Do one scan and note a change of mode."""
        was = self.output
        with self._running.quiet():
            u = float(compiled.scan(self._state, *inputs))
        if mode != self._mode:
            self._transfer(self._count, mode, u - was)
        self._note_lost(self._state, self._count)
        self._last = inputs
        self._count += 1
        return u

    def _transfer(self, scan: int, mode: Mode, bump: float) -> None:
        self.events.append(Event(scan, "transfer", f"{self._mode} to {mode}", bump))
        self._mode = mode
        self._know_the_everyday_scan()

    @property
    def _names(self) -> list[str]:
        """The arguments that the program reads, in its order."""
        wanted = {program: argument for argument, program in SIGNALS.items()}
        return [wanted[q.name] for q in self.program.inputs[4:]]

    def listen(self, *signals: str) -> None:
        """Make the program read signals, by the names of the arguments of `scan`, before they come.

        Parameters
        ----------
        *signals : {"cascade", "track", "external_reset", "feedforward"}
            Which signals.

        Raises
        ------
        ScanError
            There is no such signal, or the card has no use for it.
        """
        for name in signals:
            if name not in SIGNALS:
                raise ScanError(f"no signal '{name}'{suggest(name, SIGNALS)}; signals: {', '.join(SIGNALS)}")
        self._read(dict.fromkeys(signals))

    def _read(self, extra: Mapping[str, object]) -> None:
        """Make the program read signals that it did not read so far."""
        for reason in self.settings.without_use_for(extra).values():
            raise ScanError(f"{reason}; leave the signal out")
        wanted = tuple(program for argument, program in SIGNALS.items() if argument in extra or program in self._signals)
        if wanted != self._signals:
            self._signals, state = wanted, self.state
            last = self._last_inputs()
            running = self._running_with(self.settings)
            running.take_over(state, last)
            self._use(self.settings, running)
            self._last = running.inputs(last) if last else ()

    def _note(self, kind: Literal["signal", "interval"], text: str) -> None:
        """Note what is wrong with a scan; the same in the scan before is one event with it."""
        last = self.events[-1] if self.events else None
        if last is not None and (last.kind, last.text) == (kind, text) and last.scan + last.scans == self._count:
            self.events[-1] = replace(last, scans=last.scans + 1)
        else:
            self.events.append(Event(self._count, kind, text))

    def _odd_scan(self, mode: Mode, inputs: tuple[float, ...], hold: bool, interval: float | None) -> float:
        """Do a scan with a hold, a bad signal or an uneven interval."""
        if hold:
            return self._stand("hold", inputs)
        if mode == "cascade" and not abs(inputs[0]) <= self._largest:  # the local setpoint is not used
            inputs = (inputs[4 + self._names.index("cascade")], *inputs[1:])
        named = {"setpoint": inputs[0], "measurement": inputs[1]}
        if "cascade" in self._signals:
            remote = inputs[4 + self._names.index("cascade")]
            named["remote setpoint"] = 0.0 if isnan(remote) else remote  # none is none, and not a bad one
        text, policy = bad_signal(self._faults, named, self._largest), self._faults.signal
        if text:
            self._note("signal", text)
        if text and policy != "propagate":
            if mode in ("automatic", "cascade"):
                return self._stand(mode, inputs, None if policy == "hold" else nan if policy == "nan" else 0.0)
            if not self._last:
                return self._stand(mode, inputs)
            inputs = (*self._last[:2], *inputs[2:])  # the output is the operator's; the rest goes on with the last good signals
        compiled = self._running.compiled
        if interval is not None and self.settings.equation.scan.interval == "measured":
            h, remark = usable_interval(self._faults, self.settings.card.id, interval)
            if remark:
                self._note("interval", remark)
            if h is None:
                return self._stand(mode, inputs)
            compiled = self._running.at(h)
        return self._scanned(compiled, mode, inputs)

    def _stand(self, mode: Mode, inputs: tuple[float, ...], instead: float | None = None) -> float:
        """Compute nothing: the output is the last one, or the operator's in manual, or `instead`; the state stands still."""
        was = u = self.output
        if mode in ("manual", "tracking", "hold"):
            follow = inputs[4 + self._names.index("track")] if "track" in self._signals else nan
            by_hand = inputs[3] if mode == "manual" else follow if mode == "tracking" else nan
            moved = not isnan(by_hand)
            if moved:
                self._running[StateRole.OUTPUT] = u = by_hand
            if mode == "manual":
                self._running[StateRole.OUTPUT] = u = self._by_hand(u, moved=moved)
            u = self.output
            a = self.settings.algorithm()
            for name, value in ((StateRole.OWN_OUTPUT, u), (StateRole.MODE, 0.0)):
                if name in self._running and not (name == StateRole.OWN_OUTPUT and a.transfer.way.runs_on):
                    self._running[name] = value
            if mode != self._mode:  # a transfer to automatic waits until something is computed
                self._transfer(self._count, mode, u - was)
        self._count += 1
        return u if instead is None else instead

    def _by_hand(self, u: float, *, moved: bool) -> float:
        """Return the output in manual, as the card has it (`transfer.manual-output`)."""
        a = self.settings.algorithm(own_units=True)
        if a.transfer.manual_output == "zero":
            return 0.0
        return a.action.gain_sign * a.kp * u if a.transfer.manual_output == "gain-times-operator" and moved else u

    def run(
        self,
        sp: npt.ArrayLike,
        pv: npt.ArrayLike,
        auto: npt.ArrayLike | None = None,
        manual: npt.ArrayLike | None = None,
        *,
        cascade: npt.ArrayLike | None = None,
        track: npt.ArrayLike | None = None,
        external_reset: npt.ArrayLike | None = None,
        feedforward: npt.ArrayLike | None = None,
        hold: npt.ArrayLike | None = None,
        interval: npt.ArrayLike | None = None,
    ) -> Floats:
        """Do one scan per sample, going on from the present state.

        Parameters
        ----------
        sp, pv : array_like, shape (n,) or scalar
            Setpoint and measurement, as in `scan`; a scalar counts for every sample.
        auto : array_like of bool, shape (n,) or scalar, optional
            Automatic; by default throughout.
        manual : array_like, shape (n,) or scalar, optional
            Output set by the operator; NaN or nothing holds the output.
        cascade, track, external_reset, feedforward : array_like, shape (n,) or scalar, optional
            As in `scan`; NaN where there is no such signal.
        hold : array_like of bool, shape (n,) or scalar, optional
            As in `scan`.
        interval : array_like, shape (n,) or scalar, optional
            Time since the last scan [s], as in `scan`; NaN: none could be measured, so where the card measures it nothing is
            computed and the output is held.

        Returns
        -------
        ndarray of float, shape (n,)
            The outputs.

        Raises
        ------
        ScanError
            The signals have different lengths, the mode is not a number, the manual output is infinite, the card has no use for a
            signal, or it refuses an interval.
        """
        given = {"cascade": cascade, "track": track, "external_reset": external_reset, "feedforward": feedforward}
        extra = {name: x for name, x in given.items() if x is not None}
        if extra:
            self._read(extra)
        columns = {"sp": sp, "pv": pv, "auto": True if auto is None else auto, "manual": nan if manual is None else manual}
        columns |= {s: extra.get(s, absent(s)) for s in self._names}
        columns |= {"hold": False if hold is None else hold, "interval": self.interval if interval is None else interval}
        signals = dict(zip(columns, broadcast(list(columns.values())), strict=True))
        if "feedforward" in signals:
            signals["feedforward"] = np.where(np.isnan(signals["feedforward"]), 0.0, signals["feedforward"])
        for name, bad in (
            ("the mode is not a number", np.isnan(signals["auto"])),
            *(
                (f"the {text} is infinite or larger than any signal", np.abs(signals[s]) > self._largest)
                for s, text in FINITE.items()
                if s in signals
            ),
        ):
            if bad.any():
                raise ScanError(f"{name} in sample {np.flatnonzero(bad)[0]} (counted from 0)")
        measured = interval is not None and self.settings.equation.scan.interval == "measured"
        if measured:
            steps = signals["interval"]
            for i in np.flatnonzero(steps < 0):  # nothing is done where one is refused
                usable_interval(self._faults, f"sample {i} (counted from 0): {self.settings.card.id}", float(steps[i]))
        return self._run(signals, measured)

    def _run(self, signals: Mapping[str, Floats], measured: bool) -> Floats:
        modes = modes_of(signals)
        out = np.empty(modes.size)
        self.engine = for_record(self.program, modes.size, self._forced)
        fast = self._running.runner(self.engine)
        odd = (signals["hold"] > 0) | ~(np.abs(signals["sp"]) <= self._largest) | ~(np.abs(signals["pv"]) <= self._largest)
        odd |= np.abs(signals.get("cascade", signals["sp"])) > self._largest
        if measured:
            odd |= signals["interval"] != self.interval
        inputs = [signals[name] for name in ("sp", "pv", "auto", "manual", *self._names)]
        for start, end in stretches(modes, odd):
            mode = MODES[modes[start]]
            if odd[start]:
                for i in range(start, end):
                    sample = tuple(float(s[i]) for s in inputs)
                    h = float(signals["interval"][i]) if measured else None
                    out[i] = self._odd_scan(mode, sample, bool(signals["hold"][i] > 0), h)
            else:
                self._spell(fast, mode, out[start:end], [s[start:end] for s in inputs])
        return out

    def _spell(self, fast: Runner, mode: Mode, out: Floats, inputs: list[Floats]) -> None:
        """Run a spell in one mode; in automatic, after its first scan, with the program specialised to that."""
        was, before = self.output, list(self._state)
        with self._running.quiet():
            if mode in ("automatic", "cascade"):
                out[0] = self._scan(self._state, *(float(s[0]) for s in inputs))
                if out.size > 1:
                    named = {q.name: s[1:] for q, s in zip(self.program.inputs, inputs, strict=True)}
                    out[1:] = fast.run_automatic(self._state, [named[name] for name in fast.read_in_automatic], out.size - 1)[0]
            else:
                out[:] = fast.run(self._state, inputs, out.size)[0]
        if mode != self._mode:
            self._transfer(self._count, mode, float(out[0]) - was)
        beyond = any(float(np.max(np.abs(s))) > SIGNAL for s in inputs[:2])
        if beyond or self._running.not_finite().keys() != self._lost:
            self._find_lost(before, inputs)
        self._last = tuple(float(s[-1]) for s in inputs)
        self._count += out.size

    def _find_lost(self, before: Sequence[float], inputs: Sequence[Floats]) -> None:
        """Note in which scans of a spell states stopped being finite numbers: do it again, from the states before, scan by scan."""
        state = list(before)
        with self._running.quiet():
            for i, sample in enumerate(zip(*(s.tolist() for s in inputs), strict=True)):
                self._scan(state, *sample)
                self._note_lost(state, self._count + i)
