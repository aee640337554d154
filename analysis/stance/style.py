"""How every plot of this package looks: colours that mean the same everywhere, fonts, and what is shaded behind."""

from __future__ import annotations

import functools
import io
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, ParamSpec

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from PIL import Image

from . import metrics, signals, walking
from .series import Run

P = ParamSpec("P")

INK = "#1d2733"
MUTED = "#6b7785"
FAINT = "#c9d1d9"
GRID = "#e6eaee"
PAPER = "#ffffff"

GOOD = "#23804a"
BAD = "#c02f2a"
MINUS = "\N{MINUS SIGN}"

PUSH = "#f2b134"
PUSH_INK = "#8a5a00"
SAFETY = "#c02f2a"

REFERENCE = "#1d2733"
TRUTH = "#1769aa"
ESTIMATE = "#e07b1a"
PLANNED = "#aeb9c4"
FEET = ("#1769aa", "#c2185b", "#2e8b57", "#8e5bb5")
JOINTS = ("#1769aa", "#e07b1a", "#2e8b57", "#8e5bb5", "#c2185b", "#6d4c41", "#00897b", "#7a8793")
STAGES = ("#b8c4d0", "#8fa3b5", "#7fb4d9", "#4f94c4", "#2e8b57", "#1769aa", "#e07b1a", "#d9a441", "#8e5bb5", "#a1887f")
SERIES = ("#1769aa", "#e07b1a", "#2e8b57", "#8e5bb5")

PALETTE = 192  # colours of a png
BAR = 0.035  # of an axis, the thickness of a stance bar

OWN = tuple(
    dict.fromkeys(
        [PAPER, INK, MUTED, GOOD, BAD, PUSH, PUSH_INK, TRUTH, ESTIMATE, PLANNED, *FEET, *JOINTS, *STAGES, *SERIES]
    )
)
"""of the palette whatever else a picture shows"""

RC: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "text.color": INK,
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 9.0,
    "axes.labelcolor": INK,
    "axes.edgecolor": MUTED,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "grid.color": GRID,
    "grid.linewidth": 0.7,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "legend.handlelength": 1.8,
    "legend.borderaxespad": 0.2,
    "lines.linewidth": 1.2,
    "lines.solid_capstyle": "round",
    "figure.facecolor": PAPER,
    "savefig.facecolor": PAPER,
    "svg.fonttype": "path",
    "svg.hashsalt": "stance",
}


