"""Time of a PyTorch training step (ms): the NGF with all five networks, and the autoencoder.

Run as `python training_step.py`; prints `row torch_ngf_training_step VALUE ms` and the same for the encoder, each with
the fastest number of threads. Sizes, batches and optimizer match `crates/imitation`. The equations are those of
tests/golden/networks.py in single precision.
"""

import os
import statistics
import time

import torch

DOF, LATENT, FREQUENCIES, HIDDEN, BATCH = 23, 32, 500, 512, 128
TRIANGLE = DOF * (DOF + 1) // 2
CLOUD, CENTERS, NEIGHBORS, CLOUDS = 512, 128, 16, 32
STEPS = 8


def layers(widths):
    found = []
    for inputs, outputs in zip(widths, widths[1:]):
        weight = torch.randn(inputs, outputs) / inputs**0.5
        found += [weight.requires_grad_(), torch.zeros(outputs, requires_grad=True)]
    return found


def mlp(params, x, activation, after_last=False):
    for i in range(0, len(params), 2):
        x = torch.addmm(params[i + 1], x, params[i])
        if i + 2 < len(params) or after_last:
            x = activation(x)
    return x


def positive(x):
    return torch.nn.functional.elu(x) + 1 + 1e-3


ROWS, COLUMNS = torch.tril_indices(DOF, DOF)


def metric(entries):
    u = entries.new_zeros(len(entries), DOF, DOF)
    u[:, ROWS, COLUMNS] = entries
    diagonal = torch.diagonal(u, dim1=-2, dim2=-1)
    u = u - torch.diag_embed(diagonal) + torch.diag_embed(positive(diagonal))
    return u @ u.transpose(-1, -2) + 0.01 * torch.eye(DOF)


class Ngf:
    """Eq. 3 to 5 on a batch."""

    inputs = [2 * DOF + LATENT] * 2 + [DOF + LATENT] * 2 + [2 * DOF + LATENT]
    outputs = [TRIANGLE, DOF, TRIANGLE, 1, 1]

    def __init__(self):
        self.frequencies = [torch.randn(n, FREQUENCIES) / 3 for n in self.inputs]
        self.nets = [layers([2 * FREQUENCIES, HIDDEN, HIDDEN, HIDDEN, n]) for n in self.outputs]
        self.params = [p for net in self.nets for p in net]

    def network(self, i, *inputs):
        phases = torch.cat(inputs, -1) @ self.frequencies[i]
        features = torch.cat([phases.cos(), phases.sin()], -1)
        return mlp(self.nets[i], features, torch.nn.functional.elu)

    def loss(self, q, qd, z):
        q = q.detach().requires_grad_()
        speed2 = (qd**2).sum(-1, keepdim=True)
        unit = qd / torch.sqrt(speed2 + 1e-6)
        u_g, u_f = self.network(0, q, unit, z), self.network(2, q, z)
        metric_g, metric_f = metric(u_g), metric(u_f)
        chi = self.network(1, q, unit, z)
        psi = 100 * self.network(3, q, z).sum() + 225 * (q**2).sum()
        slope = torch.autograd.grad(psi, q, create_graph=True)[0]
        force = slope + positive(self.network(4, q, qd, z)) * qd
        factor = torch.linalg.cholesky(metric_g + metric_f)
        geometry = (metric_g @ (speed2 * chi)[..., None])
        solved = torch.cholesky_solve(torch.cat([geometry, force[..., None]], -1), factor)
        h, drive = -solved[..., 0], solved[..., 1]
        alpha = -(qd * h).sum(-1, keepdim=True) / (speed2 + 1e-6)
        qdd = h + (alpha - 5.0) * qd - drive
        error = torch.sqrt(((qdd - 1) ** 2).sum(-1) + 1e-6).mean()
        return error + 10 * 0.5 * ((u_g**2).mean() + (u_f**2).mean())


class Autoencoder:
    """PointNet layers over neighborhoods, a decoder, and the Chamfer distance."""

    def __init__(self):
        self.local = layers([6, 32, 64])
        self.global_ = layers([67, 64, 256])
        self.readout = layers([256, 128, LATENT])
        self.decoder = layers([LATENT, 256, 256, 3 * CLOUD])
        self.params = self.local + self.global_ + self.readout + self.decoder

    def loss(self, clouds, neighbors):
        count, relu = len(clouds), torch.relu
        centers = clouds[:, :CENTERS]
        points = torch.gather(clouds, 1, neighbors.reshape(count, -1, 1).expand(-1, -1, 3))
        points = points.reshape(count, CENTERS, NEIGHBORS, 3)
        position = (centers - torch.tensor([0.6, 0.0, -0.15])) / 0.2
        local = torch.cat([(points - centers[:, :, None]) / 0.02, position[:, :, None].expand_as(points)], -1)
        local = mlp(self.local, local.reshape(-1, 6), relu, True).reshape(count, CENTERS, NEIGHBORS, -1).amax(2)
        both = torch.cat([local, position], -1).reshape(-1, 67)
        pooled = mlp(self.global_, both, relu, True).reshape(count, CENTERS, -1).amax(1)
        z = mlp(self.readout, pooled, relu)
        decoded = mlp(self.decoder, z, relu).reshape(count, CLOUD, 3)
        target = (clouds - torch.tensor([0.6, 0.0, -0.15])) / 0.2
        distance = torch.cdist(decoded, target) ** 2
        chamfer = distance.amin(2).mean(1) + distance.amin(1).mean(1)
        return chamfer.mean() + 1e-4 * (z**2).mean()


def step_time(network, batch, clip):
    optimizer = torch.optim.AdamW(network.params, lr=1e-4, betas=(0.9, 0.99), weight_decay=1e-4, fused=True)
    times = []
    for _ in range(2 * STEPS):
        start = time.perf_counter()
        optimizer.zero_grad(set_to_none=True)
        network.loss(*batch).backward()
        torch.nn.utils.clip_grad_norm_(network.params, clip)
        optimizer.step()
        times.append(1e3 * (time.perf_counter() - start))
    return statistics.median(times[STEPS:])


def main():
    torch.manual_seed(0)
    ngf = Ngf(), [torch.rand(BATCH, n) - 0.5 for n in (DOF, DOF, LATENT)], 10.0
    clouds = torch.tensor([0.6, 0.0, -0.15]) + 0.2 * (torch.rand(CLOUDS, CLOUD, 3) - 0.5)
    # Computed once, as in the Rust implementation.
    neighbors = torch.cdist(clouds[:, :CENTERS], clouds).topk(NEIGHBORS, largest=False).indices
    encoder = Autoencoder(), [clouds, neighbors], 1.0
    for name, task in (("ngf", ngf), ("encoder", encoder)):
        best = []
        for threads in range(1, (os.cpu_count() or 1) + 1):
            torch.set_num_threads(threads)
            best.append(step_time(*task))
        print(f"row torch_{name}_training_step {min(best):.3f} ms")


if __name__ == "__main__":
    main()
