"""Writes networks.json: the networks in PyTorch, float64, for tests/tests/goldens.rs.

    pip install torch numpy && python tests/golden/networks.py

Independent of the Rust code: the equations are those of the paper (III-A, III-B, III-D), d psi/dq comes
from automatic differentiation, neighborhoods from sorting. Weights, clouds and states are hashes of their
index, exact in half precision, and need not be stored. Frequencies come from their seed.
"""

import json
import math
import pathlib
import xml.etree.ElementTree
import zlib

import numpy as np
import torch

HERE = pathlib.Path(__file__).parent
DOF, LATENT, FREQUENCIES, HIDDEN = 23, 32, 500, 512
TRIANGLE = DOF * (DOF + 1) // 2
torch.set_default_dtype(torch.float64)


def hashed(name, count):
    """Pseudo-random multiples of 1/512 in [-1, 1) by name and index."""
    k = np.arange(count, dtype=np.uint64)
    h = (k * 2654435761 + zlib.crc32(name.encode())) & 0xFFFFFFFF
    h = ((h ^ (h >> np.uint64(15))) * 2246822519) & 0xFFFFFFFF
    return ((h >> np.uint64(22)).astype(np.float64) - 512) / 512


def layers(name, widths):
    """Weights and biases of an MLP; the scale is the power of two at or above sqrt(3 / inputs)."""
    found = {}
    for i, (inputs, outputs) in enumerate(zip(widths, widths[1:])):
        scale = 2.0 ** math.ceil(math.log2(math.sqrt(3 / inputs)))
        weight = hashed(f"{name}.{i}.weight", inputs * outputs).reshape(inputs, outputs) * scale
        found[f"{name}.{i}.weight"] = torch.tensor(weight, requires_grad=True)
        bias = hashed(f"{name}.{i}.bias", outputs) / 8
        found[f"{name}.{i}.bias"] = torch.tensor(bias, requires_grad=True)
    return found


def mlp(params, name, x, activation, after_last=False):
    count = sum(key.startswith(f"{name}.") and key.endswith("weight") for key in params)
    for i in range(count):
        x = x @ params[f"{name}.{i}.weight"] + params[f"{name}.{i}.bias"]
        if i + 1 < count or after_last:
            x = activation(x)
    return x


def chacha8(seed):
    """Output words of rand_chacha's ChaCha8Rng::seed_from_u64."""
    key, state, mask = [], seed, (1 << 64) - 1
    for _ in range(8):
        state = (state * 6364136223846793005 + 11634580027462260723) & mask
        word = (((state >> 18) ^ state) >> 27) & 0xFFFFFFFF
        rotation = state >> 59
        key.append(((word >> rotation) | (word << (32 - rotation))) & 0xFFFFFFFF)
    counter = 0
    while True:
        start = [0x61707865, 0x3320646E, 0x79622D32, 0x6B206574, *key]
        start += [counter & 0xFFFFFFFF, counter >> 32, 0, 0]
        x = list(start)

        def quarter(a, b, c, d):
            for p, q, r, by in ((a, b, d, 16), (c, d, b, 12), (a, b, d, 8), (c, d, b, 7)):
                x[p] = (x[p] + x[q]) & 0xFFFFFFFF
                v = x[r] ^ x[p]
                x[r] = ((v << by) | (v >> (32 - by))) & 0xFFFFFFFF

        for _ in range(4):
            for column in range(4):
                quarter(column, column + 4, column + 8, column + 12)
            for column in range(4):
                quarter(
                    column,
                    4 + (column + 1) % 4,
                    8 + (column + 2) % 4,
                    12 + (column + 3) % 4,
                )
        yield from ((a + b) & 0xFFFFFFFF for a, b in zip(x, start))
        counter += 1


def frequencies(blocks, seed):
    """Gaussian frequencies of each input block, divided by its length scale."""
    words = chacha8(seed)
    rows = []
    for size, length_scale in blocks:
        for _ in range(size * FREQUENCIES):
            u, v = ((next(words) >> 8) / 2.0**24 for _ in range(2))
            normal = math.sqrt(-2 * math.log(1 - u)) * math.cos(2 * math.pi * v)
            rows.append(normal / length_scale)
    return torch.tensor(rows).reshape(-1, FREQUENCIES)


ROBOT = xml.etree.ElementTree.parse(HERE / "../../assets/robot/iiwa7_allegro/robot.urdf")
MOVING = [joint for joint in ROBOT.iter("joint") if joint.get("type") == "revolute"]


def limits():
    """Lower and upper limits of the 23 joints."""
    bound = lambda which: torch.tensor([float(j.find("limit").get(which)) for j in MOVING])
    return bound("lower"), bound("upper")


