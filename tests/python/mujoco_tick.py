"""Time (ms) that MuJoCo needs for a control period of 1/30 s: arm, hand, table and sugar box.

Run as `python mujoco_tick.py URDF STATE`. STATE is the JSON file of `ngf bench --physics --state`: the robot holds
the box. Prints `row NAME VALUE ms` for the robot at home, with the box on the table, and for that state. Each control
period starts in the same state: our box is rounded, so with MuJoCo's the grasp does not hold for seconds. Motors and
armatures match assets/scene/scene.toml. Contacts between adjacent links are disabled, as in our scene. The time step
is 1/240 s; MuJoCo's default is 1/500 s.
"""

import json
import sys
import time
from pathlib import Path

import mujoco
import numpy as np

ARM, HAND = 7, 16
HOME = [0.0, 0.5, 0.0, -2.0, 0.0, -1.4, 2.3]
OPEN = [0.0, 0.3, 0.3, 0.3] * 3 + [1.2, 0.35, 0.15, 0.3]
STEPS_PER_TICK, TICKS = 8, 600
TABLE_TOP = -0.25


def model(urdf: Path, half_extents: list[float], mass: float) -> mujoco.MjModel:
    spec = mujoco.MjSpec.from_string(urdf.read_text())
    spec.option.timestep = 1 / (30 * STEPS_PER_TICK)
    world = spec.worldbody
    world.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, pos=[0.65, 0, TABLE_TOP - 0.05], size=[0.40, 0.55, 0.05])
    box = world.add_body(name="box", pos=[0.6, 0.0, TABLE_TOP + half_extents[2]])
    box.add_freejoint()
    box.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=half_extents, mass=mass, friction=[0.8, 0.005, 0.0001])
    for i, joint in enumerate(j for j in spec.joints if j.type == mujoco.mjtJoint.mjJNT_HINGE):
        is_arm = i < ARM
        joint.armature = 0.1 if is_arm else 0.001
        joint.damping = [0.5 if is_arm else 0.005] + [0.0] * (len(np.atleast_1d(joint.damping)) - 1)
        gain, damping = (4000.0, 200.0) if is_arm else (3.0, 0.1)
        actuator = spec.add_actuator(name=f"motor_{i}", target=joint.name)
        actuator.trntype = mujoco.mjtTrn.mjTRN_JOINT
        actuator.gainprm[0] = gain
        actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        actuator.biasprm[1:3] = [-gain, -damping]
    for body in spec.bodies[1:]:
        if body.name != box.name:
            body.gravcomp = 1
    return spec.compile()


def set_state(
    compiled: mujoco.MjModel, data: mujoco.MjData, q: list[float], target: list[float], box: list[float] | None
) -> None:
    mujoco.mj_resetData(compiled, data)
    data.ctrl[:] = target
    for i in range(compiled.nu):
        data.qpos[compiled.jnt_qposadr[compiled.actuator_trnid[i, 0]]] = q[i]
    if box is not None:
        free = next(j for j in range(compiled.njnt) if compiled.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE)
        address = compiled.jnt_qposadr[free]
        data.qpos[address : address + 7] = box
    mujoco.mj_forward(compiled, data)


def tick_ms(
    compiled: mujoco.MjModel, q: list[float], target: list[float], box: list[float] | None
) -> tuple[float, mujoco.MjData]:
    """Median time (ms) of a control period that starts in the given state."""
    assert compiled.nu == ARM + HAND, f"{compiled.nu} motors"
    data = mujoco.MjData(compiled)
    seconds = []
    for _ in range(TICKS):
        set_state(compiled, data, q, target, box)
        start = time.perf_counter()
        for _ in range(STEPS_PER_TICK):
            mujoco.mj_step(compiled, data)
        seconds.append(time.perf_counter() - start)
    assert np.isfinite(data.qpos).all()
    return 1000 * sorted(seconds)[TICKS // 2], data


def main() -> None:
    state = json.loads(Path(sys.argv[2]).read_text())
    compiled = model(Path(sys.argv[1]), state["half_extents"], state["mass"])
    home, _ = tick_ms(compiled, HOME + OPEN, HOME + OPEN, None)
    pose = state["world_from_center"]
    holding, data = tick_ms(compiled, state["q"], state["target"], pose["translation"] + pose["rotation_wxyz"])
    print(f"holding: {data.ncon} contacts at the end of the period", file=sys.stderr)
    assert data.ncon >= 4, f"{data.ncon} contacts: the hand does not touch the box"
    print(f"row mujoco_physics_tick_home {home:.4f} ms")
    print(f"row mujoco_physics_tick_holding {holding:.4f} ms")


if __name__ == "__main__":
    main()
