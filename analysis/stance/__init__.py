"""Replay, analysis and command line of the Stance robot controller.

    from stance.log import Log
    from stance.metrics import measure
    run = Log.open("run.lcmlog").run()
    measure(run).trunk.tilt_max_deg

Modules: `log` reads, `series` holds; `signals`, `metrics`, `estimation` and `walking` measure, `check` judges; `plots`,
`gait_plots`, `picture`, `walk_picture` and `push_map` draw, `report` writes; `study` asks, `campaign` runs and counts,
`pushes` and `tick_cpu` tell what its trials had in common, `scoreboard` keeps; `calibration` fits a camera, `smoother`
a ball's track; `run`, `replay`, `command` and `network` speak LCM; `cli` is the command `stance`.
"""

from importlib.metadata import version

__version__ = version("stance")
