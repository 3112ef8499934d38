"""The stage-wise kernel of adaptive methods: an island has one step, which the error of its worst particle decides.

The error is a largest value, which does not depend on the order in which particles are looked at, so all threads come to the
same step, however many they are. Inside a grid step there are as many steps as it takes; the last ends exactly at its end.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.compiler import kernel
from particlesim.engine.barrier import meet
from particlesim.engine.coupled.contact import collide
from particlesim.engine.coupled.kernel import displace, end_interval, find_slopes, restore, save
from particlesim.engine.coupled.rebounds import settle_rebounds
from particlesim.engine.interactions.bonds import break_bonds
from particlesim.engine.state.columns import block_of, in_step, span, type_of
from particlesim.engine.step.particle_step import Rate
from particlesim.engine.step.step_size import (
    MOST_STEPS,
    RESOLVED,
    SMALLEST,
    TOO_MANY,
    combined,
    factor,
    scales,
    size2,
    why_short,
)

PAUSED, BEGAN, ENDED, TAKEN, STEP, PREVIOUS, TRIES, PRESENT = 0, 1, 2, 3, 4, 5, 6, 7
"""The state of a paused island: whether it is paused, when its last step began and ended, its length, the next one [s], the
error, and how many tries there have been in the grid step."""


class Pace(NamedTuple):
    """What the threads of an island share: largest value and its row of each, on cache lines of their own.

    `report`: why the island cannot go on, when [s], and the worst particle. `disturbed`: whether contacts or breaking bonds
    may change the state between steps, so that the last slope is not the next step's first. `pauses`: whether to return
    after every own step, before contacts and breaking bonds, for somebody to look; the next call goes on from `present`.
    `events`: when particles are born or die of age [s], sorted: own steps end there, as no error estimate sees a force that
    begins or ends within a step.
    """

    slots: NDArray[np.float64]
    report: NDArray[np.float64]
    disturbed: bool
    pauses: bool
    present: NDArray[np.float64]
    events: NDArray[np.float64]

    @property
    def stuck(self) -> bool:
        """Whether the island could not go on."""
        return bool(self.report[0])


def new_pace(threads: int, events: NDArray[np.float64], *, disturbed: bool, pauses: bool) -> Pace:
    """For some threads."""
    return Pace(np.zeros(8 * threads), np.zeros(3), disturbed, pauses, np.zeros(PRESENT), events)


def next_event(events: Any, now: Any, end: Any) -> Any:
    """The first event after `now`, at most `end`."""
    k = after(events, now)
    return min(end, events[k]) if k < events.size else end


def after(events: Any, now: Any) -> Any:
    """Index of the first event after `now`."""
    low, high = 0, events.size
    while low < high:
        middle = (low + high) // 2
        low, high = (low, middle) if events[middle] > now else (middle + 1, high)
    return low


def worst(share: Any, slots: Any, value: Any, row: Any) -> Any:
    """The largest value of all threads and its row; of equal ones the first."""
    slots[8 * share.number], slots[8 * share.number + 1] = value, row
    meet(share.gate, share.threads)
    best = 0
    for k in range(1, share.threads):
        if slots[8 * k] > slots[8 * best]:
            best = k
    return slots[8 * best], int(slots[8 * best + 1])


def six(columns: Any, i: Any) -> Any:
    """Element i of the six rows of an array."""
    return Rate(columns[0, i], columns[1, i], columns[2, i], columns[3, i], columns[4, i], columns[5, i])


def largest_error(method: Any, c: Any, work: Any, share: Any, t: Any, end: Any, h: Any) -> Any:
    """The largest error of a share's particles in the step from t to `end`, and the row of the particle."""
    largest, row = -1.0, share.first
    for lo in range(share.first, share.last, share.chunk):
        hi = min(lo + share.chunk, share.last)
        q = block_of(c, lo, hi)
        for estimate in range(len(method.errors)):
            for k in range(6):
                estimated(
                    work.spread[estimate, k, : hi - lo], work.slopes[:, k, lo:hi], method.errors[estimate]
                )
        for i in range(hi - lo):
            _, length = span(q.clock, i, t, end, h)
            after = Rate(q.x[i], q.y[i], q.z[i], q.vx[i], q.vy[i], q.vz[i])
            sx, sv = scales(method, six(work.before, lo + i), after)
            first = size2(six(work.spread[0], i), sx, sv)
            if len(method.errors) > 1:
                error = combined(length, first, size2(six(work.spread[1], i), sx, sv))
            else:
                error = combined(length, first, None)
            error = error if error < np.inf else np.inf  # NaN is no error that one may have
            if error > largest:
                largest, row = error, lo + i
    return largest, row


def estimated(target: Any, slopes: Any, weights: Any) -> None:
    """target = Σ weights[j] slopes[j] for one column of a block."""
    for i in range(target.size):
        target[i] = 0
    for j in range(weights.size):
        if weights[j] != 0:
            weight, slope = type_of(target[0], weights[j]), slopes[j]
            for i in range(target.size):
                target[i] += weight * slope[i]


