"""Registers candidates: at once, or in another process, so that no scan waits for it."""
from concurrent.futures import BrokenExecutor
from concurrent.futures import Executor
from concurrent.futures import Future

import numpy as np
from numpy.typing import NDArray

from ...core.compact_scan import compact
from ...core.compact_scan import CompactScan
from ...core.config import prepares_alike
from ...core.config import SgorConfig
from ...core.prepared_scan import PreparedScan
from ...core.registration import register
from ...tracker.deskewing import with_frames
from ..edge import Edge
from ..edge import Kind
from ..keyframe import Keyframes
from .candidates import Candidate
from .candidates import Candidates

Found = tuple[NDArray[np.float64], NDArray[np.float64]] | None
"""T_target_source and its covariance; None where the pair is none."""


def verify(source: PreparedScan, target: PreparedScan, config: SgorConfig) -> Found:
    """Register a pair; something is found only where the clouds leave one answer, and hold it."""
    if source.scale != target.scale or not all(
            prepares_alike(one.config, config) for one in (source, target)):
        return None
    found = register(source, target, config)
    if not found.success or found.T_target_source is None or found.covariance is None:
        return None
    return found.T_target_source, found.covariance


def verify_compact(source: CompactScan, target: CompactScan, config: SgorConfig) -> Found:
    """Do the same where the pair was sent here."""
    return verify(source.restored(), target.restored(), config)


class Verification:
    """Takes candidates, and gives the loops that came of them.

    Parameters
    ----------
    executor : concurrent.futures.Executor, optional
        Where pairs are registered; without it here, at once.

    Attributes
    ----------
    fault : str
        Why the executor is not used any more; empty where it is.
    """

    def __init__(self, executor: Executor | None) -> None:
        self._executor = executor
        self._at_work: list[tuple[Candidate, Future[Found]]] = []
        self.fault = ''

    def __len__(self) -> int:
        """Return how many are being registered elsewhere."""
        return len(self._at_work)

    def work(self, candidates: Candidates, keyframes: Keyframes, config: SgorConfig, count: int,
             *, at_once: bool = False, wait: bool = False) -> list[Edge]:
        """Return the loops of candidates that are done: of `count`, or those done elsewhere.

        Parameters
        ----------
        candidates : Candidates
        keyframes : Keyframes
        config : SgorConfig
        count : int
            How many to register now, or at most elsewhere.
        at_once : bool
            Whether to register `count` here, whatever there is elsewhere.
        wait : bool
            Whether to wait for those elsewhere.
        """
        if self._executor is None or at_once:
            edges = [self.one(candidate, keyframes, config)
                     for candidate in candidates.take(count)]
            return [edge for edge in edges if edge is not None]
        try:
            for candidate in candidates.take(count - len(self._at_work)):
                self._at_work.append((candidate, self._executor.submit(
                    verify_compact, compact(candidate.prepared),
                    keyframes[candidate.target].scan, config.replace(threads=1))))
            done = [one for one in self._at_work if wait or one[1].done()]
            self._at_work = [one for one in self._at_work if one not in done]
            edges = [_edge(candidate, keyframes, future.result()) for candidate, future in done]
            return [edge for edge in edges if edge is not None]
        except BrokenExecutor as error:
            self.fault = f'loops are not closed any more: {error}'
            self._executor, self._at_work = None, []
            return []

    def one(self, candidate: Candidate, keyframes: Keyframes, config: SgorConfig) -> Edge | None:
        """Register a candidate here and now; return the loop that it is, or None."""
        return _edge(candidate, keyframes, verify(
            candidate.prepared, keyframes.restored(candidate.target), config))


def _edge(candidate: Candidate, keyframes: Keyframes, found: Found) -> Edge | None:
    """Return the loop that was found, with what is not known of the frames of both scans."""
    if found is None:
        return None
    T, covariance = found
    return Edge(candidate.target, candidate.source, T, with_frames(
        covariance, T, candidate.prepared.frame_covariance,
        keyframes[candidate.target].frame_covariance), Kind.LOOP)
