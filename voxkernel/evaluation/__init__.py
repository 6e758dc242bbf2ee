"""A data set in, a run out: one row per mesh, computed on Dask, columns as `run_table` says."""

from voxkernel.evaluation.evaluate import EvaluationResult, evaluate
from voxkernel.evaluation.progress import EvaluationProgress
from voxkernel.evaluation.settings import PROFILE_TOLERANCES, EvaluateSettings

__all__ = [
    "PROFILE_TOLERANCES",
    "EvaluateSettings",
    "EvaluationProgress",
    "EvaluationResult",
    "evaluate",
]
