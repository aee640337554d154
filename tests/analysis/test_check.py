"""The verdict: limits kept, violated, not in the log; and lists of limits that are wrong."""

from __future__ import annotations

from pathlib import Path

import pytest
from stance.check import DIRECTORY, Limit, judge, limits_file, load_limits, parse_limits, quantity
from stance.errors import StanceError
from stance.log import Log
from stance.metrics import measure
from stance.series import Run
from synthetic import Synthetic, Walk, run_of
from synthetic_arm import SyntheticArm
from synthetic_catcher import SyntheticCatcher

FIGURES = {
    "fell": False,
    "trunk": {"tilt_max_deg": 3.0},
    "qp": None,
    "count": 2,
    "segments": [{}, {"wanted": [-0.5, 0.0], "measured": [-0.48, 0.01]}],
}


def test_a_limit_is_kept_up_to_its_value() -> None:
    limits = [Limit("tilt", "trunk.tilt_max_deg", "max", 3.0), Limit("count", "count", "min", 2)]
    assert judge(FIGURES, limits).passed
    assert not judge(FIGURES, [Limit("tilt", "trunk.tilt_max_deg", "max", 2.9)]).passed
    assert not judge(FIGURES, [Limit("count", "count", "min", 3)]).passed
    assert judge(FIGURES, [Limit("fell", "fell", "equals", False)]).passed


@pytest.mark.parametrize("of", [-0.5, "segments.1.wanted.0"])
def test_a_figure_is_within_a_share_of_a_number_or_of_another_figure(of: float | str) -> None:
    kept = Limit("speed", "segments.1.measured.0", "within", 0.05, "m/s", of=of)
    assert judge(FIGURES, [kept]).passed
    assert not judge(FIGURES, [Limit("speed", "segments.1.measured.0", "within", 0.03, of=of)]).passed
    assert not judge(
        FIGURES, [Limit("aside", "segments.1.measured.1", "within", 0.05, of="segments.1.wanted.1")]
    ).passed
    assert not judge(FIGURES, [Limit("tilt", "trunk.tilt_max_deg", "within", 0.05, of="qp.failures")]).passed
    assert kept.rule == f"within 5 % of {'-0.5 m/s' if of == -0.5 else of}"


def test_what_the_machine_does_not_keep_up_with_is_told_and_fails_nothing() -> None:
    slow = Limit("share of missed ticks", "missed", "max", 0.005, "share", machine=True)
    verdict = judge({"missed": 0.02}, [slow])
    assert verdict.passed
    assert not verdict.violated
    assert [finding.limit for finding in verdict.slow] == [slow]
    assert verdict.as_text().startswith("slow ")
    assert verdict.as_text().endswith("PASS: 0 limits kept; this machine was too slow for 1")
    assert judge({"missed": 0.001}, [slow]).as_text().endswith("PASS: 1 limits kept")


def test_what_the_log_lacks_fails_unless_it_is_optional() -> None:
    assert not judge(FIGURES, [Limit("qp", "qp.failures", "max", 0)]).passed
    verdict = judge(FIGURES, [Limit("qp", "qp.failures", "max", 0, optional=True)])
    assert verdict.passed
    assert verdict.findings[0].measured == "not in the log"
    later = Limit("a stretch that the run did not come to", "segments.2.wanted", "max", 3.0, optional=True)
    assert judge(FIGURES, [later]).findings[0].measured == "not in the log"


def test_a_limit_on_an_unknown_figure_is_an_error() -> None:
    for metric in ("trunk.tilt_max", "segments.-1.wanted", "fell.0", "segments.first"):
        with pytest.raises(StanceError, match=f"limit 'tilt': no figure '{metric}'"):
            judge(FIGURES, [Limit("tilt", metric, "max", 3.0)])
    with pytest.raises(StanceError, match=r"limit 'tilt': segments\.1\.wanted is no number"):
        judge(FIGURES, [Limit("tilt", "segments.1.wanted", "max", 3.0)])


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("{name: a, metric: fell, max: 1, maximum: 2}", "unknown key maximum"),
        ("{name: a, max: 1}", "metric is missing"),
        ("{name: a, metric: fell}", "give one of max, min, equals, within"),
        ("{name: a, metric: fell, within: 0.1}", "within and of go together"),
        ("{name: a, metric: fell, max: 1, of: 2}", "within and of go together"),
        ("{name: a, metric: fell, within: 0.1, of: [1]}", "of is [1], but must be a number"),
        ("{name: a, metric: fell, max: 1, min: 0}", "give one of"),
        ("{name: a, metric: fell, max: high}", "'high', but must be a number"),
        ("just text", "no mapping"),
    ],
)
def test_a_wrong_entry_is_named(entry: str, message: str) -> None:
    with pytest.raises(StanceError, match=r"file: limits\[0\]") as caught:
        parse_limits(f"limits: [{entry}]", "file")
    assert message in str(caught.value)


@pytest.mark.parametrize("text", ["", "limits: 3", "limits: []\nmore: 1", "limits: [", "- a", "limits: []\nlimits: []"])
def test_what_is_no_list_of_limits_is_an_error(text: str) -> None:
    with pytest.raises(StanceError, match="file"):
        parse_limits(text, "file")


@pytest.mark.parametrize("path", sorted(DIRECTORY.glob("*.yaml")), ids=lambda path: path.stem)
def test_every_list_that_comes_with_the_package_names_figures_that_exist(path: Path) -> None:
    of_biped = Synthetic(duration=5.0, walk=Walk(start=1.0, speed=0.4))
    arms: dict[str, Synthetic] = {"arm3": SyntheticArm(), "catcher": SyntheticCatcher()}
    log = Log.from_bytes(arms.get(path.stem.partition("_")[0], of_biped).log())
    findings = judge(measure(log.run(), log.report).as_dict(), load_limits(path)).findings
    # A list may name stretches of its own scenario's script.
    figures = [finding for finding in findings if not finding.limit.metric.startswith("segments.")]
    assert figures and all(finding.value is not None for finding in figures)


def test_standing_keeps_the_limits_and_falling_or_standing_without_states_does_not(stand: Run) -> None:
    limits = load_limits(limits_file("biped", "demo"))
    assert judge(measure(stand).as_dict(), limits).passed
    held = Synthetic().messages()
    held["CONTROLLER_TRACE"]["state_is_new"][100:120], held["TRUTH"]["drives_damped"][100:120] = 0, 1
    verdict = judge(measure(run_of(held)).as_dict(), limits)
    assert [finding.limit.name for finding in verdict.violated] == ["time with the drives damped"]
    assert [finding.limit.name for finding in verdict.slow] == ["ticks without a new state"]
    fallen = Log.from_bytes(Synthetic(fall_at=2.0, qp_failures=(50,)).log())
    violated = judge(measure(fallen.run(), fallen.report).as_dict(), limits).violated
    assert {"fell", "largest trunk tilt", "failed QPs"} <= {finding.limit.name for finding in violated}


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (26.49, "deg", "26.5°"),
        (0.5, "rad", "28.6°"),
        (-0.00612, "rad", "-6.12 mrad"),
        (0.00867, "m", "8.67 mm"),
        (0.812, "m", "0.812 m"),
        (0.005, "share", "0.5 %"),
        (4999.6, "us", "5,000 µs"),
        (0, "", "0"),
        (False, "", "no"),
    ],
)
def test_a_figure_reads_the_same_everywhere(value: float, unit: str, text: str) -> None:
    assert quantity(value, unit) == text


def test_an_unknown_scenario_is_judged_by_the_default_list() -> None:
    assert limits_file("biped", "no-such-scenario").name == "default.yaml"
