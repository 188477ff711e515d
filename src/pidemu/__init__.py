"""What a PID setting means on whose controller: emulate industrial PID algorithms and convert settings between them.

Names are imported when first used, so that ``import pidemu`` is quick.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pidemu.analysis.robustness import Robustness, robustness
    from pidemu.card.library import cards, load_card
    from pidemu.card.load import Card
    from pidemu.controller.controller import Controller
    from pidemu.controller.signals import Event
    from pidemu.conversion.ambiguity.readings import Reading, readings
    from pidemu.conversion.convert import convert
    from pidemu.conversion.many import ConversionTable, convert_many
    from pidemu.conversion.questions import Answer, Question
    from pidemu.conversion.refused import ConversionRefusedError, QuestionError
    from pidemu.conversion.result import Conversion
    from pidemu.conversion.verify import Verification, verify
    from pidemu.errors import (
        ActionError,
        CardError,
        CertificateError,
        EngineError,
        FitRefusedError,
        FleetError,
        ListError,
        PidemuError,
        ProcessError,
        RecordError,
        ScanError,
        SettingError,
        TuningError,
        UnitError,
    )
    from pidemu.explanation.explain import explain
    from pidemu.explanation.model import Explanation
    from pidemu.exports.code import Code, code
    from pidemu.fleet.fleet import Fleet
    from pidemu.fleet.loops import Loop
    from pidemu.fleet.result import FleetResult
    from pidemu.fleet.table import LoopTable, read_loops
    from pidemu.law.law import Law
    from pidemu.plant.job import retrofit
    from pidemu.process.batch import test_batch
    from pidemu.process.fit.fit import ProcessFit, fit_process
    from pidemu.process.process import Process
    from pidemu.process.reduction import half_rule
    from pidemu.process.relay import RelayTest, relay_test
    from pidemu.records.compare import Comparison, compare
    from pidemu.records.files import Record, read_record
    from pidemu.settings.settings import Settings
    from pidemu.simulation.cascade import CascadeRun, simulate_cascade
    from pidemu.simulation.noise import Noise
    from pidemu.simulation.simulate import Simulation, simulate
    from pidemu.simulation.valve import Valve
    from pidemu.tuning.optimise import OptimalTuning, optimise
    from pidemu.tuning.rules import TuningRule, tuning_rules
    from pidemu.tuning.tune import Tuning, tune
    from pidemu.vector_sets.vector_set import VectorSet
    from pidemu.vector_sets.vectors import vectors

__version__ = "0.1.0"

_HOMES = {
    "Code": "exports.code",
    "code": "exports.code",
    "cards": "card.library",
    "load_card": "card.library",
    "Card": "card.load",
    "Comparison": "records.compare",
    "compare": "records.compare",
    "Conversion": "conversion.result",
    "convert": "conversion.convert",
    "ConversionTable": "conversion.many",
    "convert_many": "conversion.many",
    "Verification": "conversion.verify",
    "verify": "conversion.verify",
    "Answer": "conversion.questions",
    "Question": "conversion.questions",
    "Reading": "conversion.ambiguity.readings",
    "readings": "conversion.ambiguity.readings",
    "Controller": "controller.controller",
    "ActionError": "errors",
    "CardError": "errors",
    "CertificateError": "errors",
    "ConversionRefusedError": "conversion.refused",
    "EngineError": "errors",
    "FitRefusedError": "errors",
    "FleetError": "errors",
    "ListError": "errors",
    "PidemuError": "errors",
    "ProcessError": "errors",
    "QuestionError": "conversion.refused",
    "RecordError": "errors",
    "ScanError": "errors",
    "SettingError": "errors",
    "TuningError": "errors",
    "UnitError": "errors",
    "Event": "controller.signals",
    "Explanation": "explanation.model",
    "explain": "explanation.explain",
    "Fleet": "fleet.fleet",
    "FleetResult": "fleet.result",
    "Loop": "fleet.loops",
    "LoopTable": "fleet.table",
    "read_loops": "fleet.table",
    "Law": "law.law",
    "Process": "process.process",
    "ProcessFit": "process.fit.fit",
    "RelayTest": "process.relay",
    "fit_process": "process.fit.fit",
    "half_rule": "process.reduction",
    "relay_test": "process.relay",
    "retrofit": "plant.job",
    "test_batch": "process.batch",
    "Record": "records.files",
    "read_record": "records.files",
    "Robustness": "analysis.robustness",
    "robustness": "analysis.robustness",
    "Settings": "settings.settings",
    "Noise": "simulation.noise",
    "Valve": "simulation.valve",
    "Simulation": "simulation.simulate",
    "simulate": "simulation.simulate",
    "CascadeRun": "simulation.cascade",
    "simulate_cascade": "simulation.cascade",
    "Tuning": "tuning.tune",
    "OptimalTuning": "tuning.optimise",
    "optimise": "tuning.optimise",
    "tune": "tuning.tune",
    "TuningRule": "tuning.rules",
    "tuning_rules": "tuning.rules",
    "VectorSet": "vector_sets.vector_set",
    "vectors": "vector_sets.vectors",
}

__all__ = [
    "ActionError",
    "Answer",
    "Card",
    "CardError",
    "CascadeRun",
    "CertificateError",
    "Code",
    "Comparison",
    "Controller",
    "Conversion",
    "ConversionRefusedError",
    "ConversionTable",
    "EngineError",
    "Event",
    "Explanation",
    "FitRefusedError",
    "Fleet",
    "FleetError",
    "FleetResult",
    "Law",
    "ListError",
    "Loop",
    "LoopTable",
    "Noise",
    "OptimalTuning",
    "PidemuError",
    "Process",
    "ProcessError",
    "ProcessFit",
    "Question",
    "QuestionError",
    "Reading",
    "Record",
    "RecordError",
    "RelayTest",
    "Robustness",
    "ScanError",
    "SettingError",
    "Settings",
    "Simulation",
    "Tuning",
    "TuningError",
    "TuningRule",
    "UnitError",
    "Valve",
    "VectorSet",
    "Verification",
    "__version__",
    "cards",
    "code",
    "compare",
    "convert",
    "convert_many",
    "explain",
    "fit_process",
    "half_rule",
    "load_card",
    "optimise",
    "read_loops",
    "read_record",
    "readings",
    "relay_test",
    "retrofit",
    "robustness",
    "simulate",
    "simulate_cascade",
    "test_batch",
    "tune",
    "tuning_rules",
    "vectors",
    "verify",
]


def __getattr__(name: str) -> Any:
    if name == "testing":  # a room, not a name in one
        return import_module("pidemu.testing")
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module 'pidemu' has no attribute '{name}'")
    value = getattr(import_module(f"pidemu.{home}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
