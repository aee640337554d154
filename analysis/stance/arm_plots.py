"""The plots of the 3-joint arm: document 004's figures, how its motion was tracked, and the way of its end effector."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from . import arm3, configuration, style
from .series import Floats, Run
from .style import new_figure, shade, styled, time_axis

WIDTH = 11.0  # inch
POSES = 7  # drawn of the arm
VIEWS = (("from the side", 0, 2), ("from the front", 1, 2), ("from above", 0, 1))  # title, axes of A


@styled
def joint_rates(run: Run) -> Figure:
    """The document's three figures: the joint rates that were calculated from v, omega and J, over the given ones."""
    fig = new_figure(WIDTH, 7.0, "Joint rates: calculated over given", configuration.title(run))
    axes = list(fig.subplots(arm3.JOINTS, 1, sharex=True))
    time = run.time(arm3.CHANNEL)
    given, calculated = (run.field(arm3.CHANNEL, name) for name in ("given_rate", "calculated_rate"))
    for joint, ax in enumerate(axes):
        ax.step(time, given[:, joint], where="post", color=style.PLANNED, lw=4.0, label="given")
        ax.step(time, calculated[:, joint], where="post", color=style.TRUTH, lw=1.1, label="calculated")
        _true_rate(ax, run, joint)
        ax.set_ylabel(rf"$\dot\theta_{joint + 1}$ [rad/s]")
        style.at_least(ax, 0.02)
    axes[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3)
    shade(axes, run)
    time_axis(axes, run)
    return fig


def _true_rate(ax: Axes, run: Run, joint: int) -> None:
    if "TRUTH" in run:
        rate = run.field("TRUTH", "joint_velocity")[:, joint]
        ax.plot(run.time("TRUTH"), rate, color=style.ESTIMATE, lw=0.8, ls=(0, (4, 2)), label="the arm's, true")


@styled
def tracking(run: Run) -> Figure:
    """What is between the arm and its reference, and between the map that velocities keep and forward kinematics."""
    fig = new_figure(WIDTH, 7.0, "Tracking, and the map kept by velocities", configuration.title(run))
    axes = list(fig.subplots(3, 1, sharex=True))
    time = run.time(arm3.CHANNEL)
    error = 1000.0 * arm3.joint_error(run)
    for joint in range(arm3.JOINTS):
        axes[0].plot(time, error[:, joint], color=style.JOINTS[joint], lw=1.0, label=rf"$\theta_{joint + 1}$")
    axes[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=arm3.JOINTS)
    axes[0].set_title("Joints, true less reference")
    axes[0].set_ylabel("[mrad]")
    axes[1].plot(time, 1000.0 * arm3.tool_error(run), color=style.TRUTH, lw=1.0)
    axes[1].set_title("End effector, true place from its reference")
    axes[1].set_ylabel("[mm]")
    playing = run.field(arm3.CHANNEL, "step") > 0
    axes[2].plot(time, np.where(playing, 1000.0 * arm3.map_error(run), np.nan), color=style.ESTIMATE, lw=1.2)
    axes[2].set_title("Place of the integrated map less forward kinematics of the integrated angles")
    axes[2].set_ylabel("[mm]")
    for ax in axes[1:]:
        ax.set_ylim(bottom=0.0)
    shade(axes, run)
    time_axis(axes, run)
    return fig


@styled
def way(run: Run) -> Figure:
    """The arm at instants of its first motion, and the way of its end effector, true and by the map."""
    fig = new_figure(WIDTH, 4.6, "The arm and the way of its end effector", configuration.title(run))
    axes = fig.subplots(1, len(VIEWS))
    rows = (arm3.spans(run) or [np.arange(run.count(arm3.CHANNEL))])[0]
    theta = run.field(arm3.CHANNEL, "theta")[rows]
    kept = run.field(arm3.CHANNEL, "map_A3")[rows, :3, 3]
    error = arm3.joint_error(run)[rows]
    true = arm3.tool_poses(run, (theta + error)[np.isfinite(error).all(axis=1)])[:, :3, 3]
    chain = _chain(run, theta[np.linspace(0, len(theta) - 1, POSES).astype(int)])
    for ax, (title, across, up) in zip(axes, VIEWS, strict=True):
        for age, pose in enumerate(chain):
            faint = 0.25 + 0.75 * age / max(len(chain) - 1, 1)
            ax.plot(pose[:, across], pose[:, up], "-o", color=style.MUTED, lw=3.0, ms=4.0, alpha=faint)
        ax.plot(kept[:, across], kept[:, up], color=style.PLANNED, lw=3.5, label="by the map")
        if len(true):
            ax.plot(true[:, across], true[:, up], color=style.TRUTH, lw=1.0, label="true")
        ax.set_aspect("equal", adjustable="datalim")
        ax.set_title(f"Seen {title}")
        ax.set_xlabel(f"{'xyz'[across]} [m]")
        ax.set_ylabel(f"{'xyz'[up]} [m]")
    axes[-1].legend(loc="upper right", fontsize=7.5)
    return fig


def _chain(run: Run, theta: Floats) -> Floats:
    """m, (n, joints + 2, 3): the base's origin, the joints' and the end effector's, of angles [rad] (n, 3)."""
    body = configuration.robot(run)
    assert body is not None
    frames = body.forward(theta)
    points = [frames[joint.child][:, :3, 3] for joint in body.moving]
    base = np.zeros_like(points[0])
    return np.stack([base, *points, arm3.tool_poses(run, theta)[:, :3, 3]], axis=1)
