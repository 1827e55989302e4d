"""The target and the loss: small pure functions on tensors."""

import math
from typing import get_args

import torch
from torch import Tensor, nn

from trdlab import bellman
from trdlab.deep.update_settings import Loss, Reduction
from trdlab.errors import InputError, TrdlabError


def greedy_actions(components: Tensor) -> Tensor:
    """Returns `[B]`, the actions of largest Σ components, of tied ones the first.

    >>> greedy_actions(torch.tensor([[[1.0, 0.0], [0.0, 3.0], [2.0, 0.0]]])).tolist()
    [1]
    """
    return components.sum(dim=-1).argmax(dim=-1)  # [B, A, N+1] -> [B, A] -> [B]


def acted(logits: Tensor, *, draw: bool) -> Tensor:
    """Returns `[B, A]`, how likely a policy head takes each action.

    Args:
        logits: `[B, A]`.
        draw: whether it draws its actions, rather than taking the likeliest.

    >>> acted(torch.tensor([[0.0, 2.0]]), draw=False).tolist()
    [[0.0, 1.0]]
    """
    if draw:
        return logits.softmax(dim=1)
    return nn.functional.one_hot(logits.argmax(dim=1), logits.shape[1]).to(logits.dtype)


def trd_target(
    reward: Tensor,
    discount: Tensor,
    next_components: Tensor,
    *,
    selected_by: Tensor | None = None,
    policy: Tensor | None = None,
) -> Tensor:
    """Returns the target components `[B, N+1]`, without gradients.

    Args:
        reward: `[B]`, the discounted reward of the next w steps.
        discount: `[B]`, γ^w where the episode goes on, 0 where it terminated.
        next_components: `[B, A, N+1]` at s_(t+w), of the target network.
        selected_by: `[B, A, N+1]` at s_(t+w), whose sums choose the next action: those of the
            online network for double DQN (van Hasselt et al., 2016), by default `next_components`.
        policy: `[B, A]` at s_(t+w), how likely each action is taken there, where the future of a
            given policy is learned: then nothing is maximised.

    Raises:
        InputError: the shapes do not fit.

    Source: the paper's Eq. trd-loss (errata P1, P2, P4); `trdlab.bellman.target`.

    >>> following = torch.tensor([[[2.0, 4.0, 6.0], [1.0, 1.0, 1.0]]])
    >>> trd_target(torch.tensor([1.0]), torch.tensor([0.5]), following)
    tensor([[1., 1., 5.]])
    """
    chooser = next_components if selected_by is None else selected_by
    if next_components.ndim != 3 or chooser.shape != next_components.shape:
        raise InputError(
            f"next_components has shape {tuple(next_components.shape)}, what selects the next "
            f"action {tuple(chooser.shape)}.",
            "Give [B, A, N+1] for both.",
        )
    with torch.no_grad():
        if policy is None:
            chosen = of_actions(next_components, greedy_actions(chooser))  # [B, N+1]
        else:
            chosen = torch.einsum("ba,ban->bn", policy, next_components)  # [B, N+1]
        target: Tensor = bellman.target(reward, discount, chosen)  # [B, N+1]
    return target


