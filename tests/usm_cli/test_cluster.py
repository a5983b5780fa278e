"""The same tasks on a real Ray cluster on this machine give the same bits."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.episodes import short

ray = pytest.importorskip("ray", reason="the extra `cluster` is not installed")

from usm_cli.program import main  # noqa: E402


@pytest.fixture
def address() -> Iterator[str]:
    from ray.cluster_utils import Cluster

    cluster = Cluster()
    try:
        cluster.add_node(num_cpus=2)
    except Exception as error:
        cluster.shutdown()
        pytest.skip(f"no Ray cluster can be started here: {error}")
    try:
        yield cluster.address
    finally:
        cluster.shutdown()


@pytest.mark.slow
def test_a_cluster_gives_the_same_bits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, address: str
) -> None:
    monkeypatch.chdir(tmp_path)
    scenarios = [each.to_dict() for each in short(40)]
    (tmp_path / "suite.json").write_text(json.dumps({"scenarios": scenarios}))
    results = []
    for options in ([], ["--cluster", address]):
        command = ["evaluate", "--policies", "sta,zero", "--suite", "suite.json"]
        main([*command, "--output", "results.json", *options])
        results.append(json.loads((tmp_path / "results.json").read_text())["results"])
    assert results[0] == results[1]
