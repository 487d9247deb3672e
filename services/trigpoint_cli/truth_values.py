"""An evaluation against truth as JSON and as lines."""

from trigpoint_cli.output import JsonObject, metres
from trigpoint_evaluation.app import TruthEvaluation
from trigpoint_evaluation.core.consistency import GateTruth
from trigpoint_evaluation.core.path_truth import PathTruthEvaluation


def path_values(one: PathTruthEvaluation) -> JsonObject:
    """One vehicle's errors, or those of all."""
    return {
        "error_m": one.error_m,
        "heading_rmse_rad": one.heading_rmse_rad,
        "error_at_fixes_m": one.error_at_fixes_m,
        "raw_fix_error_m": one.raw_fix_error_m,
        "ratio_at_fixes": one.ratio_at_fixes,
    }


def truth_values(found: TruthEvaluation) -> JsonObject:
    """The evaluation; `error_m` is the landmarks', or the paths' where truth knows no landmark of the map."""
    landmarks, matches = found.landmarks, found.landmarks.matches
    measured = landmarks.error_m if landmarks.error_m.count else found.paths.error_m
    joint = landmarks.joint_nees_per_dof
    return {
        "error_m": measured,
        "error_without_shift_m": landmarks.error_without_shift_m,
        "shift_m": {"east": landmarks.shift_m[0], "north": landmarks.shift_m[1]},
        "nees_per_dof": joint if joint == joint else landmarks.nees_per_dof,
        "nees_is_joint": joint == joint,
        "nees_per_dof_each": landmarks.nees_per_dof,
        "coverage_95": landmarks.coverage_95,
        "landmarks": {
            "count": len(matches.estimated) + matches.duplicates + matches.unmatched,
            "matched": len(matches.estimated),
            "duplicates": matches.duplicates,
            "unmatched": matches.unmatched,
            "missed": matches.missed,
            "match_limit_m": matches.limit_m,
        },
        "trajectory": path_values(found.paths),
        "vehicles": {one.vehicle: path_values(one) for one in found.vehicles},
        "gate": _gate_values(found.gate),
    }


def _gate_values(gate: GateTruth) -> JsonObject:
    return {
        "car_park_fixes": gate.car_park_fixes,
        "car_park_accepted": gate.car_park_accepted,
        "good_fixes": gate.good_fixes,
        "good_rejected": gate.good_rejected,
        "good_after_reacquisition": gate.good_after,
        "good_rejected_after_reacquisition": gate.good_rejected_after,
        "good_rejected_share": gate.good_rejected_share,
    }


def truth_lines(found: TruthEvaluation) -> tuple[str, ...]:
    """The evaluation for a person."""
    landmarks, matches = found.landmarks, found.landmarks.matches
    lines = []
    if landmarks.error_m.count:
        lines.append(
            f"landmarks: {len(matches.estimated)} matched within {matches.limit_m:g} m, {matches.duplicates} doubled, "
            f"{matches.unmatched} unmatched; error mean {metres(landmarks.error_m.mean)}, "
            f"without common shift {metres(landmarks.error_without_shift_m.mean)}, "
            f"{landmarks.coverage_95:.0%} inside their 95 % ellipses"
        )
    for one in found.vehicles:
        at_fixes = f"; at fixes {metres(one.error_at_fixes_m.mean)} mean, raw GNSS {metres(one.raw_fix_error_m.mean)}"
        lines.append(
            f"{one.vehicle}: path error RMSE {metres(one.error_m.rmse)}, max {metres(one.error_m.max)}"
            + (at_fixes if one.raw_fix_error_m.count else "")
        )
    if found.gate.good_fixes:
        lines.append(
            f"gate: {found.gate.car_park_accepted} of {found.gate.car_park_fixes} car-park fixes accepted, "
            f"{found.gate.good_rejected_share:.1%} of good ones rejected after re-acquisition"
        )
    return tuple(lines)
