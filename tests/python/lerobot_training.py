"""Opens a dataset with LeRobot and trains its two small policies for a few steps.

Run as `python lerobot_training.py DIR`: DIR is a dataset of sugar boxes, such as that of `--preset smoke`.
Prints `# pass N` and `# fail N`.
"""

import sys
import traceback
from pathlib import Path

import torch
from datasets import load_dataset
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot.configs import FeatureType
from lerobot.policies.factory import make_policy, make_policy_config, make_pre_post_processors
from lerobot.datasets.factory import resolve_delta_timestamps

STEPS = 50
AVERAGED = 10
SEEDS = (0, 1, 2)
BATCH = 16
LEARNING_RATE = 1e-4
# Small networks: 50 steps take seconds on two cores.
POLICIES = {
    "act": {"dim_model": 128, "n_heads": 4, "dim_feedforward": 256, "chunk_size": 16, "n_action_steps": 16},
    "diffusion": {"down_dims": (64, 128, 256), "horizon": 16, "n_action_steps": 8},
}


def open_dataset(folder: Path, **options: object) -> LeRobotDataset:
    return LeRobotDataset("local/dataset", root=folder, **options)


def test_items_have_task_state_and_action(folder: Path) -> None:
    dataset = open_dataset(folder)
    assert len(dataset) == dataset.meta.total_frames > 100
    for index in (0, len(dataset) // 2, len(dataset) - 1):
        item = dataset[index]
        assert item["task"] == "lift the sugar box", item["task"]
        assert item["observation.state"].shape == (46,) and item["action"].shape == (46,)
        x, y, sin, cos, *extents = item["observation.environment_state"].tolist()
        assert 0.4 <= x <= 0.8 and abs(y) < 0.4 and abs(sin**2 + cos**2 - 1) < 1e-5
        assert all(0.01 < extent < 0.3 for extent in extents)


def test_statistics_have_quantiles(folder: Path) -> None:
    stats = open_dataset(folder).meta.stats
    for name in ("observation.state", "observation.environment_state", "action"):
        of = stats[name]
        order = ["min", "q01", "q10", "q50", "q90", "q99", "max"]
        for lower, upper in zip(order, order[1:]):
            assert (of[lower] <= of[upper] + 1e-6).all(), (name, lower, upper)


def test_chunks_of_actions_are_read_with_timestamps(folder: Path) -> None:
    dataset = open_dataset(folder, delta_timestamps={"action": [i / 30 for i in range(16)]})
    item = dataset[0]
    assert item["action"].shape == (16, 46) and not item["action_is_pad"].any()


def test_hugging_face_datasets_loads_the_folder(folder: Path) -> None:
    rows = load_dataset(str(folder), split="train")
    assert len(rows) == open_dataset(folder).meta.total_frames
    assert len(rows[0]["observation.state"]) == 46


def losses(folder: Path, name: str, seed: int) -> list[float]:
    """Training losses of a policy."""
    torch.manual_seed(seed)
    config = make_policy_config(name, device="cpu", push_to_hub=False, **POLICIES[name])
    meta = open_dataset(folder).meta
    policy = make_policy(config, ds_meta=meta)
    assert any(feature.type is FeatureType.ENV for feature in config.input_features.values())
    preprocess, _ = make_pre_post_processors(config, dataset_stats=meta.stats)
    dataset = open_dataset(folder, delta_timestamps=resolve_delta_timestamps(config, meta))
    loader = torch.utils.data.DataLoader(dataset, batch_size=BATCH, shuffle=True, drop_last=True)
    optimizer = torch.optim.AdamW(policy.parameters(), lr=LEARNING_RATE)
    policy.train()
    values: list[float] = []
    while len(values) < STEPS:
        for batch in loader:
            loss, _ = policy.forward(preprocess(batch))
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            values.append(loss.item())
            if len(values) == STEPS:
                break
    return values


def assert_loss_falls(folder: Path, name: str) -> None:
    for seed in SEEDS:
        values = losses(folder, name, seed)
        first, last = sum(values[:AVERAGED]) / AVERAGED, sum(values[-AVERAGED:]) / AVERAGED
        print(f"{name}, seed {seed}: mean loss of the first {AVERAGED} steps {first:.3f}, of the last {last:.3f}")
        assert last < first, (name, seed, values)


def test_act_learns(folder: Path) -> None:
    assert_loss_falls(folder, "act")


def test_diffusion_learns(folder: Path) -> None:
    assert_loss_falls(folder, "diffusion")


def main() -> int:
    folder = Path(sys.argv[1])
    tests = {name: test for name, test in globals().items() if name.startswith("test_")}
    failed = 0
    for name, test in tests.items():
        try:
            test(folder)
            print(f"{name} ... ok")
        except Exception:
            failed += 1
            traceback.print_exc()
            print(f"{name} ... FAILED")
    print(f"# pass {len(tests) - failed}\n# fail {failed}")
    return min(failed, 1)


if __name__ == "__main__":
    sys.exit(main())
