"""PyTorch's gradients by the pose; skipped where PyTorch is not installed."""
import numpy as np
import pytest
import xraycast as xc

torch = pytest.importorskip("torch")
from xraycast.torch import by_matrix, project  # noqa: E402


def hat(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def test_gradients_by_a_matrix_are_those_by_the_motion():
    random = np.random.default_rng(1)
    rotation = np.linalg.qr(random.normal(size=(3, 3)))[0]
    centre, t, w, by_t, by_w = random.normal(size=(5, 3))
    rt = torch.tensor(np.column_stack([rotation, random.normal(size=3)]))
    gradient = by_matrix(rt, torch.tensor(np.concatenate([by_t, by_w])), tuple(centre)).numpy()
    # RT changes by this when source and detector move by (t, w); double precision.
    change = rotation @ np.column_stack([-hat(w), np.cross(w, centre) - t])
    assert (gradient * change).sum() == pytest.approx(by_t @ t + by_w @ w, rel=1e-12)


def test_a_loss_falls_along_its_gradient(body):
    frame = body.project(20, 5, (48, 36), (1000, 1500))
    target = torch.from_numpy(np.asarray(frame))
    rt = torch.tensor(frame.RT)
    start = rt.clone()
    start[2, 3] += 10
    start.requires_grad_()
    loss = ((project(body, frame.K, start, (48, 36)) - target) ** 2).sum()
    loss.backward()
    assert start.grad.shape == (3, 4) and start.grad[2, 3] > 0
    step = torch.zeros(3, 4, dtype=torch.double)
    step[:, 3] = start.grad[:, 3] / start.grad[:, 3].norm() * 0.1
    after = ((project(body, frame.K, (start - step).detach(), (48, 36)) - target) ** 2).sum()
    # The first order of Taylor's series; its second is some per cent of it here.
    assert (loss - after).item() == pytest.approx(0.1 * start.grad[:, 3].norm().item(), rel=0.05)


def test_there_are_no_second_derivatives(body):
    frame = body.project(20, 5, (24, 18), (1000, 1500))
    rt = torch.tensor(frame.RT).requires_grad_()
    first, = torch.autograd.grad((project(body, frame.K, rt, (24, 18)) ** 2).sum(), rt, create_graph=True)
    with pytest.raises(RuntimeError, match="once_differentiable"):
        first.sum().backward()


def test_batches_have_gradients_each(body):
    frames = body.project([0, 20], 5, (24, 18), (1000, 1500), pixel_mm=16)
    poses = torch.tensor(np.stack([f.RT for f in frames])).requires_grad_()
    tau = project(body, frames[0].K, poses, (24, 18))
    assert tau.shape == (2, 18, 24)
    tau[1].sum().backward()
    assert (poses.grad[0] == 0).all() and (poses.grad[1] != 0).any()
    with torch.no_grad():
        plain = project(body, frames[0].K, poses, (24, 18))
    # The same sums of some hundred 32-bit numbers, in another order.
    assert torch.allclose(plain, tau, rtol=2e-5) and not plain.requires_grad
    with pytest.raises(xc.InputError, match="RT"):
        project(body, frames[0].K, torch.eye(3), (24, 18))
