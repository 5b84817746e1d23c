"""What `refgi explain --measure` says: the time each skip saves, the proof, and what could be left out beside."""

import statistics
import time
from typing import TYPE_CHECKING, Any

from refgi.cli.session import Tell, table

if TYPE_CHECKING:
    from refgi.bench.skips import SkipReport
    from refgi.scene import Scene

CLOCKS = {"wall": time.perf_counter, "processor": time.process_time}


def measured(
    scene: "Scene", method: str, settings: Any, options: dict[str, Any], rounds: int, clock: str, tell: Tell
) -> "SkipReport":
    """Measure the skips of a method on a scene, at its own size; as `refgi.bench.skips.measure_skips`."""
    from refgi.bench.skips import measure_skips

    return measure_skips(scene, method, settings, rounds=rounds, clock=CLOCKS[clock], tell=tell, **options)


def measured_text(report: "SkipReport | None") -> str:
    """Return the tables of a report after an empty line: skips, trades and what has no switch; nothing without one."""
    if report is None:
        return ""
    head = f"What {report.scene} does not need at {report.width} x {report.height}"
    if report.times:
        head += f": a frame takes {_ms(statistics.median(report.times))} ms, median of {len(report.times)}"
    parts = [f"{head}\n\n{_skips(report)}", _lights(report), _trades(report), _unmeasured(report)]
    return "".join(f"\n\n{part}" for part in parts if part)


def _skips(report: "SkipReport") -> str:
    if not report.skips:
        return "No skip has anything to leave out here."
    rows = [("skip", "leaves out", "", "ms with", "without", "saves", "least", "most", "same bits", "")]
    for skip in report.skips:
        rows.append((skip.name, f"{skip.left_out:,} of {skip.of:,}", skip.unit, _ms(statistics.median(skip.times)),
                     _ms(statistics.median(skip.times_without)), _ms(skip.saves), _ms(min(skip.saved)),
                     _ms(max(skip.saved)), "yes" if skip.same_bits else "NO", skip.meaning))
    wrong = [f"{skip.name} changes bits of the picture: it leaves out more than {skip.meaning}"
             for skip in report.skips if not skip.same_bits]
    return "\n".join([table(rows, right=frozenset({1, 3, 4, 5, 6, 7})), *wrong])


def _lights(report: "SkipReport") -> str:
    lights = report.dim_lights
    if lights is None:
        return ""
    return (f"{lights.carrying:,} of {lights.lights:,} pixel lights carry {lights.share:.1%} of the light without "
            f"visibility. The sum over all takes {_ms(statistics.median(lights.times))} ms,\nover those alone "
            f"{_ms(statistics.median(lights.times_carrying))} ms, with an error of {lights.error:.2%} of the mean.")


def _trades(report: "SkipReport") -> str:
    if not report.trades:
        return ""
    rows = [("At the cost of a difference", "ms now", "then", "RMSE", "type")]
    rows += [(trade.meaning, _ms(statistics.median(trade.times)), _ms(statistics.median(trade.times_changed)),
              "-" if trade.difference is None else f"{trade.difference:.2%}",
              " ".join(f"--set {change}" for change in trade.changes)) for trade in report.trades]
    return table(rows, right=frozenset({1, 2, 3}))


def _unmeasured(report: "SkipReport") -> str:
    if not report.unmeasured:
        return ""
    rows = [("Skipped without a switch, so not measured", "why"), *((one.meaning, one.reason) for one in
                                                                    report.unmeasured)]
    return table(rows)


def _ms(seconds: float) -> str:
    return f"{1e3 * seconds:.3g}" if abs(seconds) < 1 else f"{1e3 * seconds:.0f}"
