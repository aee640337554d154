"""Every plot draws on every kind of log, and the report is one file that needs nothing else."""

from __future__ import annotations

import io
import json
import re
import warnings
from pathlib import Path

import numpy as np
import pytest
import synthetic_arm
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from PIL import Image
from stance import plots, style
from stance.errors import StanceError, UnreadableError
from stance.log import Log
from stance.messages import CONTROLLER_CHANNELS
from stance.metrics import STAGES, measure
from stance.picture import picture, pose_at
from stance.report import MAX_EVENTS, analyse, figures, render, write, write_plots
from stance.series import Run
from stance.timeline import timeline
from synthetic import PERIOD, WALL, Synthetic, Walk, encode_log, records, run_of, ticked
from synthetic_arm import SyntheticArm


def lonely() -> Run:
    """States and nothing else."""
    state = ticked("robot_state_t", 30)
    state["num_joints"], state["num_contacts"], state["sample_period"] = 8, 2, PERIOD / 2
    return run_of({"ROBOT_STATE": state})


def without_truth() -> Run:
    return run_of({name: values for name, values in Synthetic(duration=0.5).messages().items() if name != "TRUTH"})


WALKING = {"walk", "footholds", "swing"}
"""plots that need steps"""
OF_THE_BIPED = set(plots.PLOTS) - synthetic_arm.PLOTS

RENDERED = (
    "stand",
    "fall",
    "one state",
    "diverged",
)  # the others are drawn up to their layout: it is what takes the time


DIVERGING = {"TRUTH", "FORCE_PLAN", "ARM3_MOTION", "CONTROLLER_TRACE"}


def diverged(after: int, walk: Walk | None = None) -> Run:
    """Nothing that is finite from one row on."""
    messages = Synthetic(duration=0.6, pushes=[(0.2, 0.1, (5.0, 0.0, 0.0))], walk=walk).messages()
    for channel in DIVERGING & {*messages}:
        for name in messages[channel].dtype.names or ():
            if messages[channel].dtype[name].base.kind == "f":
                messages[channel][name][after:] = np.nan
    return run_of(messages)


def arm(after: int | None = None) -> Run:
    """A motion of the 3-joint arm; nothing that is finite from row `after` on."""
    made = SyntheticArm(motions=((400, (0.2, 0.1, -0.3)),))
    events = []
    for channel, rows in made.messages().items():
        for name in rows.dtype.names or ():
            if after is not None and channel in DIVERGING and rows.dtype[name].base.kind == "f":
                rows[name][after:] = np.nan
        events += [(WALL + i * round(PERIOD * 1e6), channel, row.tobytes()) for i, row in enumerate(rows)]
    infos = (("RUN_INFO_SIMULATOR", "stance-sim"), ("RUN_INFO_CONTROLLER", "stance-controller"))
    events += [(WALL, channel, made.run_info(program, 0, 1)) for channel, program in infos]
    return Log.from_bytes(encode_log(sorted(events))).run()


KINDS = {
    "stand": lambda: Log.from_bytes(Synthetic(duration=3.0).log()).run(),
    "fall": lambda: Log.from_bytes(Synthetic(duration=3.0, fall_at=1.0, qp_failures=(5, 6), refused=3).log()).run(),
    "late": lambda: Log.from_bytes(Synthetic(duration=1.0, late_ticks={30: 25_000.0}).log()).run(),
    "lockstep": lambda: Log.from_bytes(Synthetic(duration=1.0, realtime=False).log()).run(),
    "states alone": lonely,
    "no truth": without_truth,
    "diverged": lambda: diverged(35),
    "never finite": lambda: diverged(0),
    "walk diverged": lambda: diverged(40, Walk(start=0.0, speed=0.4)),
    "walk never finite": lambda: diverged(0, Walk(start=0.0, speed=0.4)),
    "one state": lambda: run_of({"ROBOT_STATE": ticked("robot_state_t", 1)}),
    "walk": lambda: Log.from_bytes(
        Synthetic(duration=3.0, pushes=[(1.9, 0.1, (5.0, 0.0, 0.0))], walk=Walk(start=0.5, speed=0.4)).log()
    ).run(),
    "one step": lambda: run_of(Synthetic(duration=0.75, pushes=[], walk=Walk(start=0.2, speed=0.0)).messages()),
    "arm": lambda: arm(),
    "arm never finite": lambda: arm(0),
    "arm diverged": lambda: arm(300),
    "arm, a part": lambda: arm().between(1.0, 1.5),
    "a part": lambda: Log.from_bytes(Synthetic(duration=3.0).log()).run().between(1.4, 1.9),
}


