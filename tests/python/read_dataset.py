"""Reads a dataset without the project's code and checks Eq. 6 and 7 in every row.

Run as `python read_dataset.py DIR FILE`: DIR is a dataset, FILE a Markdown file whose Python snippet is also run.
Prints `# pass N` and `# fail N`.
"""

import json
import re
import sys
import traceback
from pathlib import Path

import numpy as np
import polars as pl
import pyarrow.parquet as pq
from safetensors.numpy import load_file

DOF = 23
DT = 1 / 30
# Single-precision tolerance for values up to about 20.
F32_TOLERANCE = 1e-5


def rows(folder: Path) -> pl.DataFrame:
    return pl.read_parquet(folder / "data/chunk-000/*.parquet")


def episodes(folder: Path) -> pl.DataFrame:
    return pl.read_parquet(folder / "meta/episodes/chunk-000/file-000.parquet")


def vectors(frame: pl.DataFrame, name: str) -> np.ndarray:
    return frame[name].to_numpy().astype(np.float64)


def test_rows_satisfy_eq6_and_eq7(folder: Path) -> None:
    frame = rows(folder)
    state, action = vectors(frame, "observation.state"), vectors(frame, "action")
    q, qd = state[:, :DOF], state[:, DOF:]
    qdd, target = action[:, :DOF], action[:, DOF:]
    next_q = q + DT * qd + 0.5 * DT**2 * qdd  # Eq. 6
    next_qd = qd + DT * qdd  # Eq. 7
    assert len(q) > 100, f"only {len(q)} rows"
    assert np.abs(next_q - target).max() < F32_TOLERANCE
    index = frame["frame_index"].to_numpy()
    is_consecutive = index[1:] == index[:-1] + 1
    assert np.abs(next_q[:-1] - q[1:])[is_consecutive].max() < F32_TOLERANCE
    assert np.abs(next_qd[:-1] - qd[1:])[is_consecutive].max() < F32_TOLERANCE
    # Sensitivity: an error of half a step is detected.
    assert np.abs(q + 1.5 * DT * qd - target).max() > 100 * F32_TOLERANCE


def test_episodes_cover_all_rows(folder: Path) -> None:
    frame, table = rows(folder), episodes(folder)
    info = json.loads((folder / "meta/info.json").read_text())
    assert info["codebase_version"] == "v3.0"
    assert info["total_frames"] == len(frame) and info["total_episodes"] == len(table)
    assert frame["index"].to_list() == list(range(len(frame)))
    starts = table["dataset_from_index"].to_list()
    ends = table["dataset_to_index"].to_list()
    assert starts == [0] + ends[:-1] and ends[-1] == len(frame)
    for episode, (start, end) in enumerate(zip(starts, ends)):
        rows_of_episode = frame[start:end]
        assert (rows_of_episode["episode_index"] == episode).all()
        assert rows_of_episode["frame_index"].to_list() == list(range(end - start))
        assert table["contact_row"][episode] < end - start
    widths = {"observation.state": 2 * DOF, "observation.environment_state": 7, "action": 2 * DOF}
    for name, width in widths.items():
        feature = info["features"][name]
        assert feature["shape"] == [width] and len(feature["names"]) == width
    # LeRobot 0.6 rejects a dataset in which one of these is not positive.
    for name in ("fps", "chunks_size", "data_files_size_in_mb", "video_files_size_in_mb"):
        assert info[name] > 0, f"{name} is {info[name]}"


def test_columns_are_compressed_as_visualizers_read_them(folder: Path) -> None:
    # The visualizer of LeRobot reads SNAPPY without further packages, but not ZSTD.
    for path in [*folder.glob("data/*/*.parquet"), *folder.glob("meta/episodes/*/*.parquet")]:
        metadata = pq.ParquetFile(path).metadata
        for group in range(metadata.num_row_groups):
            columns = (metadata.row_group(group).column(i) for i in range(metadata.num_columns))
            assert {column.compression for column in columns} <= {"SNAPPY", "UNCOMPRESSED"}, path