def styled(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """Gives a plot function this package's look, and its figure a canvas that needs no screen."""

    @functools.wraps(draw)
    def with_style(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with look():
            figure = draw(*args, **kwargs)
            FigureCanvasAgg(figure)
            return figure

    return with_style


def render(figure: Figure, kind: str = "png", dpi: int = 120) -> bytes:
    """The figure as a file's bytes: png, svg or pdf. The same figure gives the same bytes.

    A png has a palette of `PALETTE` colours, which makes it three times as small as true colour does.
    """
    dateless: dict[str, Any] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
    written = io.BytesIO()
    with look():
        figure.savefig(written, format=kind, dpi=dpi, metadata=dateless.get(kind))
    if kind != "png":
        return written.getvalue()
    smaller = io.BytesIO()
    with Image.open(written) as image:
        _in_few_colours(image.convert("RGB")).save(smaller, "PNG", optimize=True)
    return smaller.getvalue()


def _in_few_colours(image: Image.Image) -> Image.Image:
    """With a palette of what the image has most of and of `OWN`, which stay exactly what they are."""
    most = image.quantize(PALETTE - len(OWN), Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    own = np.array([[round(255 * part) for part in to_rgb(one)] for one in OWN], np.int64)
    weights = np.array([1 << 16, 1 << 8, 1])
    pixels, index = np.asarray(image, np.int64) @ weights, np.array(most)
    for place, colour in enumerate(own @ weights):
        index[pixels == colour] = PALETTE - len(OWN) + place
    few = Image.fromarray(index)
    colours = np.zeros((PALETTE, 3), np.uint8)
    found = np.array(most.getpalette() or [], np.uint8).reshape(-1, 3)[: PALETTE - len(OWN)]
    colours[: len(found)], colours[-len(OWN) :] = found, own
    few.putpalette(colours.tobytes())
    return few


@contextmanager
def look() -> Iterator[None]:
    """matplotlib's settings for as long as it lasts."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(RC)  # type: ignore[arg-type]  # its stubs list every key as a literal
        yield


def new_figure(width: float, height: float, title: str, subtitle: str = "") -> Figure:
    """A figure [inch] with a title and, smaller beside it, what it shows."""
    figure = Figure(figsize=(width, height), layout="constrained")
    engine = figure.get_layout_engine()
    assert engine is not None
    engine.set(rect=(0.005, 0.005, 0.99, 0.99 - 0.42 / height))  # type: ignore[call-arg]
    top = 1.0 - 0.12 / height
    figure.text(0.011, top, title, fontsize=13.0, fontweight="bold", va="top")
    if subtitle:
        figure.text(0.989, top, subtitle, fontsize=8.5, color=MUTED, va="top", ha="right")
    return figure


def shade(axes: Axes | Sequence[Axes], run: Run, label: bool = False) -> None:
    """Behind a time axis: pushes, the time in which safety did not let the robot run, and the fall."""
    spans = [(push.start, push.start + push.duration, PUSH, 0.45) for push in metrics.pushes(run)]
    spans += [(first, last, SAFETY, 0.10) for first, last in _unsafe(run)]
    fell = metrics.fall(run)
    axes = [axes] if isinstance(axes, Axes) else axes
    for ax in axes:
        for first, last, colour, alpha in spans:
            # The edge shows what is shorter than a pixel, over the grid.
            ax.axvspan(first, last, fc=(colour, alpha), ec=(colour, 0.7), lw=0.7, zorder=0.6)
        if fell is not None:
            ax.axvline(fell, color=BAD, lw=1.2, ls=(0, (4, 2)), zorder=1)
    if label:
        for push in metrics.pushes(run):
            _beside(axes[0], run, (push.start, push.start + push.duration), 1.0, push_text(push), PUSH_INK)
        if fell is not None:
            _beside(axes[0], run, (fell, fell), 0.0, "fell", BAD)


def stance_bars(axes: Axes | Sequence[Axes], run: Run) -> None:
    """Under the curves of time axes: a bar for each foot where the gait has it on the ground; nothing without a gait.

    Makes room for them below the present limits: to be called last.
    """
    time, down = walking.phases(run) if "CONTROLLER_TRACE" in run else (np.empty(0), np.empty((0, 0)))
    if down.all():
        return
    ends = np.append(time[1:], time[-1] + signals.period(run))
    for ax in [axes] if isinstance(axes, Axes) else axes:
        low, high = ax.get_ylim()
        thick = BAR * (high - low)
        for foot in range(down.shape[1]):
            spans = [(time[first], ends[last] - time[first]) for first, last in signals.intervals(down[:, foot])]
            y = low - (1.2 * foot + 1.4) * thick
            ax.broken_barh(spans, (y, thick), facecolor=FEET[foot % len(FEET)], lw=0, zorder=0.7)
        ax.set_ylim(low - (1.2 * down.shape[1] + 0.4) * thick, high)


def _beside(ax: Axes, run: Run, span: tuple[float, float], height: float, text: str, colour: str) -> None:
    """Words at the right of what happened in `span` [s]; at its left where they would leave the axes."""
    left = span[1] - run.span[0] > 0.8 * run.duration
    words = ax.annotate(
        text,
        (span[0] if left else span[1], height),
        xycoords=("data", "axes fraction"),
        xytext=(-3 if left else 3, 3 if height == 0.0 else -2),
        textcoords="offset points",
        ha="right" if left else "left",
        va="bottom" if height == 0.0 else "top",
        fontsize=7.5,
        color=colour,
    )
    words.set_in_layout(False)


def push_text(push: metrics.Push) -> str:
    """A push for people: its impulse and where it goes."""
    parts = [
        f"{'+' if value > 0 else MINUS}{axis}"
        for axis, value in zip("xyz", push.impulse_W, strict=True)
        if abs(value) > 0.1 * push.impulse
    ]
    return f"push {push.impulse:.2g} N s {' '.join(parts)}"


def _unsafe(run: Run) -> list[tuple[float, float]]:
    changes = metrics.safety(run)
    ends = [*(change.at for change in changes[1:]), run.span[1]]
    return [(change.at, end) for change, end in zip(changes, ends, strict=False) if change.mode != "run"]


def time_axis(axes: Sequence[Axes], run: Run) -> None:
    """Shares the run's time, its last state's period included, over a column of axes; only the lowest is labelled."""
    first, last = run.span
    for ax in axes[:-1]:
        ax.tick_params(labelbottom=False)
    for ax in axes:
        ax.set_xlim(first, last + signals.period(run))
    axes[-1].set_xlabel("time [s]")


def at_least(ax: Axes, span: float) -> None:
    """Keeps an axis from magnifying what is smaller than `span`."""
    low, high = ax.get_ylim()
    if high - low < span:
        middle = (low + high) / 2
        ax.set_ylim(middle - span / 2, middle + span / 2)
