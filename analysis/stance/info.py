"""What a log holds, as a table: `stance info`."""

from __future__ import annotations

from typing import Any

from .log import ChannelReport, Log

SCHEMA = {"schema": "stance.info", "version": 1}


def describe(log: Log) -> dict[str, Any]:
    """Channels, runs and problems of a log, as plain data for JSON."""
    report = log.report
    return {
        **SCHEMA,
        "path": report.path,
        "bytes": report.size,
        "events": report.events,
        "complete": not report.problems(),
        "runs": [_run(log, run_id) for run_id in report.run_ids],
        "channels": [_channel(channel) for channel in report.channels],
        "skipped": [{"offset": part.offset, "bytes": part.length, "reason": part.reason} for part in report.skipped],
        "problems": report.problems(),
    }


def _channel(channel: ChannelReport) -> dict[str, Any]:
    return {
        "name": channel.name,
        "type": channel.type_name or None,
        "count": channel.count,
        "bytes": channel.bytes,
        "rate_hz": channel.rate,
        "missing": channel.missing,
        "gaps": len(channel.gaps),
        "duplicates": channel.duplicates,
        "conflicting": channel.conflicting,
        "out_of_order": channel.out_of_order,
        "restarts": channel.restarts,
        "wrong_type": channel.wrong_type,
        "wrong_size": channel.wrong_size,
    }


def _run(log: Log, run_id: int) -> dict[str, Any]:
    run = log.run(run_id)
    described: dict[str, Any] = {"run_id": run_id, "states": run.count("ROBOT_STATE"), "duration_s": run.duration}
    for name, info in (("simulator", run.simulator), ("controller", run.controller)):
        if info is not None:
            described[name] = {
                "program": info.program,
                "version": info.version,
                "source": info.source,
                "build": info.build,
                "robot": info.robot,
                "options": info.options,
                "seed": info.seed,
                "input_hash": info.input_hash,
            }
    return described


def describe_as_text(log: Log) -> str:
    """The same for people."""
    found = describe(log)
    lines = [f"{found['path']}: {found['bytes'] / 1e6:.1f} MB, {found['events']} events"]
    for run in found["runs"]:
        lines.append(f"run {run['run_id']}: {run['duration_s']:.2f} s, {run['states']} states")
        for name in ("simulator", "controller"):
            if name in run:
                info = run[name]
                lines.append(
                    f"  {info['program']} {info['version']} ({info['source']}, {info['build']}) "
                    f"{info['options']}  seed {info['seed']}, input {info['input_hash']}"
                )
    lines.append("")
    layout = "{:<22}{:<22}{:>9}{:>10}{:>9}{:>9}{:>7}{:>6}"
    lines.append(layout.format("channel", "type", "count", "rate Hz", "MB", "missing", "twice", "late"))
    for channel in found["channels"]:
        rate, size = f"{channel['rate_hz']:.1f}", f"{channel['bytes'] / 1e6:.2f}"
        counts = (channel["missing"], channel["duplicates"], channel["out_of_order"])
        lines.append(
            layout.format(channel["name"], channel["type"] or "unknown", channel["count"], rate, size, *counts)
        )
    lines.append("")
    lines.extend(found["problems"] or ["nothing was skipped, nothing is missing"])
    return "\n".join(lines)