@pytest.fixture(scope="module", params=list(KINDS))
def any_run(request: pytest.FixtureRequest) -> tuple[str, Run]:
    return request.param, KINDS[request.param]()


@pytest.mark.parametrize("name", ["summary_card", *plots.PLOTS])
def test_every_plot_that_is_possible_draws_without_a_warning(name: str, any_run: tuple[str, Run]) -> None:
    kind, run = any_run
    if name != "summary_card" and not plots.PLOTS[name].possible(run):
        assert name not in plots.available(run)
        return
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        figure = plots.summary_card(run, measure(run)) if name == "summary_card" else plots.PLOTS[name].draw(run)
        assert isinstance(figure, Figure)
        if kind in RENDERED:
            assert style.render(figure, dpi=30).startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (Synthetic(duration=3.0, pushes=[], walk=Walk(start=0.5, speed=0.4)), "10 steps, 1.0 m in 3.0 s"),
        (Synthetic(duration=1.0, pushes=[]), "stood 1.0 s"),
        (Synthetic(duration=2.0, pushes=[], fall_at=1.0), "fell after 1.40 s"),
    ],
)
def test_the_card_says_what_came_out(made: Synthetic, words: str) -> None:
    run = Log.from_bytes(made.log()).run()
    told = [text.get_text() for ax in plots.summary_card(run, measure(run)).axes for text in ax.texts]
    assert any(words in one for one in told), told


def test_a_plot_is_offered_where_the_log_can_give_it(stand: Run) -> None:
    assert OF_THE_BIPED - set(plots.available(stand)) == WALKING
    assert OF_THE_BIPED - set(plots.available(without_truth())) == {"picture", "estimator", *WALKING}
    rollout = run_of(
        {name: rows for name, rows in Synthetic(duration=0.5).messages().items() if name != "CONTROLLER_TIMING"}
    )
    assert OF_THE_BIPED - set(plots.available(rollout)) == {"timing", *WALKING}
    assert set(plots.available(lonely())) == {"gait", "joints"}


def test_a_planned_force_is_drawn_over_the_period_that_it_is_for_as_the_true_one_is(stand: Run) -> None:
    axes = plots.forces(stand).axes
    planned, true = axes[0].lines[:2]
    assert (planned.get_label(), planned.get_drawstyle()) == ("planned", "steps-post")
    assert (true.get_label(), true.get_drawstyle()) == ("true", "steps-pre")


def test_a_long_way_is_in_metres_and_a_whole_turn_is_one_line() -> None:
    messages = Synthetic(duration=2.0, pushes=[]).messages()
    yaw = np.linspace(0.0, 3.0 * np.pi, 201)
    messages["TRUTH"]["quat_WB"] = np.stack([np.cos(yaw / 2), 0.0 * yaw, 0.0 * yaw, np.sin(yaw / 2)], axis=1)
    messages["TRUTH"]["p_WC"][:, 0] = messages["CONTROLLER_TRACE"]["x"][:, 3] = np.linspace(0.0, 2.5, 201)
    axes = {ax.get_ylabel(): ax for ax in plots.center_of_mass(run_of(messages)).axes}
    assert axes["x [m]"].lines[0].get_ydata()[-1] == pytest.approx(2.5)
    assert "y [mm]" in axes
    assert axes["yaw [°]"].lines[0].get_ydata() == pytest.approx(np.degrees(yaw))


def test_a_calm_run_is_not_magnified() -> None:
    messages = Synthetic(duration=0.5, pushes=[]).messages()
    messages["TRUTH"]["f_F_W"][..., 1] = 1e-8 * np.sin(np.arange(51))[:, None]
    messages["FORCE_PLAN"]["force"][..., 1] = 0.0
    low, high = plots.forces(run_of(messages)).axes[2].get_ylim()  # fy of the left foot
    assert high - low >= 2.0


def test_the_same_run_gives_the_same_picture_byte_for_byte(stand: Run) -> None:
    for kind in ("png", "svg"):
        assert style.render(plots.gait(stand), kind, 40) == style.render(plots.gait(stand), kind, 40)


def test_a_png_of_few_colours_keeps_its_paper_white_and_the_colour_of_a_lone_line(stand: Run) -> None:
    figure = plots.forces(stand)
    figure.axes[0].plot([0.0, 3.0], [0.0, 0.0], color=style.ESTIMATE, lw=2.0)
    with Image.open(io.BytesIO(style.render(figure))) as image:
        assert image.mode == "P"
        pixels = np.asarray(image.convert("RGB")).astype(int)
    assert (pixels[2, 2] == 255).all()
    line = np.array([int(style.ESTIMATE[i : i + 2], 16) for i in (1, 3, 5)])
    assert (pixels == line).all(axis=-1).sum() > 100


