"""What the evaluation service may be told."""

from dataclasses import dataclass

from trigpoint_evaluation.core.landmark_truth import MATCH_LIMIT_M


@dataclass(frozen=True, slots=True, kw_only=True)
class EvaluationSettings:
    """How far from a true landmark an estimated one may be and still be it, and what the report's curve draws."""

    match_limit_m: float = MATCH_LIMIT_M
    curve_draws: int = 200
    curve_seed: int = 0
