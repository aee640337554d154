"""The catcher's plots: its filter against the ball's truth, and each catch: ways of ball and cup, errors, reserves."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.stats import chi2

from . import catcher, configuration, style
from .series import Run
from .style import new_figure, shade, styled, time_axis

WIDTH = 11.0  # inch
AXES = "xyz"
SIDE = 0.3  # s around a catch whose way is drawn


@styled
def ball(run: Run) -> Figure:
    """The estimated ball less the true one with its stated 3 sigma, and the observations' NIS with its chi^2 band."""
    fig = new_figure(WIDTH, 8.2, "The ball's filter", configuration.title(run))
    axes = list(fig.subplots(4, 1, sharex=True))
    time, flying = run.time(catcher.ESTIMATE), catcher.in_flight(run)
    error = np.where(flying[:, None], 1000.0 * catcher.ball_error(run), np.nan)
    variance = np.diagonal(run.field(catcher.ESTIMATE, "covariance"), axis1=1, axis2=2)[:, :3]
    bound = np.where(flying[:, None], 3000.0 * np.sqrt(np.maximum(variance, 0.0)), np.nan)
    for axis, ax in enumerate(axes[:3]):
        ax.fill_between(time, -bound[:, axis], bound[:, axis], color=style.PLANNED, alpha=0.45, lw=0, label="±3 sigma")
        ax.plot(time, error[:, axis], ".-", color=style.ESTIMATE, lw=0.9, ms=2.5, label="estimated less true")
        ax.axhline(0.0, color=style.REFERENCE, lw=0.7)
        limit = 1.3 * float(np.nanpercentile(bound[:, axis], 90)) if flying.any() else 1.0
        ax.set_ylim(-limit, limit)
        ax.set_ylabel(f"{AXES[axis]} [mm]")
    axes[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)
    low, high = chi2.ppf([0.025, 0.975], catcher.FREEDOM) / catcher.FREEDOM
    axes[3].axhspan(low, high, color=style.PLANNED, alpha=0.45, lw=0, label="95% of χ²")
    nis = run.field(catcher.ESTIMATE, "nis")
    axes[3].plot(time, np.where(flying, nis, np.nan), ".", color=style.TRUTH, ms=3.0)
    axes[3].axhline(1.0, color=style.REFERENCE, lw=0.7)
    axes[3].set_yscale("log")
    axes[3].set_ylim(0.01, 100.0)
    axes[3].set_title("NIS per degree of freedom")
    axes[3].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0))
    shade(axes, run)
    time_axis(axes, run)
    return fig


@styled
def catches(run: Run) -> Figure:
    """Each catch from the side of the ball's way, and over time: the cup from its reference, reserves of the arm."""
    throws = catcher.throws(run)
    columns = max(len(throws), 1)
    fig = new_figure(WIDTH, 9.6, "Catches", configuration.title(run))
    grid = fig.add_gridspec(4, columns, height_ratios=[2.1, 1.0, 1.0, 1.0])
    time, number = run.time(catcher.TRUTH), run.field(catcher.TRUTH, "throw_number")
    there = run.field(catcher.TRUTH, "present") != 0
    ball, cup = run.field(catcher.TRUTH, "p_WBall"), run.field(catcher.TRUTH, "p_WCup")
    axis = run.field(catcher.TRUTH, "axis_WCup")
    for column, one in enumerate(throws):
        ax = fig.add_subplot(grid[0, column])
        rows = np.flatnonzero((number == one.number) & there)
        if not len(rows):
            continue
        meeting = rows[int(np.argmin(np.linalg.norm(ball[rows] - cup[rows], axis=1)))]
        near = rows[np.abs(time[rows] - time[meeting]) < SIDE]
        ax.plot(np.hypot(*ball[near, :2].T), ball[near, 2], ".", color=style.ESTIMATE, ms=3.0, label="ball")
        ax.plot(np.hypot(*cup[near, :2].T), cup[near, 2], color=style.TRUTH, lw=1.2, label="cup")
        outward = axis[meeting]
        radial = float(outward[:2] @ cup[meeting, :2] / max(float(np.hypot(*cup[meeting, :2])), 1e-9))
        ax.annotate(
            "",
            xytext=(float(np.hypot(*cup[meeting, :2])), cup[meeting, 2]),
            xy=(float(np.hypot(*cup[meeting, :2])) + 0.2 * radial, cup[meeting, 2] + 0.2 * outward[2]),
            arrowprops={"arrowstyle": "-|>", "color": style.REFERENCE},
        )
        ax.set_aspect("equal", adjustable="datalim")
        offset = "" if one.crossing_offset is None else f", {1000.0 * one.crossing_offset:.0f} mm"
        ax.set_title(f"{one.number}: {one.verdict}{offset}", color=style.GOOD if one.verdict == "caught" else style.BAD)
        ax.set_xlabel("from the arm's axis [m]")
        if column == 0:
            ax.set_ylabel("z [m]")
            ax.legend(loc="upper right", fontsize=7.0)
    error, worth, reserve = (fig.add_subplot(grid[row, :]) for row in (1, 2, 3))
    _over_time(run, error, worth, reserve)
    shade([error, worth, reserve], run)
    time_axis([error, worth, reserve], run)
    return fig


def _over_time(run: Run, error: Axes, worth: Axes, reserve: Axes) -> None:
    time = run.time(catcher.PLAN)
    joints = catcher.body_of(run).moving
    q = run.field(catcher.PLAN, "q_ref")[:, : len(joints)]
    error.plot(time, 1000.0 * catcher.cup_error(run), color=style.TRUTH, lw=1.0)
    error.set_title("Cup, true place from its reference")
    error.set_ylabel("[mm]")
    error.set_ylim(bottom=0.0)
    worth.plot(time, 1000.0 * catcher.manipulability(run, q), color=style.ESTIMATE, lw=1.0)
    worth.set_title("Manipulability of the cup's place, sqrt det J Jᵀ")
    worth.set_ylabel("[dm³]")
    worth.set_ylim(bottom=0.0)
    for index, joint in enumerate(joints):
        left = np.minimum(q[:, index] - joint.lower, joint.upper - q[:, index])
        reserve.plot(time, left, color=style.JOINTS[index], lw=1.0, label=joint.name)
    reserve.axhline(0.0, color=style.BAD, lw=0.8)
    reserve.set_title("Joints, reference from the nearer limit")
    reserve.set_ylabel("[rad]")
    reserve.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=len(joints))