def test_plots_leave_matplotlibs_settings_alone(stand: Run) -> None:
    import matplotlib

    before = dict(matplotlib.rcParams)
    style.render(plots.gait(stand), dpi=30)
    assert dict(matplotlib.rcParams) == before


def shaded(run: Run) -> tuple[Axes, np.ndarray]:
    """An axis with nothing but what is shaded, and its figure's pixels."""
    figure = style.new_figure(6.0, 2.0, "")
    ax = figure.subplots()
    style.shade(ax, run, label=True)
    style.time_axis([ax], run)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return ax, np.asarray(canvas.buffer_rgba())[..., :3].astype(int)


def test_one_tick_of_hold_in_20_s_is_seen() -> None:
    _, pixels = shaded(Log.from_bytes(Synthetic(duration=20.0, pushes=[], qp_failures=(500,)).log()).run())
    assert (pixels[..., 0] - pixels[..., 1]).max() > 60  # red


@pytest.mark.parametrize("start", [0.1, 3.0, 3.7])
def test_a_pushs_words_stay_within_the_axes(start: float) -> None:
    ax, _ = shaded(Log.from_bytes(Synthetic(pushes=[(start, 0.1, (0.0, -30.0, 0.0))]).log()).run())
    words, frame = ax.texts[0].get_window_extent(), ax.get_window_extent()
    assert ax.texts[0].get_text().startswith("push 3 N s")
    assert frame.x0 < words.x0 and words.x1 < frame.x1


def test_the_picture_draws_pushes_chosen_instants_and_views(stand: Run) -> None:
    assert len(picture(stand).axes) == 10  # two pushes, five instants each
    assert len(picture(stand, [0.5, 1.0, 2.0], "front").axes) == 3


def test_the_picture_of_a_fall_is_in_order_whole_and_ends_with_it() -> None:
    run = (
        Log.from_bytes(Synthetic(duration=2.0, pushes=[(1.2, 0.1, (15.0, 0.0, 0.0))], fall_at=1.3).log())
        .run()
        .between(None, 1.9)
    )
    figure = picture(run)
    shown = [float(ax.get_title().split()[2]) for ax in figure.axes if ax.get_title()]
    tilts = [float(ax.get_title().split()[-1].rstrip("°")) for ax in figure.axes if ax.get_title()]
    assert shown == sorted(set(shown))
    assert tilts[-1] == max(tilts) > 80.0
    for ax in figure.axes:
        highest = max(patch.get_path().vertices[:, 1].max() for patch in ax.patches if isinstance(patch, Polygon))
        assert highest < ax.get_ylim()[1]


@pytest.mark.parametrize(
    ("instants", "key"), [(None, "pale: before the push"), ([0.5, 1.0], "pale: the first instant"), ([0.5], None)]
)
def test_the_key_says_what_is_pale(stand: Run, instants: list[float] | None, key: str | None) -> None:
    words = " ".join(text.get_text() for ax in picture(stand, instants).axes for text in ax.texts)
    assert (key in words) if key else ("pale" not in words)


def test_a_robot_that_walks_is_in_the_middle_of_each_of_its_drawings() -> None:
    run = Log.from_bytes(Synthetic(duration=4.0, pushes=[], walk=Walk(start=0.5, speed=0.6)).log()).run()
    figure = picture(run)
    for ax, instant in zip(figure.axes, (1.0, 2.0, 3.0), strict=True):
        low, high = ax.get_xlim()
        assert 0.5 * (low + high) == pytest.approx(pose_at(run, instant).T_WB[0, 3], abs=0.15)
    assert "pale" not in " ".join(text.get_text() for ax in figure.axes for text in ax.texts)


def test_a_pose_is_the_logged_instant(stand: Run) -> None:
    pose = pose_at(stand, 1.5049)
    assert pose.time == pytest.approx(1.5)
    assert np.array_equal(pose.T_WB[:3, 3], stand.field("TRUTH", "p_WB")[150])
    assert pose.f_F_W.shape == (2, 3)


def test_a_robot_that_is_not_in_the_log_cannot_be_drawn() -> None:
    with pytest.raises(UnreadableError, match="no TRUTH"):
        picture(without_truth())


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("report")
    path = Synthetic(duration=3.0, fall_at=2.0, late_ticks={30: 25_000.0}).write(directory / "run.lcmlog")
    write(analyse(Log.open(path)), directory)
    return directory


