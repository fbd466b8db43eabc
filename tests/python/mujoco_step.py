"""Time of a MuJoCo physics step (ms): arm-hand in its home configuration, table, sugar box.

Run as `python mujoco_step.py URDF`; prints `row mujoco_step VALUE ms`. Time step, motors and armatures match
assets/scene/scene.toml. Contacts between adjacent links are disabled, as in our scene.
"""

import sys
import time
from pathlib import Path

import mujoco
import numpy as np

ARM, HAND = 7, 16
HOME = [0.0, 0.5, 0.0, -2.0, 0.0, -1.4, 2.3]
OPEN = [0.0, 0.3, 0.3, 0.3] * 3 + [1.2, 0.35, 0.15, 0.3]
STEPS, REPEATS = 1000, 9


def model(urdf: Path) -> mujoco.MjModel:
    spec = mujoco.MjSpec.from_string(urdf.read_text())
    spec.option.timestep = 1 / 240
    world = spec.worldbody
    world.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, pos=[0.65, 0, -0.30], size=[0.40, 0.55, 0.05])
    box = world.add_body(pos=[0.6, 0.0, -0.25 + 0.088])
    box.add_freejoint()
    box.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.0245, 0.047, 0.088], mass=0.514)
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


def main() -> None:
    compiled = model(Path(sys.argv[1]))
    data = mujoco.MjData(compiled)
    target = np.array(HOME + OPEN)
    assert compiled.nu == ARM + HAND, f"{compiled.nu} motors"
    data.ctrl[:] = target
    for i in range(compiled.nu):
        data.qpos[compiled.jnt_qposadr[compiled.actuator_trnid[i, 0]]] = target[i]
    mujoco.mj_forward(compiled, data)
    seconds = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        for _ in range(STEPS):
            mujoco.mj_step(compiled, data)
        seconds.append((time.perf_counter() - start) / STEPS)
    assert np.isfinite(data.qpos).all()
    print(f"contacts at the end: {data.ncon}", file=sys.stderr)
    print(f"row mujoco_step {1000 * sorted(seconds)[REPEATS // 2]:.4f} ms")


if __name__ == "__main__":
    main()
