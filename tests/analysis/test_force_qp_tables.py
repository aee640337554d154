"""The README's tables of the force QP, from records of a benchmark."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pytest
from stance.errors import StanceError
from stance.programs import SOURCE_TREE

sys.path.insert(0, str(SOURCE_TREE / "tests/bench"))
import force_qp_tables


def record(engine: str, case: str, median: float, p99: float, **others: Any) -> dict[str, Any]:
    return {"engine": engine, "case": case, "N": 20, "median_us": median, "p99_us": p99} | {
        "max_force_error_N": others.get("error", 1e-9),
        "failures": others.get("failures", 0),
    }


@pytest.fixture
def records(tmp_path: Path) -> Path:
    file = tmp_path / "bench.json"
    rows = [
        record("structured", "stand 1", 1.0, 4.0),
        record("structured", "stand 2", 3.0, 6.0),
        record("daqp", "stand 1", 30.0, 40.0, error=2e-6),
        record("daqp", "stand 2", 50.0, 60.0, failures=2),
        record("hpipm", "stand 1", 90.0, 20.0),
        record("hpipm", "stand 2", 90.0, 30.0),
    ]
    file.write_text(json.dumps(rows))
    return file


def test_a_ratio_is_of_the_best_peer_at_the_median_and_of_the_best_at_p99(records: Path) -> None:
    results = force_qp_tables.read([records])
    assert force_qp_tables.ratios(results, "structured", ("stand", 20)) == (20.0, 5.0)


def test_a_row_tells_means_over_seeds_the_worst_error_and_all_failures(records: Path) -> None:
    rows = force_qp_tables.table(force_qp_tables.read([records])).splitlines()
    assert "| `structured`, AVX-512 | 2.0 / 5.0 | 1e-09 | 0 |" in rows
    assert "| DAQP 0.11 | 40 / 50 | 2e-06 | 2 |" in rows
    assert "| best peer / ours, AVX-512 | **20.0 / 5.0** | | |" in rows


def test_tables_and_figure_come_from_one_command(records: Path, tmp_path: Path) -> None:
    readme, picture = tmp_path / "README.md", tmp_path / "qp.png"
    marks = ("force-qp", "force-qp-coupled")
    readme.write_text("".join(f"before\n<!-- {name} -->\nold\n<!-- /{name} -->\nafter\n" for name in marks))
    words = ["--plain", str(records), "--coupled", str(records), "--readme", str(readme), "--figure", str(picture)]
    force_qp_tables.main(words)
    text = readme.read_text()
    assert "old" not in text
    assert text.count("DAQP") == 2
    assert text.count("before\n") == text.count("\nafter\n") == 2
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_a_file_that_is_none_is_named(tmp_path: Path) -> None:
    file = tmp_path / "none.json"
    file.write_text('[{"engine": "daqp"}]')
    with pytest.raises(StanceError, match=r"none\.json"):
        force_qp_tables.read([file])