def test_the_report_is_one_file_without_anything_from_outside(written: Path) -> None:
    html = (written / "report.html").read_text()
    sources = re.findall(r'(?:src|href)="([^"]*)"', html)
    assert all(source.startswith(("data:image/png;base64,", "#")) for source in sources)
    assert "http" not in re.sub(r"base64,[A-Za-z0-9+/=]+", "", html).replace("http-equiv", "")
    assert html.count("<figure>") == len(OF_THE_BIPED - WALKING)
    assert "FAIL" in html and "fell after" in html and "woke 25.0 ms late" in html


def rows_of(html: str, title: str) -> dict[str, list[str]]:
    """A table of the report: its first cell → the others."""
    table = html.split(f"<h3>{title}</h3>")[1].split("</table>")[0]
    rows = [re.findall(r"<td[^>]*>(?:<div[^>]*></div>)?([^<]*)</td>", row) for row in table.split("</tr>")]
    return {cells[0]: cells[1:] for cells in rows if cells}


def test_the_report_says_where_a_ticks_time_goes(written: Path) -> None:
    html = (written / "report.html").read_text()
    timing = json.loads((written / "summary.json").read_text())["metrics"]["timing"]
    stages = rows_of(html, "Where a tick&#39;s time goes [µs]")
    assert list(stages) == [*STAGES, "rest"]
    qp = timing["stage_us"]["force_qp"]
    assert stages["force_qp"][:4] == [f"{qp[key]:,.1f}" for key in ("p50", "p99", "p99_9", "max")]
    share = 100 * timing["share"]["force_qp"]
    assert stages["force_qp"][4] == f"{share:.3g} %"
    assert 60.0 < share < 80.0
    assert f'<div style="width: {share:.1f}%"></div>' in html
    cpu = timing["cpu_us"]
    assert rows_of(html, "Time [µs]")["CPU time of the tick"][0] == f"{cpu['p50']:,.1f}"
    assert rows_of(html, "Force QP")["iterations, p50 / p99 / p99.9 / max"] == ["50 / 75 / 75 / 75"]


def test_the_report_tells_how_the_robot_walked_and_what_came_of_each_command(tmp_path: Path) -> None:
    synthetic = Synthetic(duration=4.0, pushes=[], walk=Walk(start=1.0, speed=0.4, recovering=(2,)))
    analysis = analyse(Log.from_bytes(synthetic.log()))
    html = render(analysis, {})
    told = rows_of(html, "Walking")
    assert told["steps"] == ["12, 1 of them getting over a push"]
    assert told["swing time"][0].startswith("0.2 s ± ")
    assert told["foothold reached less planned, forward"] == ["12 mm ± 0 mm (12 mm to 12 mm)"]
    assert told["swing foot from its reference, p50 / p99 / max"] == ["4 mm / 4 mm / 4 mm"]
    commands = rows_of(html, "Walking by command")
    walked = commands["1.00 to 4.00 s, walk"]
    assert walked[0] == "(+0.40, +0.00) m/s, +0.00 rad/s"
    assert walked[1].startswith("(+0.40, ") and walked[3] == "12"
    summary = analysis.summary()["metrics"]
    assert summary["walking"]["steps"] == 12
    assert summary["segments"][1]["wanted_velocity"] == (0.4, 0.0)
    assert "<h3>Walking</h3>" not in render(analyse(Log.from_bytes(Synthetic(duration=0.5).log())), {})


def test_the_estimators_figures_are_held_against_what_is_asked_where_the_sensors_had_noise() -> None:
    noisy = "sensors: {noise: {gyro_white: 0.003}}\n"
    analysis = analyse(Log.from_bytes(Synthetic(duration=1.0, pushes=[], scenario=noisy).log()))
    told = rows_of(render(analysis, {}), "Estimator on noisy sensors, rms")
    assert told["✓ roll"] == ["0 mrad", "≤ 6 mrad"]
    measured = analysis.metrics.estimator
    assert measured is not None and measured.nees is not None and measured.nees > 0.4
    assert told["✓ NEES at least"] == [f"{measured.nees:.3g}", "≥ 0.4"]
    assert told["· velocity while walking"][0] == "not in the log"
    asked = analysis.summary()["estimator_asked"]
    assert asked is not None and asked["limits"] == "estimator.yaml" and asked["passed"]
    assert analysis.verdict.source == "biped_demo.yaml"
    calm = analyse(Log.from_bytes(Synthetic(duration=0.5, scenario="sensors: {noise: none}\n").log()))
    assert calm.summary()["estimator_asked"] is None