def first_step(method: Any, c: Any, work: Any, share: Any, slots: Any, most: Any) -> float:
    """A first step [s]: a hundredth of the time in which some particle's state changes by its own size."""
    haste = 0.0
    for i in range(share.first, share.last):
        here = Rate(c.x[i], c.y[i], c.z[i], c.vx[i], c.vy[i], c.vz[i])
        sx, sv = scales(method, here, here)
        size, speed = size2(here, sx, sv), size2(six(work.slopes[0], i), sx, sv)
        if speed > 0:
            haste = max(haste, 100 * np.sqrt(speed / size) if size > 0 else 1e3 / most)
    haste, _ = worst(share, slots, haste, 0)
    return float(min(1 / haste, most)) if haste > 0 else float(most)


def attempt(
    method: Any, parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any, end: Any, h: Any
) -> None:
    """Try a step from t to `end`, whose first slopes are known; leaves the slopes at its end in the last stage."""
    for stage in range(1, method.c.size):
        displace(c, work, method.a[stage, :stage], share, t, end, h)
        meet(share.gate, share.threads)
        find_slopes(parts, bonds, c, work, share, stage, t + method.c[stage] * (end - t))


def land(
    parts: Any, bonds: Any, c: Any, work: Any, share: Any, disturbed: Any, t: Any, end: Any, h: Any
) -> None:
    """The end of a step: contacts and breaking bonds; without any, its last slopes are the first of the next."""
    if disturbed:
        collide(parts, c, work.before, share, t, end, h, work.rebounds)
        if work.rebounds is not None:
            settle_rebounds(parts, bonds, c, work, share, t, end, h)
        meet(share.gate, share.threads)
        break_bonds(bonds, c, share, end)
        return
    for k in range(6):
        source = work.slopes[len(work.slopes) - 1, k, share.first : share.last]
        target = work.slopes[0, k, share.first : share.last]
        for i in range(source.size):
            target[i] = source[i]


def pause(
    share: Any, present: Any, t: Any, end: Any, taken: Any, step: Any, previous: Any, tries: Any
) -> None:
    """Store the present time of an island. All threads have read the earlier one, as they have met since."""
    if share.number == 0:
        present[PAUSED], present[BEGAN], present[ENDED], present[TAKEN] = 1, t, end, taken
        present[STEP], present[PREVIOUS], present[TRIES] = step, previous, tries


def give_up(share: Any, pace: Any, why: Any, t: Any, row: Any) -> None:
    """Report why the island cannot go on."""
    if share.number == 0:
        pace.report[0], pace.report[1], pace.report[2] = why, t, row


@kernel
def step_island_adaptive(
    method: Any,
    parts: Any,
    bonds: Any,
    c: Any,
    work: Any,
    share: Any,
    pace: Any,
    first_step_number: Any,
    steps: Any,
    dt: Any,
) -> int:
    """Advance a share of an island by `steps` steps of dt, the first of which begins at first_step_number · dt.

    As many threads as there are shares must call this at the same time. The next step and the last error are those of the
    first particle's memory. Returns the number of grid steps done; fewer when the next one could not be crossed (the
    island is then where its last own step ended, and `pace.report` says why), or when it pauses.
    """
    step, previous = float(c.memory[0][0]), float(c.memory[1][0])
    stale, again = True, False
    for s in range(steps):
        t, end = (first_step_number + s) * dt, (first_step_number + s + 1) * dt
        now, tries = t, 0
        if pace.present[PAUSED] > 0:
            began, now, taken = pace.present[BEGAN], pace.present[ENDED], pace.present[TAKEN]
            step, previous, tries = pace.present[STEP], pace.present[PREVIOUS], int(pace.present[TRIES])
            land(parts, bonds, c, work, share, pace.disturbed, began, now, type_of(c.x[0], taken))
            stale = pace.disturbed
        while now < end:
            goal = next_event(pace.events, now, end)
            if stale:
                find_slopes(parts, bonds, in_step(c, now, goal), work, share, 0, now)
                stale = False
            if not step > 0:
                step = first_step(method, c, work, share, pace.slots, end - t)
            step = min(step, end - t)
            arrives = goal - now <= 1.01 * step
            taken = goal - now if arrives else step
            then = goal if arrives else now + taken
            h = type_of(c.x[0], taken)
            save(block_of(c, share.first, share.last), work.before[:, share.first : share.last])
            attempt(method, parts, bonds, in_step(c, now, then), work, share, now, then, h)
            largest, row = largest_error(method, c, work, share, now, then, h)
            error, row = worst(share, pace.slots, largest, row)
            wish = taken * factor(method, error, previous, again)
            tries += 1
            least = max(method.least, RESOLVED * end)
            if error <= 1:
                whole = taken >= step
                step = wish if whole else max(step, wish)
                previous = max(error, SMALLEST) if whole else previous
                again = False
                if pace.pauses and not (wish < taken and step < least) and tries < MOST_STEPS:
                    pause(share, pace.present, now, then, taken, step, previous, tries)
                    return s
                land(parts, bonds, c, work, share, pace.disturbed, now, then, h)
                stale = pace.disturbed
                now = then
            else:
                step, again = wish, True
                restore(block_of(c, share.first, share.last), work.before[:, share.first : share.last])
            if wish < taken and step < least:
                give_up(share, pace, why_short(six(work.slopes[0], row)), now, row)
                return s
            if tries >= MOST_STEPS:
                give_up(share, pace, TOO_MANY, now, row)
                return s
    for i in range(share.first, share.last):
        c.memory[0][i], c.memory[1][i] = step, previous
    end_interval(parts, bonds, c, work, share, (first_step_number + steps) * dt)
    return steps
