"""Which test files are slow; all others are the fast selection, ``pytest -m fast``, which takes less than a minute."""

from __future__ import annotations

from pathlib import Path
from typing import Final

FOLDER: Final = Path(__file__).parent

SLOW: Final = (
    "card/test_broken_folders.py", "card/test_mutations.py", "card/test_source.py", "checks/test_wrong_cards.py",
    "cli/test_cards_show_check.py", "cli/test_convert.py", "cli/test_convert_certificate.py", "cli/test_fit.py",
    "cli/test_fleet.py", "cli/test_loop_commands.py", "process/test_fit_noise.py",
    "cli/test_matrix.py", "cli/test_start.py", "cli/test_streams.py", "cli/test_verify.py", "certificate/test_exact_law.py",
    "certificate/test_figures.py", "certificate/test_nonlinear.py", "certificate/test_proof.py",
    "conversion/test_adversarial.py", "conversion/test_adversarial_settings.py", "conversion/test_all_pairs.py",
    "conversion/test_at_scans.py", "conversion/test_document.py", "conversion/test_exact.py",
    "conversion/test_low_frequency.py", "conversion/test_matches.py", "conversion/test_options.py", "conversion/test_policy.py",
    "conversion/test_policy_figures.py", "conversion/test_policy_properties.py", "conversion/test_policy_questions.py",
    "conversion/test_refusals.py", "conversion/test_rockwell_units.py", "conversion/test_roundtrip.py",
    "conversion/test_solver.py", "conversion/test_spans.py", "conversion/test_symbolic.py", "conversion/test_verify.py",
    "conversion/test_wrong_rules.py",
    "cutover/test_bench_check.py", "cutover/test_every_card.py", "fleet", "simulation/test_closed.py",
    "simulation/test_figures.py", "simulation/test_simulation.py", "matrix", "real/test_advanced_pid.py", "real/test_king.py",
    "real/test_limpid.py", "real/test_listing.py", "real/test_pid2.py", "records", "report",
    "program/test_made_up_scheme.py", "program/test_programs.py",
    "program/test_rules.py", "program/test_windup_schemes.py", "backends", "tools/test_fuzz.py", "tools/test_harness.py",
    "tools/test_matrix_docs.py", "test_any_numbers.py", "test_changes.py", "test_docs.py", "test_docs_certificate.py",
    "test_docs_fleet.py", "test_doctests.py", "controller/test_controller.py", "backends/test_choice.py",
    "controller/test_faults.py", "law/test_law.py", "controller/test_modes.py", "test_packaging.py", "report/test_plots.py",
    "law/test_power_series.py", "settings/test_settings.py", "controller/test_transfers.py", "test_types.py",
    "plant/test_any_cells.py", "plant/test_codes.py", "plant/test_outputs.py", "plant/test_small_list.py", "tuning/test_rules.py",
    "test_worked_examples.py",
)  # fmt: skip
"""Files of more than about three seconds, and folders of which no file is fast."""


def is_slow(file: Path) -> bool:
    """Return whether a test file is one of the slow ones."""
    path = file.relative_to(FOLDER)
    return any(part.as_posix() in SLOW for part in (path, *path.parents))
