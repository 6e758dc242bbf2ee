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
    2.8756, -5.9521, -5.7653, -3.4288, -3.1864, -0.2563, -0.5154, -0.3454, -3.0183, 0.5073, -4.4664, -6.3261,
)  # fmt: skip
_SPREADS = (
    1.5444, 1.1724, 0.7993, 0.7012, 0.6982, 0.3357, 0.5180, 0.3405, 1.8141, 0.3608, 1.5640, 1.1013,
)  # fmt: skip
_WEIGHTS = (
    0.2026, -1.0134, -0.1056, -0.1306, 0.1864, 0.7381, 0.0862, 0.0000, -0.1353, -0.6399, -2.4674, -2.1919,
)  # fmt: skip
_BIAS = -0.8959
_SIGMAS = 3.0  # standard errors of a scale that count as none
RIGHT, NO_MATCH = 0.68, 0.2  # probabilities


def descriptors(evidence: Evidence, rival: float, size: float, error: float) -> NDArray[np.float64]:
    """Turn evidence, the rank of the runner-up over that of the best, and the scale that fits best into numbers.

    Of the logarithm of the scale only what its standard error does not explain counts.
    """
    e = evidence
    growth = max(abs(np.log(max(size, 1e-9))) - _SIGMAS * error, 0.0)
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
        np.log(min(growth, 0.3) + 3e-3),
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