def test_environment_state_is_the_pose_of_the_episode(folder: Path) -> None:
    frame, table = rows(folder), episodes(folder)
    state = vectors(frame, "observation.environment_state")
    for episode in table.iter_rows(named=True):
        of_episode = state[episode["dataset_from_index"] : episode["dataset_to_index"]]
        pose = [episode["x"], episode["y"], np.sin(episode["yaw"]), np.cos(episode["yaw"])]
        assert np.allclose(of_episode[:, :4], pose, atol=1e-6)
    # Extents of the sugar box, from assets/objects/ycb/sugar_box.toml.
    assert np.allclose(state[:, 4:], [0.049, 0.094, 0.176], atol=1e-4)


def test_tasks_are_indexed_by_their_text(folder: Path) -> None:
    table = pq.read_table(folder / "meta/tasks.parquet")
    # Without this metadata, LeRobot reads the task as a row number.
    assert table.schema.pandas_metadata["index_columns"] == ["task"]
    tasks = dict(zip(table["task_index"].to_pylist(), table["task"].to_pylist()))
    assert tasks == {0: "lift the sugar box"}
    assert set(rows(folder)["task_index"]) == {0}


def test_statistics_match_the_rows(folder: Path) -> None:
    stats = json.loads((folder / "meta/stats.json").read_text())
    frame = rows(folder)
    assert set(stats) == set(json.loads((folder / "meta/info.json").read_text())["features"])
    for name in stats:
        values = vectors(frame, name).reshape(len(frame), -1)
        of = {key: np.array(value) for key, value in stats[name].items()}
        assert np.allclose(of["mean"], values.mean(0), atol=1e-6)
        assert np.allclose(of["std"], values.std(0), atol=1e-5)
        assert np.allclose(of["min"], values.min(0)) and np.allclose(of["max"], values.max(0))
        assert stats[name]["count"] == [len(values)]
        # A quantile is accurate to 1/4096 of the range.
        tolerance = (of["max"] - of["min"]) / 4096 + 1e-6
        for key, level in {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}.items():
            assert ((values <= of[key] + tolerance).mean(0) >= level).all(), (name, key)
            assert ((values < of[key] - tolerance).mean(0) <= level).all(), (name, key)


def test_card_selects_the_rows_for_hugging_face(folder: Path) -> None:
    header = (folder / "README.md").read_text().split("---\n")[1]
    assert "data_files: data/*/*.parquet" in header and "- LeRobot" in header
    assert len(list(folder.glob("data/*/*.parquet"))) > 0


def test_every_kept_attempt_is_an_episode(folder: Path) -> None:
    attempts, poses = (pl.read_parquet(folder / f"{name}.parquet") for name in ("attempts", "poses"))
    kept = attempts.filter(pl.col("outcome") == "kept")
    table = episodes(folder)
    key = ["object", "pose_index", "target_seed", "grasp"]
    assert kept.select(key).rows() == table.select(key).rows()
    assert poses["num_kept"].sum() == len(kept) and poses["num_attempts"].sum() == len(attempts)


def test_clouds_are_within_the_workspace(folder: Path) -> None:
    files = sorted((folder / "clouds/poses").rglob("*.safetensors"))
    files += sorted((folder / "clouds/objects").rglob("*.safetensors"))
    assert files
    for file in files:
        tensors = load_file(file)
        for name in ("noisy", "clean"):
            points = tensors[name]
            assert points.shape[-2:] == (512, 3) and np.isfinite(points).all()
            assert (points >= [0.25, -0.40, -0.25]).all() and (points <= [0.95, 0.40, 0.15]).all()


def test_documented_snippet_runs(folder: Path, document: Path) -> None:
    snippet = re.search(r"```python\n(.*?)```", document.read_text(), re.DOTALL)
    assert snippet, "no Python snippet in the Markdown file"
    code = snippet.group(1)
    assert "DIR" in code
    exec(compile(code.replace('"DIR"', repr(str(folder))), str(document), "exec"), {})


def main() -> int:
    folder, document = Path(sys.argv[1]), Path(sys.argv[2])
    tests = {name: test for name, test in globals().items() if name.startswith("test_")}
    failed = 0
    for name, test in tests.items():
        arguments = (folder, document) if test.__code__.co_argcount == 2 else (folder,)
        try:
            test(*arguments)
            print(f"{name} ... ok")
        except Exception:
            failed += 1
            traceback.print_exc()
            print(f"{name} ... FAILED")
    print(f"# pass {len(tests) - failed}\n# fail {failed}")
    return min(failed, 1)


if __name__ == "__main__":
    sys.exit(main())