def rotation(axis, angle):
    """Rotation matrix about a unit axis."""
    x, y, z = axis
    cross = torch.tensor([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return torch.eye(3) + angle.sin() * cross + (1 - angle.cos()) * cross @ cross


def fingertips(q):
    """Fingertip positions of one configuration, from the URDF: index, middle, ring, thumb."""
    child = {joint.find("child").get("link"): joint for joint in ROBOT.iter("joint")}
    numbers = lambda text: [float(x) for x in text.split()]

    def position(link, at):
        while (joint := child.get(link)) is not None:
            if joint in MOVING:
                at = rotation(numbers(joint.find("axis").get("xyz")), q[MOVING.index(joint)]) @ at
            origin = joint.find("origin")
            for axis, angle in zip(torch.eye(3).tolist(), numbers(origin.get("rpy", "0 0 0"))):
                at = rotation(axis, torch.tensor(angle)) @ at
            at = at + torch.tensor(numbers(origin.get("xyz", "0 0 0")))
            link = joint.find("parent").get("link")
        return at

    names = ("index_tip", "middle_tip", "ring_tip", "thumb_tip")
    return torch.cat([position(name, torch.zeros(3)) for name in names])


def imitation(qdd, q, qd, target, settings):
    """Eq. 2 with the expert of Eq. 1: error of the joints and, by the Jacobian, of the fingertips."""
    expert = settings["position"] * (target - q) - settings["velocity"] * qd
    error = qdd - expert
    jacobians = torch.stack([torch.autograd.functional.jacobian(fingertips, row) for row in q])
    fingertip_error = settings["fingertip_weight"] * (jacobians @ error[..., None])[..., 0]
    return torch.sqrt((error**2).sum(-1) + (fingertip_error**2).sum(-1) + 1e-6).mean()


def positive(x):
    return torch.nn.functional.elu(x) + 1 + 1e-3


def metric(entries):
    """M = U U^T + 0.01 I with a lower triangular U and a positive diagonal (III-B)."""
    u = torch.zeros(*entries.shape[:-1], DOF, DOF)
    rows, columns = torch.tril_indices(DOF, DOF)
    u[..., rows, columns] = entries
    diagonal = torch.diagonal(u, dim1=-2, dim2=-1)
    u = u - torch.diag_embed(diagonal) + torch.diag_embed(positive(diagonal))
    return u @ u.transpose(-1, -2) + 0.01 * torch.eye(DOF)


def ngf(params, config, q, qd, z):
    """Eq. 3 to 5: q'' of a batch, with psi, its gradient and the entries of both metrics' U."""
    lower, upper = limits()
    q = q.detach().requires_grad_()
    scaled = (2 * q - upper - lower) / (upper - lower)
    unit = qd / torch.sqrt((qd**2).sum(-1, keepdim=True) + 1e-6)
    position = (DOF, config["position_scale"])
    velocity = (DOF, config["velocity_scale"])
    latent = (LATENT, config["latent_scale"])

    def network(index, name, speed):
        blocks = [position, latent] if speed is None else [position, velocity, latent]
        x = torch.cat([scaled, z] if speed is None else [scaled, speed, z], -1)
        phases = x @ frequencies(blocks, config["frequency_seed"] + index)
        features = torch.cat([phases.cos(), phases.sin()], -1)
        return mlp(params, name, features, torch.nn.functional.elu)

    entries = network(0, "geometry_metric", unit), network(2, "driving_metric", None)
    metric_g, metric_f = map(metric, entries)
    chi = network(1, "geometry", unit)
    base = 0.5 * config["base_stiffness"] * ((q - torch.tensor(config["potential_center"])) ** 2).sum(-1)
    psi = config["potential_scale"] * network(3, "potential", None)[:, 0] + base
    slope = torch.autograd.grad(psi.sum(), q, create_graph=True)[0]
    damping = positive(network(4, "damping", qd))

    speed2 = (qd**2).sum(-1, keepdim=True)
    solve = lambda f: torch.linalg.solve(metric_g + metric_f, f[..., None])[..., 0]
    h = -solve((metric_g @ (speed2 * chi)[..., None])[..., 0])
    alpha = -(qd * h).sum(-1, keepdim=True) / (speed2 + 1e-6)
    qdd = h + alpha * qd - solve(slope + damping * qd) - 5.0 * qd
    return qdd, psi, slope, torch.cat(entries, -1)


def baseline(params, config, q, qd, z):
    """Acceleration MLP (baseline, III-C) on the scaled state or its Fourier features."""
    lower, upper = limits()
    x = torch.cat([(2 * q - upper - lower) / (upper - lower), qd, z], -1)
    activation = torch.relu
    if config["features"]:
        blocks = zip((DOF, DOF, LATENT), config["features"]["scales"])
        phases = x @ frequencies(blocks, config["features"]["seed"])
        x = torch.cat([phases.cos(), phases.sin()], -1)
        activation = torch.nn.functional.elu
    return config["acceleration_scale"] * mlp(params, "baseline", x, activation)


CENTER, SCALE = torch.tensor([0.6, 0.0, -0.15]).float().double(), 0.2


def encode(params, cloud):
    """PointNet layers over 128 neighborhoods of 16 points, then max pooling (III-D)."""
    centers = cloud[:128]
    distance = ((centers[:, None] - cloud[None]) ** 2).sum(-1)
    neighbors = torch.sort(distance, dim=1, stable=True).indices[:, :16]
    position = (centers - CENTER) / SCALE
    offset = (cloud[neighbors] - centers[:, None]) / 0.02
    local = torch.cat([offset, position[:, None].expand_as(offset)], -1)
    local = mlp(params, "encoder.local", local, torch.relu, True).amax(1)
    pooled = mlp(params, "encoder.global", torch.cat([local, position], -1), torch.relu, True).amax(0)
    return mlp(params, "encoder.readout", pooled, torch.relu)


def chamfer(a, b):
    distance = ((a[:, None] - b[None]) ** 2).sum(-1)
    return distance.min(1).values.mean() + distance.min(0).values.mean()


def gradients(loss, params):
    """Norm and sampled values of the gradient of each parameter; zero for psi's last bias."""
    found = {}
    grads = torch.autograd.grad(
        loss, params.values(), retain_graph=True, allow_unused=True, materialize_grads=True
    )
    for name, g in zip(params, grads):
        g = g.flatten()
        indices = [(7919 * i) % len(g) for i in range(6)]
        found[name] = {"norm": g.norm().item(), "at": indices, "values": g[indices].tolist()}
    return found


def main():
    config = {
        "hidden": HIDDEN,
        "frequency_seed": 2309,
        "position_scale": 1.0,
        "velocity_scale": 3.0,
        "latent_scale": 8.0,
        "potential_scale": 100.0,
        "base_stiffness": 450.0,
        "potential_center": hashed("rest", DOF).tolist(),
    }
    outputs = {
        "geometry_metric": TRIANGLE,
        "geometry": DOF,
        "driving_metric": TRIANGLE,
        "potential": 1,
        "damping": 1,
    }
    params = {}
    for name, size in outputs.items():
        params |= layers(name, [2 * FREQUENCIES, HIDDEN, HIDDEN, HIDDEN, size])
    batch = 4
    q = torch.tensor(hashed("q", batch * DOF).reshape(batch, DOF))
    qd = torch.tensor(hashed("qd", batch * DOF).reshape(batch, DOF))
    qd[0] = 0
    z = torch.tensor(2 * hashed("z", batch * LATENT).reshape(batch, LATENT))
    qdd, psi, slope, entries = ngf(params, config, q, qd, z)
    weights = torch.tensor(hashed("weights", batch * DOF).reshape(batch, DOF))
    policy = {
        "config": config,
        "qdd": qdd.tolist(),
        "potential": psi.tolist(),
        "slope": slope.tolist(),
        "gradients": gradients((qdd * weights).sum(), params),
    }

    settings = {"position": 225.0, "velocity": 30.0, "fingertip_weight": 3.0, "metric_weight": 10.0}
    target = torch.tensor(hashed("target", batch * DOF).reshape(batch, DOF))
    loss = imitation(qdd, q, qd, target, settings)
    total = loss + settings["metric_weight"] * (entries**2).mean()
    training = {"settings": settings, "loss": loss.item(), "gradients": gradients(total, params)}

    features = {"seed": 2309, "scales": [2.0, 3.0, 16.0]}
    baselines = []
    for hidden, features in (([64, 256], None), ([48, 40, 56], features)):
        config = {"hidden": hidden, "features": features, "acceleration_scale": 30.0}
        inputs = 2 * FREQUENCIES if features else 2 * DOF + LATENT
        params = layers("baseline", [inputs, *hidden, DOF])
        qdd = baseline(params, config, q, qd, z)
        baselines.append({
            "config": config,
            "qdd": qdd.tolist(),
            "gradients": gradients((qdd * weights).sum(), params),
        })

    params = layers("encoder.local", [6, 32, 64]) | layers("encoder.global", [67, 64, 256])
    params |= layers("encoder.readout", [256, 128, LATENT])
    params |= layers("decoder", [LATENT, 256, 256, 3 * 512])
    # Multiples of 1/4096 m about the center: squared differences are exact in float32.
    cloud = torch.tensor(hashed("cloud", 3 * 512).reshape(512, 3) / 8)
    cloud = cloud + torch.tensor([0.625, 0.0, -0.125])
    latent = encode(params, cloud)
    decoded = mlp(params, "decoder", latent, torch.relu).reshape(512, 3)
    loss = chamfer(decoded, (cloud - CENTER) / SCALE)
    encoder = {
        "z": latent.tolist(),
        "decoded": decoded.flatten()[:: 7 * 3].tolist(),
        "chamfer": loss.item(),
        "gradients": gradients(loss, params),
    }
    golden = {"torch": torch.__version__, "policy": policy, "training": training}
    golden |= {"baselines": baselines, "encoder": encoder}
    (HERE / "networks.json").write_text(json.dumps(golden, indent=1) + "\n")


if __name__ == "__main__":
    main()