def test_the_summary_is_versioned_and_holds_figures_verdict_and_events(written: Path) -> None:
    summary = json.loads((written / "summary.json").read_text())
    assert (summary["schema"], summary["version"]) == ("stance.summary", 1)
    assert summary["metrics"]["fell"] is True
    assert summary["verdict"]["passed"] is False
    assert summary["programs"]["simulator"]["seed"] == 1
    assert "urdf" not in summary["programs"]["controller"]
    times = [event["at"] for event in summary["events"]]
    assert times == sorted(times)
    assert {"push", "fall", "fault", "safety", "missed", "run", "command"} <= {e["kind"] for e in summary["events"]}


def test_a_run_ends_with_the_tick_of_its_last_state_and_the_truth_after_it() -> None:
    messages = Synthetic(duration=0.5).messages()
    events = [(int(row["seq"]), channel, row.tobytes()) for channel, rows in messages.items() for row in rows]
    for channel in {*CONTROLLER_CHANNELS} & {*messages} | {"TRUTH"}:
        last = messages[channel][-1:]
        last["seq"] += 1
        last["utime"] += round(PERIOD * 1e6)
        if channel == "CONTROLLER_TRACE":  # it waits in vain for one more state
            last["state_is_new"], last["faults"], last["fault_count"][:, 0] = 0, 1, 1
        elif channel == "TRUTH":
            last["fallen"] = 1
        events.append((int(last["seq"][0]), channel, last[0].tobytes()))
    analysis = analyse(Log.from_bytes(encode_log(sorted(events))))
    assert analysis.metrics.ticks is not None
    assert (analysis.metrics.ticks.count, analysis.metrics.ticks.without_new_state) == (51, 0)
    assert analysis.metrics.faults["state_stale"] == 0
    assert analysis.metrics.fell_at == pytest.approx(0.51)


def test_every_plot_lies_beside_the_report(written: Path) -> None:
    assert {path.stem for path in (written / "plots").iterdir()} == {
        "summary_card",
        *(OF_THE_BIPED - WALKING),
    }


def test_what_a_log_says_is_escaped(stand: Run) -> None:
    analysis = analyse(Log.from_bytes(Synthetic(duration=0.2).log()))
    assert analysis.run.simulator is not None
    object.__setattr__(analysis.run.simulator, "options", "<script>alert(1)</script>")
    html = render(analysis, {})
    assert "<script>" not in html
    assert "&lt;script&gt;" in html


def test_a_flood_of_events_does_not_swell_the_report() -> None:
    synthetic = Synthetic(duration=1.0)
    analysis = analyse(Log.from_bytes(synthetic.log()))
    flooded = analysis.events * (MAX_EVENTS // len(analysis.events) + 2)
    object.__setattr__(analysis, "events", flooded)
    assert f"and {len(flooded) - MAX_EVENTS} more, in summary.json" in render(analysis, {})


def test_an_unknown_plot_is_an_error_that_names_the_known(stand: Run, tmp_path: Path) -> None:
    analysis = analyse(Log.from_bytes(Synthetic(duration=0.2).log()))
    with pytest.raises(StanceError, match="force_qp"):
        write_plots(analysis, tmp_path, ["forses"])
    assert "picture" in figures(analysis)


def test_the_timeline_counts_the_ticks_of_a_fault() -> None:
    run = Log.from_bytes(Synthetic(duration=1.0, pushes=[], qp_failures=(20, 50, 51, 52)).log()).run()
    texts = [event.text for event in timeline(run) if event.kind == "fault"]
    assert texts == ["qp failed, once", "qp failed, for 0.02 s (3 ticks)"]


def test_the_timeline_tells_gaps_restarts_stops_and_commands_that_change() -> None:
    events = Synthetic(duration=2.0, pushes=[]).events()
    states = [i for i, event in enumerate(events) if event[1] == "ROBOT_STATE"]
    kept = [event for i, event in enumerate(events) if i not in (states[50], states[51])]
    stop = records("stop_t", 1)
    command = records("user_command_t", 2)
    command["behaviour"], command["velocity"] = 1, [0.5, 0.0]
    kept += [(WALL + 1_200_000, "STOP", stop[0].tobytes())]
    kept += [(WALL + 1_000_000 + i, "USER_COMMAND", command[i].tobytes()) for i in range(2)]
    found = timeline(Log.from_bytes(encode_log(sorted(kept))).run())
    texts = [(round(event.at, 2), event.kind, event.text) for event in found]
    assert (0.49, "gap", "ROBOT_STATE: 2 messages missing") in texts
    assert (1.2, "stop", "the operator's stop") in texts
    commands = [text for _, kind, text in texts if kind == "command"]
    assert len(commands) == 2  # stand, walk; the repetition is not told
    assert commands[1].startswith("walk, velocity (+0.50, +0.00) m/s")
