"""Projections that PyTorch differentiates by the pose."""
import numpy as np

try:
    import torch
except ImportError as error:
    raise ImportError("xraycast.torch needs PyTorch: pip install torch") from error


class _Project(torch.autograd.Function):
    @staticmethod
    def forward(context, rt, scan, k, size, opacity, needs):
        poses = rt.detach().cpu().double().numpy()
        frames = scan.project(K=k, RT=poses, size=size, opacity=opacity, gradient=needs)
        if needs:
            context.save_for_backward(rt, torch.from_numpy(np.asarray(frames.gradient)))
            context.centre = scan.centre_mm
        return torch.from_numpy(np.asarray(frames)).to(rt.device)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(context, by_tau):
        rt, by_pose = context.saved_tensors
        motion = torch.einsum("...ij,...ijn->...n", by_tau.cpu().double(), by_pose.double())
        return by_matrix(rt, motion, context.centre), None, None, None, None, None


def by_matrix(rt, motion, centre):
    """From derivatives by the motion of source and detector (translation, rotation about `centre`) to those by RT.

    A motion (t, w) changes R by -R [w]x and T by R (w x c - t). Of all matrices with these products, that one is
    returned that is orthogonal to what is no motion.
    """
    rotation = rt[..., :3, :3].detach().cpu().double()
    t, w = motion[..., :3], motion[..., 3:]
    turn = w + torch.linalg.cross(torch.tensor(centre, dtype=torch.double).expand_as(t), t)
    x, y, z = turn.unbind(-1)
    zero = torch.zeros_like(x)
    cross = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).reshape(*turn.shape[:-1], 3, 3)
    gradient = torch.zeros_like(rt, device="cpu", dtype=torch.double)
    gradient[..., :3, :3] = -0.5 * rotation @ cross
    gradient[..., :3, 3] = -(rotation @ t[..., None])[..., 0]
    return gradient.to(rt)


def project(scan, K, RT, size, opacity="paper"):
    """Optical depths of a Scan as a tensor, (rows, columns) float32, or (poses, rows, columns) where RT is a batch.

    RT: (3, 4) or (4, 4), or a batch of them, from LPS mm to the camera's mm. Gradients along rigid motions flow back to it,
    computed on the CPU; there are no second derivatives. RT must stay a rigid motion: optimise the parameters from which it
    is computed, not its entries. K, size and opacity: as in Scan.project; no gradients.
    """
    needs = RT.requires_grad and torch.is_grad_enabled()
    return _Project.apply(RT, scan, np.asarray(K, dtype=np.float64), size, opacity, needs)
