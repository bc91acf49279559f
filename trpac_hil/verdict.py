"""What a run was like, in sentences."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

CAUSES = {
    "own_work": "the loop's own work took so long",
    "other_work": "the processor was given to other programs",
    "waiting": "the loop was blocked, as by a thread of its own process",
    "machine": "the whole machine was paused (host of a virtual machine, firmware)",
    "untold": "the cause is not known on this system",
}
"""What the causes of `trpac_hil.delays` mean."""


def verdict(summary: Mapping[str, Any]) -> list[str]:
    """Sentences on the end, the deadlines, the estimate, the inputs, the bus and the files of a run."""
    return [
        f"Ended: {summary['ended']}.",
        _deadlines(summary),
        _estimate(summary),
        _inputs(summary),
        _bus(summary["bus"]),
        _file("Log", summary["log"], "rows"),
        *(
            [_file("Recording of the bus", summary["bus_recording"], "messages")]
            if "bus_recording" in summary
            else []
        ),
    ]


def _deadlines(summary: Mapping[str, Any]) -> str:
    overruns = summary["overruns"]
    slots, missed, late = summary["cycles"] + overruns["left_out"], overruns["count"], overruns["beyond_5_ms"]
    if not slots:
        return "Deadlines: none, no cycle ran."
    if not missed:
        return f"Deadlines kept: yes, all {slots:,}."
    text = f"Deadlines kept: no. {missed:,} of {slots:,} cycles were late, the worst by {overruns['worst_ms']:.2f} ms"
    if not late:
        return f"{text}; none by more than 5 ms."
    cause, number = max(overruns["beyond_5_ms_by"].items(), key=lambda each: each[1])
    share = (
        ""
        if number == late
        else f"{'most' if 2 * number > late else 'the largest part'} ({number:,}) of them "
    )
    return f"{text}; {late:,} by more than 5 ms, {share}because {CAUSES[cause]}."


def _estimate(summary: Mapping[str, Any]) -> str:
    cycles, held, starting = summary["cycles"], summary["held_cycles"], summary["starting_cycles"]
    if not cycles:
        return "Estimate: none, no cycle ran."
    text = f"Estimate: live in {100.0 * (cycles - held - starting) / cycles:.4g} % of the cycles"
    parts = [f"waiting for the first signals in {starting:,}"] * (starting > 0)
    parts += [f"held in {held:,}"] * (held > 0)
    return f"{text}{', ' if parts else ''}{' and '.join(parts)}."


def _inputs(summary: Mapping[str, Any]) -> str:
    found = [f"{name} lost {_times(count)}" for name, count in summary["signals_lost"].items()]
    for name, counts in summary["bus"]["messages"].items():
        if name in summary["bus"]["required"] and not counts["received"]:
            found.append(f"{name} never came")
        words = {
            "lost": "missing by its counter",
            "frozen": "with a counter that stood still",
            "broken": "of a wrong length",
        }
        found += [f"{counts[kind]:,} of {name} {text}" for kind, text in words.items() if counts[kind]]
        found += [f"{name} sent by two devices {_times(counts['two_senders'])}"] * (counts["two_senders"] > 0)
        found += [f"{name}.{signal} out of range {_times(n)}" for signal, n in counts["out_of_range"].items()]
    return f"Inputs: {'; '.join(found) or 'all came, none was lost'}."


def _bus(bus: Mapping[str, Any]) -> str:
    words = {
        "losses": "times lost",
        "unsent": "messages could not be sent",
        "error_frames": "error frames",
        "garbled": "packets that were no CAN messages",
    }
    found = [f"{bus[kind]:,} {text}" for kind, text in words.items() if bus[kind]]
    return f"Bus: {', '.join(found) or 'never lost'}."


def _file(what: str, outcome: Mapping[str, Any], rows: str) -> str:
    if outcome["problem"]:
        return f"{what}: none, {outcome['problem']}"
    if outcome["rows_lost"]:
        total = outcome["rows"] + outcome["rows_lost"]
        return f"{what}: not complete, {outcome['rows_lost']:,} {rows} of {total:,} lost."
    return f"{what}: complete, {outcome['rows']:,} {rows}." if outcome["file"] else f"{what}: none."


def _times(number: int) -> str:
    return "once" if number == 1 else f"{number:,} times"
