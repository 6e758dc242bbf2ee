"""Many registrations in parallel processes, every surface prepared once: `register_many`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, Literal

from voxkernel._checks import as_depth
from voxkernel._frozen import Frozen
from voxkernel.errors import VoxKernelError
from voxkernel.registration.jobs import runner
from voxkernel.registration.register import Registration, as_margins, prepare_surface, register

__all__ = ["PairRegistration", "prepared_or_reason", "register_many", "registered_or_reason"]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PairRegistration(Frozen):
    """One pair of `register_many`.

    Attributes
    ----------
    source, target : int
        Positions in the list of surfaces.
    registration : Registration or None
        None when a surface could not be used.
    reason : str
        Why there is none; "" otherwise.
    """

    source: int
    target: int
    registration: Registration | None
    reason: str

    def __repr__(self) -> str:
        """Name the pair and its answer."""
        answer = repr(self.registration) if self.registration is not None else f"failed: {self.reason}"
        return f"PairRegistration({self.source} -> {self.target}, {answer})"


def register_many(
    surfaces: Sequence[Any],
    *,
    pairs: Literal["reference", "all"] | Sequence[tuple[int, int]] = "reference",
    reference: int = 0,
    workers: int = 1,
    progress: Callable[[int, int], None] | None = None,
    margins: Sequence[float] | None = None,
    refine: Literal["point_to_plane", "point_to_point", "none"] = "point_to_plane",
    max_distance: float | None = None,
    overlap_steps: int = 0,
) -> tuple[PairRegistration, ...]:
    """Register many surfaces, computing the kernels of each once.

    Parameters
    ----------
    surfaces : sequence of mesh, path or (vertices, faces)
        Anything `as_mesh` takes. Paths are read by the processes themselves.
    pairs : {"reference", "all"} or sequence of (source, target)
        Every other surface to the reference, all pairs i < j with j as the target, or the pairs given.
    reference : int
        Position of the reference.
    workers : int
        Processes, 1 to 256; 1 works in this one. The answers do not depend on it.
    progress : callable, optional
        Called with the number of steps done and of all steps: a surface and a pair are one each.
    margins, refine, max_distance, overlap_steps : optional
        As for `register`.

    Returns
    -------
    tuple of PairRegistration
        In the order of the pairs. A surface that cannot be used fails its own pairs only.

    Raises
    ------
    ValueError
        If a position is out of range or an option is.

    Examples
    --------
    >>> from voxkernel.demo_shapes import face
    >>> mesh = face()
    >>> copies = [(mesh.vertices + [0, 0, k], mesh.faces) for k in range(2)]
    >>> (pair,) = register_many(copies)
    >>> pair.source, pair.target, pair.registration.T_target_source[2, 3].round(6).tolist()
    (1, 0, -1.0)
    """
    n_workers = as_depth("workers", workers, 1, 256)
    margins = as_margins(margins)
    wanted = _pairs(len(surfaces), pairs, reference)
    used = sorted({i for pair in wanted for i in pair})
    total = len(used) + len(wanted)

    def tick(done: int) -> None:
        if progress is not None:
            progress(done, total)

    options: dict[str, Any] = {
        "margins": margins, "refine": refine, "max_distance": max_distance, "overlap_steps": overlap_steps
    }  # fmt: skip
    with runner(n_workers, None) as run:
        ready = run([(prepared_or_reason, (surfaces[i], margins)) for i in used], tick, 0)
        known = dict(zip(used, ready, strict=True))
        jobs = [(registered_or_reason, (known[a], known[b], options)) for a, b in wanted]
        answers = run(jobs, tick, len(used))
    return tuple(
        PairRegistration(a, b, *((found, "") if isinstance(found, Registration) else (None, found)))
        for (a, b), found in zip(wanted, answers, strict=True)
    )


def _pairs(count: int, pairs: Any, reference: int) -> list[tuple[int, int]]:
    if pairs == "all":
        return list(combinations(range(count), 2))
    if isinstance(pairs, str) and pairs != "reference":
        raise ValueError(f"`pairs` must be 'reference', 'all' or pairs of positions; got {pairs!r}")
    if pairs == "reference":
        _check("reference", reference, count)
        return [(i, reference) for i in range(count) if i != reference]
    found = [(int(a), int(b)) for a, b in pairs]
    for pair in found:
        for position in pair:
            _check("pairs", position, count)
    return found


def _check(name: str, position: int, count: int) -> None:
    if not 0 <= position < count:
        raise ValueError(f"`{name}` must be positions from 0 to {count - 1}; got {position}")


def prepared_or_reason(surface: Any, margins: Any) -> Any:
    """Prepare one surface, or say why not."""
    try:
        return prepare_surface(surface, margins=margins)
    except (VoxKernelError, OSError, TypeError, MemoryError) as error:
        return str(error) or type(error).__name__


def registered_or_reason(source: Any, target: Any, options: dict[str, Any]) -> Registration | str:
    """Register a pair of what `prepared_or_reason` gave, or say why not."""
    for surface in (source, target):
        if isinstance(surface, str):
            return surface
    return register(source, target, **options)
