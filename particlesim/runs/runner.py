"""Run a scenario: the one file that joins validation, engine and recorder."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from numbers import Integral
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from particlesim.compiler import store
from particlesim.engine.simulation import Simulation
from particlesim.engine.stability.limits import suspects
from particlesim.engine.state.group_state import CAUSES
from particlesim.errors import DivergenceError, InputOutputError, Interrupted, UsageError
from particlesim.preflight.advice import advice, long_sums, replaced
from particlesim.preflight.jumps import jumps
from particlesim.preflight.resources import check_fits, needs
from particlesim.process.signals import held_signals
from particlesim.runs.checks import Checks
from particlesim.runs.first_state import doubtful
from particlesim.runs.frames import frame_of
from particlesim.runs.loop import Course
from particlesim.runs.references import bless as give_blessing
from particlesim.runs.references import check_references
from particlesim.runs.result import Progress, Result, recorded_result
from particlesim.runs.validity import check_ledger, check_stored, exhausted, missed
from particlesim.scenario.load import load
from particlesim.scenario.scenario import Scenario
from particlesim.trajectory.places import check_name_length
from particlesim.trajectory.target import check_target, check_trajectory_name

if TYPE_CHECKING:
    from particlesim.runs.checkpoints import Keeper
    from particlesim.runs.resume import Resumption
    from particlesim.trajectory.writer import TrajectoryWriter

# What has to do with files, h5py above all, is imported by what needs it: a run without an output starts without.

__all__ = ["Progress", "Result", "run"]


def run(
    scenario: Scenario | str | Path,
    output: str | Path | None = None,
    *,
    overwrite: bool = False,
    threads: int | None = None,
    progress: Callable[[Progress], None] | None = None,
    bless: bool = False,
    warn: Callable[[str], None] | None = None,
    resume: bool = False,
    checkpoint_every: float | None = None,
    checkpoint_wall: float | None = None,
    max_wall: float | None = None,
    must_fit: bool = True,
) -> Result:
    """Run a scenario, or the scenario of a file, from its start to its end.

    With `output`, frames go to that trajectory file (.vtkhdf) while the run goes on; without it nothing is written. The
    last frame is in memory either way, as `result.final`. `threads` bounds the threads (all cores unless given);
    results do not depend on it. `progress` is called at every frame, and between frames that take long; `warn` before the
    first step, with what is doubtful, and what is wrong with the step: see `ps.stability`. All of it is among
    `result.warnings`, too. With
    `bless`, checks against references are left out, and when all others hold, the trajectory becomes their reference.

    A run with an output makes checkpoints beside it: every `checkpoint_every` seconds of simulated time, every
    `checkpoint_wall` seconds of wall-clock time (those of the scenario's output unless given; if neither says, after 1, 2,
    4 ... 60 s, at 2 % of its time at most), and when it is stopped by a signal or after `max_wall` seconds. With `resume`, a
    run that was stopped or killed goes on from there, and ends with the bits of one that was not; where nothing has begun it
    begins, and where all is done it does nothing.

    Raises UsageError before anything is computed when the output exists (unless `overwrite`) or is being written, the run
    cannot fit by an upper bound of what it needs (unless `must_fit` is False), or cannot be resumed; DivergenceError when a
    number stops being finite, or did so in the run to be resumed; Interrupted on Ctrl-C and after `max_wall`;
    InputOutputError when writing fails, and before anything is computed where nothing may be written. Frames recorded until
    then are kept.
    """
    if isinstance(scenario, str | PathLike):
        scenario = load(scenario)
    if not isinstance(scenario, Scenario):
        raise TypeError(f"run takes a Scenario or the path of one, not {type(scenario).__name__}")
    path = None if output is None else Path(output)
    _check_arguments(path, overwrite, threads, bless, resume, checkpoint_every, checkpoint_wall, max_wall)
    resume = resume and path is not None and path.exists()
    found: Resumption | None = None
    if path is not None:
        _check_output(path, overwrite=overwrite or resume)
        if resume:
            from particlesim.runs.resume import find

            state = find(scenario, path)
            if state == "complete":
                return recorded_result(scenario, path)
            found = state
    check_references(scenario, path, bless=bless)
    required = needs(scenario, recorded=path is not None)
    if must_fit:
        check_fits(required, path)
    checks = Checks(scenario, bless=bless)
    with held_signals() as signals:  # the loading of compiled code would swallow an exception
        # first of all, as looks at the step take sums of forces, too
        doubts = _told((*long_sums(scenario), *jumps(scenario), *replaced(scenario)), warn)
        simulation = Simulation(scenario, threads=threads)
        check_ledger(simulation)
        if path is not None:
            check_stored(simulation)
        doubts += _told((*suspects(simulation).warnings, *doubtful(simulation)), warn)
        advised = _told(advice(scenario), warn)
        if found is not None and path is not None:
            checks.restore(simulation, found.facts["checks"])
            found.apply(simulation, path)
        simulation.begin()
        signals.check()  # before anything is written
        writer = _writer(simulation, path, overwrite or resume, required.particles, found)
        keeper = None if writer is None else _keeper(writer, scenario, checkpoint_every, checkpoint_wall)
        course = Course(
            simulation, checks, signals, writer=writer, keeper=keeper, progress=progress, max_wall=max_wall
        )
        if found is not None:
            course.resume(found)
        _to_the_end(course)
    result = _result(course, path, _notes(resume, found), advised)
    if bless and path is not None and result.passed:
        give_blessing(scenario, path)
    return replace(result, warnings=(*doubts, *result.warnings))


def _check_arguments(
    path: Path | None,
    overwrite: bool,
    threads: int | None,
    bless: bool,
    resume: bool,
    *seconds: float | None,
) -> None:
    if threads is not None and (isinstance(threads, bool) or not isinstance(threads, Integral)):
        raise TypeError(f"threads is a whole number or None, not {threads!r}")
    if threads is not None and threads < 1:
        raise UsageError(
            f"the number of threads must be 1 or more, got {threads}", "None, the default, takes all cores."
        )
    if any(value is not None and not value > 0 for value in seconds):
        raise UsageError("times between checkpoints and the longest time of a run must be greater than 0 s")
    if not resume:
        return
    if path is None:
        raise UsageError("there is nothing to resume without an output", "Give the trajectory to go on with.")
    if overwrite:
        raise UsageError(
            "--resume continues a run, and --force (overwrite=True) starts it again from the beginning",
            "Choose one of them.",
        )
    if bless:
        raise UsageError("a reference cannot come from a resumed run", "Leave out --resume or --bless.")


def _check_output(path: Path, *, overwrite: bool) -> None:
    """Refuse a trajectory that could not be written, or not with its checkpoints beside it, or that another run writes.

    Raises UsageError, or InputOutputError for a place where nothing may be written.
    """
    from particlesim.trajectory.checkpoint_file import previous_path
    from particlesim.trajectory.writer import refuse_file_in_use

    check_trajectory_name(path)
    check_target(path, overwrite=overwrite)
    check_name_length(previous_path(path), path.parent)
    refuse_file_in_use(path)


def _told(found: tuple[str, ...], warn: Callable[[str], None] | None) -> tuple[str, ...]:
    """The warnings before the first step, for `warn`."""
    if warn is not None:
        for text in found:
            warn(text)
    return found


def _to_the_end(course: Course) -> None:
    """Run, and write what there is however it ends."""
    status: str = "failed"
    summary: dict[str, int | str] = {}
    try:
        course.run()
        status = "complete"
        summary = course.summary() if course.writer is not None else {}
    except DivergenceError as error:
        status = "diverged"
        if times := course.log.times:
            error.after_frame(len(times) - 1, times[-1])
        raise
    except Interrupted:
        status = "interrupted"
        raise
    except KeyboardInterrupt:
        status = "interrupted"
        raise Interrupted(f"stopped {course.where()}") from None
    finally:
        course.simulation.close()
        course.checks.close()
        _close(course, status, summary)


def _close(course: Course, status: str, summary: dict[str, int | str]) -> None:
    """Close the trajectory, and the last checkpoint, which a run that has come to its end needs no more."""
    writer, keeper = course.writer, course.keeper
    if writer is None or keeper is None:
        return
    failure: InputOutputError | None = None
    try:
        keeper.close()
    except InputOutputError as error:
        failure = error
    writer.close(status, summary)
    if status in ("complete", "diverged"):
        with suppress(OSError):
            keeper.discard()
    elif failure is not None and status == "interrupted":
        raise failure


def _writer(
    simulation: Simulation, path: Path | None, overwrite: bool, most: int, found: Resumption | None
) -> TrajectoryWriter | None:
    """Records into a new file, or into the one of the run that goes on."""
    if path is None:
        return None
    from particlesim.runs.provenance import provenance
    from particlesim.trajectory.files import DamagedError
    from particlesim.trajectory.writer import TrajectoryWriter

    scenario = simulation.scenario
    ledger = simulation.ledger_columns() if scenario.output.ledger else ()
    fields, precision, topology = (
        scenario.recorded_fields(),
        scenario.output.precision,
        simulation.topology(),
    )
    if found is not None:
        try:
            return TrajectoryWriter.continuing(
                path, found.frames, fields=fields, ledger=ledger, precision=precision, topology=topology
            )
        except DamagedError as error:  # where the look at it had no reason to look
            from particlesim.runs.resume import ANEW

            raise UsageError(error.message, ANEW) from error
    return TrajectoryWriter(
        path,
        fields=fields,
        groups=[group.name for group in scenario.groups],
        ledger=ledger,
        provenance=provenance(scenario, most),
        precision=precision,
        compression=scenario.output.compression,
        overwrite=overwrite,
        causes=tuple(CAUSES.values()),
        particles_hint=max(most, 1),
        topology=topology,
        box=None if scenario.simulation.box is None else scenario.simulation.box.as_box(),
    )


def _keeper(writer: TrajectoryWriter, scenario: Scenario, every: float | None, wall: float | None) -> Keeper:
    """Makes checkpoints as asked for, else as the scenario's output says."""
    from particlesim.runs.checkpoints import Keeper, Saving

    output = scenario.output
    saving = Saving(
        output.checkpoint_every if every is None else every, output.checkpoint_wall if wall is None else wall
    )
    return Keeper(writer, saving)


