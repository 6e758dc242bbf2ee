"""Evidence -> the probability that a motion is right; `datasets_tools/fit_registration_verdict.py` fits the model."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from voxkernel.registration.evidence import Evidence
from voxkernel.registration.result import Verdict

__all__ = ["NAMES", "NO_MATCH", "RIGHT", "SIGNS", "believed", "descriptors", "verdict_of"]

# What the model looks at; a weight keeps the sign that the evidence has by its meaning.
NAMES = (
    "agreement", "systematic", "noise", "turned", "held", "explained_more", "explained_less", "overlap", "shortfall",
    "rival", "growth", "core",
)  # fmt: skip
SIGNS = (1, -1, -1, -1, 1, 1, 1, 1, -1, -1, -1, -1)
_CENTERS = (
    2.9967, -5.9979, -6.0087, -3.4918, -3.0304, -0.1814, -0.3161, -0.3157, -3.1084, 0.6054, -4.7918, -6.5449,
)  # fmt: skip
_SPREADS = (
    1.2576, 1.0904, 0.6480, 0.6672, 0.6822, 0.3031, 0.4650, 0.3137, 1.5492, 0.2684, 1.0785, 0.9489,
)  # fmt: skip
_WEIGHTS = (
    0.0000, -0.2045, -0.3788, 0.0000, 0.8167, 0.2404, 0.2076, 0.2195, 0.0000, -0.3263, -2.0225, -1.9697,
)  # fmt: skip
_BIAS = 0.8155
RIGHT, NO_MATCH = 0.65, 0.2  # probabilities


def descriptors(evidence: Evidence, rival: float, size: float) -> NDArray[np.float64]:
    """Turn evidence, the rank of the runner-up over that of the best, and the scale that fits best into numbers."""
    e = evidence
    return np.array([
        np.log((e.agreement + 0.01) / (1.01 - e.agreement)),
        np.log(e.systematic + 2e-4),
        np.log(e.noise + 2e-4),
        np.log(e.turned + 0.01),
        np.log(e.held + 1e-3),
        np.log(e.explained_more + 0.02),
        np.log(e.explained_less + 0.02),
        np.log(e.overlap + 0.05),
        np.log(min(e.shortfall, 10.0) + 5e-3),
        min(max(rival, 0.0), 1.0),
        np.log(min(abs(np.log(max(size, 1e-9))), 0.3) + 3e-3),
        np.log(e.core + 2e-4),
    ])


def believed(numbers: NDArray[np.float64]) -> float:
    """Give the probability that a motion with these numbers is right."""
    normed = (numbers - np.array(_CENTERS)) / np.array(_SPREADS)
    return float(1.0 / (1.0 + np.exp(-np.clip(normed @ np.array(_WEIGHTS) + _BIAS, -30.0, 30.0))))


def verdict_of(probability: float, *, doubted: bool) -> Verdict:
    """Put a probability into a word; an answer that is one of several is never right without doubt."""
    if probability < NO_MATCH:
        return "no match"
    return "right" if probability >= RIGHT and not doubted else "uncertain"
