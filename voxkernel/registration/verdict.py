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
_CENTERS = (3.7339, -6.5999, -6.3948, -3.7737, -2.9695, -0.1164, -0.4293, -0.2485, -4.0919, 0.4268, -4.8005, -7.2)
_SPREADS = (1.2886, 1.1953, 0.7884, 0.6843, 0.7305, 0.2723, 0.5290, 0.2320, 1.5759, 0.2871, 1.3059, 1.2)
_WEIGHTS = (0.6042, -2.9120, 0.0000, 0.0000, 0.0000, 0.2277, 0.0000, 0.6141, -0.1317, 0.0000, -1.4899, 0.0)
_BIAS = 1.6448
RIGHT, NO_MATCH = 0.6, 0.2  # probabilities


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