def td_loss(
    components: Tensor,
    actions: Tensor,
    target: Tensor,
    reduction: Reduction = "sum",
    loss: Loss = "squared",
) -> Tensor:
    """Returns the error of the components, averaged over the batch; a scalar.

    With s the squared errors of a sample's components, summed or averaged, it is s itself, or
    Huber's 2√s − 1 where s is above 1.

    Summed over components, the loss of N = 0 is that of plain DQN, and each component pulls as
    hard as it, whatever N. The paper takes the mean over components: its loss shrinks by 1/(N+1)
    against any other loss beside it (errata C5). Alone under Adam the two hardly differ.

    A squared error is least at the mean, and a component is one. Huber's is least somewhere between
    mean and median, so amounts that come seldom are told too small; in return a few surprises do
    not drown the rest of a batch. It is taken of the length of a sample's vector of errors, not
    of each component: most rewards come at one step of many, so the median of each component is 0,
    and all of them would be told as nothing. For N = 0 it is the loss that DQN clips its errors by.

    Args:
        components: `[B, A, N+1]` of the network that learns.
        actions: `[B]`, whole numbers, what was done.
        target: `[B, N+1]`, taken as given: no gradient flows into it.
        reduction: over components, `sum`, or `mean` as in the paper.
        loss: `squared`, as in the paper, or `huber`.

    Raises:
        InputError: the shapes do not fit, the actions are no whole numbers, or there is no such
            reduction or loss.

    Source: the paper's Eq. trd-loss; Huber (1964), as in Mnih et al. (2015).

    >>> online = torch.tensor([[[1.0, 1.0], [0.0, 0.0]]])
    >>> td_loss(online, torch.tensor([0]), torch.tensor([[4.0, 5.0]]))
    tensor(25.)
    >>> td_loss(online, torch.tensor([0]), torch.tensor([[4.0, 5.0]]), loss="huber")
    tensor(9.)
    """
    chosen = of_actions(components, actions)  # [B, N+1]
    if target.shape != chosen.shape:
        raise InputError(
            f"The target has shape {tuple(target.shape)}, the components of the actions taken "
            f"{tuple(chosen.shape)}.",
            "Give [B, N+1].",
        )
    for name, value, known in (
        ("reduction", reduction, get_args(Reduction)),
        ("loss", loss, get_args(Loss)),
    ):
        if value not in known:
            raise InputError(f"The {name} is {value!r}.", f"Use {' or '.join(map(repr, known))}.")
    squared = (chosen - target.detach()).square()  # [B, N+1]
    errors = squared.sum(dim=1) if reduction == "sum" else squared.mean(dim=1)  # [B]
    if loss == "huber":
        errors = torch.where(errors > 1.0, 2.0 * errors.clamp(min=1.0).sqrt() - 1.0, errors)  # [B]
    return errors.mean()


def distillation_loss(logits: Tensor, taught: Tensor) -> Tensor:
    """Returns KL(teacher ‖ student), averaged over the batch; a scalar.

    Args:
        logits: `[B, A]` of the student, divided by the temperature.
        taught: `[B, A]`, the teacher's probabilities, likewise.

    Source: the paper's Eq. qdagger, with the sign of errata P5; Hinton et al. (2015).

    >>> even = torch.tensor([[0.0, 0.0]])
    >>> distillation_loss(even, torch.tensor([[0.5, 0.5]]))
    tensor(0.)
    >>> distillation_loss(even, torch.tensor([[1.0, 0.0]]))  # ln 2
    tensor(0.6931)
    """
    told = nn.functional.log_softmax(logits, dim=1)  # [B, A]
    return nn.functional.kl_div(told, taught, reduction="batchmean")


def of_actions(components: Tensor, actions: Tensor) -> Tensor:
    """Returns `[B, N+1]`: of components `[B, A, N+1]`, those of the actions `[B]`.

    Raises:
        InputError: the shapes do not fit, or the actions are no whole numbers.
    """
    if actions.is_floating_point() or actions.is_complex() or actions.dtype == torch.bool:
        raise InputError(
            f"The actions have type {str(actions.dtype).removeprefix('torch.')}.",
            "Give whole numbers.",
        )
    if components.ndim != 3 or actions.shape != components.shape[:1]:
        raise InputError(
            f"The components have shape {tuple(components.shape)}, the actions "
            f"{tuple(actions.shape)}.",
            "Give [B, A, N+1] and [B].",
        )
    rows = torch.arange(len(actions), device=actions.device)  # [B]
    return components[rows, actions.long()]  # [B, N+1]


def finite_loss(loss: Tensor, update: int) -> float:
    """Returns a loss as a number, so that it can be looked at before it is learned from.

    Args:
        loss: a scalar.
        update: the number of the update, for the message.

    Raises:
        TrdlabError: it is not finite.
    """
    number = loss.item()
    if not math.isfinite(number):
        raise TrdlabError(
            f"The loss is {number} at update {update}.",
            "Nothing was learned from it. See that rewards and observations are finite, or begin "
            "again with a lower learning rate.",
        )
    return number
