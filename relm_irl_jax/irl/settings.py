"""Settings of all methods of inverse reinforcement learning; importing them loads neither NumPy, JAX nor a solver."""

from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass as settings_dataclass

from relm_irl_jax.bounds import Discount, PositiveFloat

Method = Literal["max-margin", "apprenticeship", "max-margin-planning", "max-entropy"]
Form = Literal["cost", "free"]
Variant = Literal["lp", "lp-l2", "lp-l1"]


@settings_dataclass(frozen=True)
class MaxMarginSettings:
    """Form of the reward, regulariser and constants of a maximum-margin problem."""

    form: Form = "cost"
    """Bounds of the reward: `cost`, −r_max ≤ w·(φ(s) − φ(g)) ≤ 0, or `free`, |w·φ(s)| ≤ r_max (the paper's Eq. 7)."""
    variant: Variant = "lp-l2"
    """Regulariser: none (`lp`, the paper's linear program), ½λ‖w‖² (`lp-l2`, which makes w unique), or λ Σ_s |r(s)|
    (`lp-l1`, Ng and Russell's)."""
    discount: Discount = 0.99
    """Discount factor γ of the feature expectations."""
    regularisation: PositiveFloat = 1e-3
    """λ divided by the number of states in S₀; ignored by `lp`."""
    r_max: PositiveFloat = 1.0
    """Bound of the reward, R_max."""
    penalty: Annotated[PositiveFloat, Field(ge=1.0)] = 1.0
    """Factor on negative margins: p(x) = x for x ≥ 0 and penalty·x for x < 0. Set it to 2 (Ng and Russell) for experts
    that are not optimal; above 1, actions better than the expert's also have margins."""
    compare_with_lp: bool = True
    """Whether to also solve the linear program, for `Solution.share_of_lp`; this doubles the computation."""


@settings_dataclass(frozen=True)
class ApprenticeshipSettings:
    """Variant of apprenticeship learning."""

    variant: Literal["projection", "max-margin"] = "projection"
    """How the next w is chosen."""


@settings_dataclass(frozen=True)
class MaxMarginPlanningSettings:
    """Settings of maximum-margin planning."""

    regularisation: PositiveFloat = 1e-4
    """Weight λ of ½‖w‖²."""


@settings_dataclass(frozen=True)
class MaxEntropySettings:
    """Regulariser of maximum-entropy inverse reinforcement learning."""

    regularisation: PositiveFloat = 1e-4
    """Weight λ of ½‖w‖²; without it, w diverges for a deterministic expert."""


@settings_dataclass(frozen=True)
class IrlMethodSettings:
    """The method of inverse reinforcement learning, and the settings of each method."""

    method: Method = "max-margin"
    """`max-margin` (the paper's), `apprenticeship` (Abbeel and Ng, 2004), `max-margin-planning` (Ratliff et al., 2006)
    or `max-entropy` (Ziebart et al., 2008)."""
    max_margin: MaxMarginSettings = MaxMarginSettings()
    """The maximum-margin method. All methods use its `discount` and `r_max`."""
    apprenticeship: ApprenticeshipSettings = ApprenticeshipSettings()
    """Apprenticeship learning."""
    max_margin_planning: MaxMarginPlanningSettings = MaxMarginPlanningSettings()
    """Maximum-margin planning."""
    max_entropy: MaxEntropySettings = MaxEntropySettings()
    """Maximum-entropy inverse reinforcement learning."""
