"""Settings of all methods of inverse reinforcement learning; importing them loads neither JAX nor a solver."""

from typing import Literal

from pydantic.dataclasses import dataclass as settings_dataclass

from relm_irl_jax.bounds import PositiveFloat
from relm_irl_jax.irl.problem import MaxMarginSettings

Method = Literal["max-margin", "apprenticeship", "max-margin-planning", "max-entropy"]


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
