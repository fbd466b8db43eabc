"""Reads a dataset of `ngf dataset generate` without this project's code.

python examples/06_read_dataset.py DIR        (needs polars and safetensors)
"""

import sys
from pathlib import Path

import polars as pl
from safetensors.numpy import load_file

root = Path(sys.argv[1])

frames = pl.read_parquet(root / "data/chunk-000/*.parquet")  # 30 frames per second
state = frames["observation.state"].to_numpy()  # (frames, 46): 23 positions (rad), 23 velocities
action = frames["action"].to_numpy()  # (frames, 46): 23 accelerations (rad/s2), 23 positions
print("frames", state.shape, action.shape)

episodes = pl.read_parquet(root / "meta/episodes/chunk-000/file-000.parquet")
print(episodes.select("object", "x", "y", "yaw", "grasp", "length", "contact_row").head(5))

trials = pl.read_parquet(root / "attempts.parquet")
print(trials.group_by("object", "outcome").len().sort("object", "outcome"))

for path in sorted((root / "clouds/poses").rglob("*.safetensors"))[:1]:
    clouds = load_file(path)
    # (poses, azimuths, clouds, 512, 3), robot base frame, metres
    print(path.relative_to(root), clouds["noisy"].shape)
