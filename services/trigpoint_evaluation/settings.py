"""What the evaluation service may be told."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class EvaluationSettings:
    """How often the report draws labels to tie, for every number of them, and from which seed."""

    curve_draws: int = 100  # enough for a smooth band
    curve_seed: int = 0
