"""What a run did: a table for people, an object for programs."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from psim.console import counted, duration, facts, paint, places, rate, say, warn

if TYPE_CHECKING:
    from particlesim.runs.runner import Result
    from particlesim.scenario.scenario import Scenario

DIGITS = 16
"""Digits of a digest that people are shown; two runs agree in them by chance once in 10¹⁹."""

LONG = 0.1
"""Seconds of compiling that are worth a word."""

_CAUSES = {
    "age": "of age",
    "cold": "cold",
    "recycled": "recycled",
    "plane": "at a plane",
    "collider": "at a collider",
    "outside": "outside",
}


def summary(result: Result, scenario: Path, video: Path | None, warnings: list[str]) -> dict[str, Any]:
    """The facts of a run as plain data, in SI units."""
    from particlesim.scenario.digest import physics_digest

    grid = result.scenario.grid
    dead = sum(result.died.values())
    return {
        "scenario": str(scenario),
        "title": result.scenario.title,
        "trajectory": str(result.path),
        "video": None if video is None else str(video),
        "bytes": result.path.stat().st_size if result.path is not None else 0,
        "frames": len(result.times),
        "particles": {
            "placed": len(result.final) + dead - result.born,
            "born": result.born,
            "died": result.died,
            "alive": len(result.final),
        },
        "time": float(result.times[-1]),
        "steps": result.steps,
        "dt": grid.dt,
        "dt_asked": grid.asked,
        "particle_steps": result.particle_steps,
        "seconds": result.seconds,
        "compiling": result.compiling,
        "particle_steps_per_second": _speed(result),
        "energy": _ends(result.energy) if result.ledger else None,
        "work": _work(result),
        "momentum": _momentum(result),
        "methods": result.methods,
        "broken_springs": {name: {"broken": n, "of": all_} for name, (n, all_) in result.broken.items()},
        "missed_crossings": result.missed_crossings,
        "checks": [check.as_data() for check in result.checks],
        "physics": physics_digest(result.scenario),
        "state": result.state,
        "warnings": warnings,
        "warning_places": places(warnings, result.scenario),
        "exit_code": 0 if result.passed else 1,
    }


def _speed(result: Result) -> float | None:
    """Particle-steps per second, without the time of compiling."""
    seconds = result.seconds - result.compiling
    return result.particle_steps / seconds if seconds > 0 else None


def _ends(values: Any) -> dict[str, float]:
    return {"first": float(values[0]), "last": float(values[-1])}


def _work(result: Result) -> dict[str, float] | None:
    """The energy that every cause has given [J], and what is left of the balance."""
    if "balance" not in result.ledger:
        return None
    done = {
        name.removeprefix("work."): float(values[-1])
        for name, values in result.ledger.items()
        if name.startswith("work.")
    }
    return {**done, "balance": float(result.ledger["balance"][-1])}


def _momentum(result: Result) -> dict[str, list[float]] | None:
    if not result.ledger:
        return None
    axes = [result.ledger[f"momentum.{axis}"] for axis in "xyz"]
    return {end: [float(values[k]) for values in axes] for end, k in (("first", 0), ("last", -1))}


def show_summary(told: dict[str, Any], scenario: Scenario) -> None:
    """The table on stderr."""
    from particlesim.preflight.resources import size

    steps = f"{told['time']:.6g} s in {counted(told['steps'], 'step')} of {told['dt']:.6g} s"
    if told["dt_asked"] is not None:
        steps += f" (shortened from {told['dt_asked']:.6g} s, so that frames fall on steps)"
    rows = [
        ("particles", _particles(told["particles"])),
        ("time", steps),
        ("took", _took(told)),
        ("energy", _change(told["energy"])),
        ("work", _work_text(told["work"])),
        ("momentum", _momentum_text(told["momentum"])),
        ("methods", "\n".join(f"{name}: {how}" for name, how in told["methods"].items())),
        ("springs", _broken(told["broken_springs"])),
        ("missed", _missed(told["missed_crossings"])),
        ("checks", "\n".join(check_text(check) for check in told["checks"])),
        ("digest", f"physics {told['physics'][:DIGITS]}, final state {told['state'][:DIGITS]}"),
        ("recorded", f"{counted(told['frames'], 'frame')}, {size(told['bytes'])}"),
    ]
    say(paint(told["title"] or Path(told["scenario"]).stem, "bold"))
    facts(rows, sys.stderr)
    for text in told["warnings"]:
        warn(text, scenario)


def _took(told: dict[str, Any]) -> str:
    """'43.1 s, 40.2 s of them for compiling kernels, 1,200 particle-steps/s'."""
    parts = [duration(told["seconds"])]
    if told["compiling"] >= LONG:
        parts.append(f"{duration(told['compiling'])} of them for compiling kernels, which are kept")
    if told["particle_steps_per_second"]:
        parts.append(rate(told["particle_steps_per_second"]))
    return ", ".join(parts)


def show_failures(result: Result) -> None:
    """The checks that failed, on stderr."""
    for check in result.checks:
        if not check.passed:
            say(f"{paint('check failed', 'red')}: {check.message}")


def check_text(check: dict[str, Any]) -> str:
    """'passed  energy.drift ≤ 0.001: 2.3e-05'."""
    value = "not finite" if check["value"] is None else f"{check['value']:.6g}"
    return f"{'passed' if check['passed'] else 'FAILED'}  {check['name']} {check['bound']}: {value}"


def _particles(count: dict[str, Any]) -> str:
    """'30,000 born, 12,000 alive, 18,000 died (17,000 of age, 1,000 outside)'."""
    parts = [f"{count['placed']:,} placed"] if count["placed"] else []
    parts += [f"{count['born']:,} born"] if count["born"] else []
    parts.append(f"{count['alive']:,} alive")
    if count["died"]:
        causes = ", ".join(
            f"{number:,} {_CAUSES.get(name, name)}" for name, number in sorted(count["died"].items())
        )
        parts.append(f"{sum(count['died'].values()):,} died ({causes})")
    return ", ".join(parts)


def _broken(sets: dict[str, dict[str, int]]) -> str:
    """'links: 12 of 340 broken'."""
    return ", ".join(f"{name}: {n['broken']:,} of {n['of']:,} broken" for name, n in sets.items())


def _missed(number: int) -> str:
    """'5 crossings of colliders or bodies'."""
    return f"{counted(number, 'crossing')} of colliders or bodies" if number else ""


def _change(ends: dict[str, float] | None) -> str:
    """'12.3 J → 12.1 J (−1.6 %)'; a change of more than all of it is no part of it, as where it was near 0."""
    if ends is None:
        return ""
    first, last = ends["first"], ends["last"]
    text = f"{first:.6g} J → {last:.6g} J"
    return f"{text} ({100 * (last - first) / abs(first):+.3g} %)" if abs(last - first) < abs(first) else text


def _work_text(work: dict[str, float] | None) -> str:
    """'air −1.2 J, contact −3.4 J; 1.1e-09 J of the balance are left'."""
    if work is None:
        return ""
    parts = [f"{name} {joule:.6g} J" for name, joule in work.items() if name != "balance"]
    return f"{', '.join(parts) or 'none'}; {work['balance']:.3g} J of the balance are left"


def _momentum_text(ends: dict[str, list[float]] | None) -> str:
    if ends is None:
        return ""
    first, last = (", ".join(f"{value:.4g}" for value in ends[end]) for end in ("first", "last"))
    return f"({first}) → ({last}) kg m/s"