def _notes(resume: bool, found: Resumption | None) -> tuple[str, ...]:
    """What to tell of a resumed run."""
    if found is not None:
        return found.notes
    return ("there was no checkpoint to continue from: the run started from the beginning",) if resume else ()


def _result(course: Course, path: Path | None, notes: tuple[str, ...], advised: tuple[str, ...]) -> Result:
    simulation, log = course.simulation, course.log
    problems = [store.problem, None if course.keeper is None else course.keeper.problem]
    return Result(
        scenario=simulation.scenario,
        final=frame_of(simulation, len(log.times) - 1),
        path=path,
        times=np.array(log.times),
        ledger={k: np.array([row[k] for row in log.rows]) for k in (log.rows[0] if log.rows else ())},
        steps=simulation.step,
        particle_steps=simulation.particle_steps,
        born=log.born,
        died=log.died,
        seconds=course.seconds,
        warnings=(
            *notes,
            *advised,
            *course.watch.warnings,
            *simulation.warnings(),
            *missed(simulation),
            *exhausted(simulation),
            *filter(None, problems),
        ),
        broken=simulation.broken(),
        missed_crossings=simulation.missed_crossings(),
        methods=simulation.methods(),
        checks=course.checks.results(),
        known_state=course.state,
        compiling=course.compiling,
    )
