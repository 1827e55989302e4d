"""What saliency of all components costs, against that of one, and against a loop over captum.

On the Breakout agent that comes with trdlab, at one observation of its own play. Rounds take turns,
and ratios are of the same round: machines drift, ratios hold. One thread.

    python benchmarks/saliency.py
"""

import statistics
import time
from collections.abc import Callable
from functools import partial

import numpy as np
import torch
from captum.attr import LayerGradCam
from torch import Tensor, nn

import trdlab
from trdlab.deep.estimator import NetworkEstimator
from trdlab.estimator import MAP_METHODS

ROUNDS, STEP = 25, 200
MOST = 8.0


def one_component(estimator: NetworkEstimator, seen: np.ndarray, action: int, layer: int) -> Tensor:
    """Returns component 0's GradCAM in the plain way: all forward, and back to the layer."""
    network, relus = estimator.network, relus_of(estimator.network)
    kept: list[Tensor] = []
    hook = relus[layer].register_forward_hook(lambda _m, _i, made: kept.append(made))
    told = reward_of(estimator, network.preprocess(torch.from_numpy(seen)), action)
    hook.remove()
    (slopes,) = torch.autograd.grad(told[:, 0].sum(), kept[0])
    return (slopes.mean(dim=(2, 3), keepdim=True) * kept[0]).sum(dim=1)


def by_captum(estimator: NetworkEstimator, seen: np.ndarray, action: int, layer: int) -> np.ndarray:
    told = partial(reward_of, estimator, action=action)
    cam = LayerGradCam(told, relus_of(estimator.network)[layer])
    inputs = estimator.network.preprocess(torch.from_numpy(seen))
    count = estimator.time_axis.num_components
    maps = [cam.attribute(inputs, target=k)[0, 0].detach() for k in range(count)]
    return torch.stack(maps).numpy()


def reward_of(estimator: NetworkEstimator, inputs: Tensor, action: int) -> Tensor:
    """Returns the expected reward of an action, `[B, N+1]`."""
    components = estimator.network.components(inputs)  # [B, A·C, N+1]
    weights = torch.tensor([channel.weight for channel in estimator.channels])  # [C]
    by_action = components.reshape(len(inputs), -1, len(weights), components.shape[-1])
    return torch.einsum("bck,c->bk", by_action[:, action], weights)


def relus_of(network: nn.Module) -> list[nn.ReLU]:
    return [module for module in network.modules() if isinstance(module, nn.ReLU)]


def seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def main() -> None:
    torch.set_num_threads(1)
    agent = trdlab.agent("pretrained:Breakout")
    estimator = agent.estimator
    assert isinstance(estimator, NetworkEstimator)
    estimator.network.eval()
    with agent.begin(seed=0) as recording:
        recording.play_to(STEP)
        seen = np.array(recording.playing.stack.observations)  # [1, 4, 84, 84]
    count = estimator.time_axis.num_components
    print(f"maps of {count} components, medians of {ROUNDS} rounds; at most {MOST:g} times one")
    for layer in range(3):
        alone = partial(one_component, estimator, seen, 2, layer)
        loop = partial(by_captum, estimator, seen, 2, layer)
        ours = {
            name: partial(estimator.saliency, seen, [2], layer=layer, method=name)
            for name in MAP_METHODS
        }
        maps = ours["gradcam"]()[0]
        apart = float(np.abs(maps - loop()).max() / np.abs(maps).max())
        works = [alone, loop, *ours.values()]
        for work in works:
            work()
        rounds = [[seconds(work) for work in works] for _ in range(ROUNDS)]
        one, captum, *made = (statistics.median(of) for of in zip(*rounds, strict=True))
        print(f"convolution {layer}: one component {1e3 * one:.2f} ms", end="")
        print(f", loop over captum {1e3 * captum:.1f} ms ({captum / one:.1f} times)")
        for (name, _), own, i in zip(ours.items(), made, range(2, 4), strict=True):
            ratio = statistics.median(of[i] / of[0] for of in rounds)
            print(f"  {name}, all {count}: {1e3 * own:.2f} ms, {ratio:.1f} times one", end="")
            print(f", 1/{statistics.median(of[1] / of[i] for of in rounds):.0f} of captum's")
        print(f"  gradcam and captum differ by at most {apart:.0e} of the largest")


if __name__ == "__main__":
    main()
