import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import chi2

from evaluated_maps.examples import GATE, solved_example
from trigpoint.events.truth import TruthFixes
from trigpoint_evaluation.core.consistency import (
    JudgedFixes,
    cut_off_moments,
    gate_truth,
    judged_fixes,
    nis_summary,
)


def judged(accepted: str, nis: list[float] | None = None) -> JudgedFixes:
    """One fix a second; "+" accepted, "-" rejected."""
    count = len(accepted)
    return JudgedFixes(
        vehicle="car",
        boot_id="b",
        stamp_ns=np.arange(count) * 10**9,
        nis=np.array(nis if nis is not None else [1.0] * count),
        limit=np.full(count, GATE),
        accepted=np.array([one == "+" for one in accepted]),
        reason=("",) * count,
    )


def true_fixes(states: str) -> TruthFixes:
    names = {"c": "clear", "p": "car park", "m": "multipath"}
    return TruthFixes(
        vehicle="car",
        stamp_ns=np.arange(len(states)) * 10**9,
        lat_deg=np.zeros(len(states)),
        lon_deg=np.zeros(len(states)),
        state=tuple(names[one] for one in states),
    )


def test_moments_beyond_a_gate_are_those_of_the_integral() -> None:
    inside = chi2.cdf(GATE, 2)
    mean = quad(lambda x: x * chi2.pdf(x, 2), 0.0, GATE)[0] / inside
    variance = quad(lambda x: (x - mean) ** 2 * chi2.pdf(x, 2), 0.0, GATE)[0] / inside
    assert cut_off_moments(GATE) == pytest.approx((mean, math.sqrt(variance)), abs=1e-6)  # the integral's own error


def test_nis_drawn_from_chi_squared_keeps_its_bounds() -> None:
    nis = np.random.default_rng(3).chisquare(2, 4000)
    found = nis_summary(judged("".join("+" if one <= GATE else "-" for one in nis), nis.tolist()))
    assert found.mean_low < found.mean < found.mean_high
    assert found.share_inside == pytest.approx(0.95, abs=0.01)  # 3 standard deviations of 4000 draws


def test_a_filter_that_claims_half_its_sigma_leaves_the_bounds() -> None:
    nis = 4.0 * np.random.default_rng(3).chisquare(2, 4000)
    found = nis_summary(judged("".join("+" if one <= GATE else "-" for one in nis), nis.tolist()))
    assert found.mean > found.mean_high


def test_accepted_fixes_from_inside_a_car_park_are_counted() -> None:
    found = gate_truth([judged("++-+-")], [true_fixes("ccppp")])
    assert (found.car_park_fixes, found.car_park_accepted) == (3, 1)


def test_good_fixes_rejected_before_the_filter_is_back_are_not_held_against_it() -> None:
    found = gate_truth([judged("+---+-++")], [true_fixes("cppccccc")])
    assert (found.good_rejected, found.good_after, found.good_rejected_after) == (2, 3, 1)
    assert found.good_rejected_share == pytest.approx(1.0 / 3.0)


def test_a_filter_that_never_comes_back_has_no_share_and_all_rejections() -> None:
    found = gate_truth([judged("+----")], [true_fixes("cpccc")])
    assert math.isnan(found.good_rejected_share)
    assert found.good_rejected == 3


def test_verdicts_stand_beside_the_fixes_they_are_about() -> None:
    example = solved_example()
    drive = example.evaluated.drives[1]
    found = judged_fixes(drive, example.evaluated.verdicts)
    assert found.stamp_ns.tolist() == drive.fixes.stamp_ns.tolist()
    assert found.vehicle == "vehicle-2"
