from __future__ import annotations

from pathlib import Path

import pytest
from stance.log import Log
from stance.series import Run
from synthetic import Synthetic


@pytest.fixture(scope="session")
def log_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A clean log of 4 s of standing with two pushes."""
    return Synthetic().write(tmp_path_factory.mktemp("log") / "stand.lcmlog")


@pytest.fixture(scope="session")
def stand(log_path: Path) -> Run:
    return Log.open(log_path).run()
