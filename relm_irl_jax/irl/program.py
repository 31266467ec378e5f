"""The maximum-margin problem as a concave program over coordinates of the reward, and its certificate.

With r = Bc, the reward relative to the target's is a linear map of c as well, and the program is

    maximise   Σ_s p(t_s) − ½ cᵀPc − λ₁ Σ_s |r(s)|
    subject to t_owner(i) ≤ (Mc)_i  for every margin row i,    lower ≤ Bc ≤ upper.

Where the features can express every reward, c is r itself: B is the identity, the rows of M stay as sparse as
the walks they sum, and the bounds are a box. Otherwise B is a thin basis of the rewards that can be
expressed.

**Certificate.** Take any y ≥ 0 for the rows, summing to 1 over each state's, any prices π of the rewards and
any point c̄. By weak duality no feasible c has a larger objective than

    Σ_s max {π_s r − λ₁|r| : lower_s ≤ r ≤ upper_s} + ½ c̄ᵀPc̄ + ‖e‖ max‖c‖,    e = Mᵀy − Bᵀπ − Pc̄.

This holds whatever solver, however inaccurate, proposed y, π and c̄, so the reported gap does not rest on
trust. This module knows neither features nor JAX, so that solver processes start fast.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64
from scipy.sparse import csr_array

from relm_irl_jax.irl.coordinates import Coordinates
from relm_irl_jax.irl.problem import MarginRows, MaxMarginSettings


@dataclass(frozen=True)
class Multipliers:
    """Prices of the constraints, as a solver proposes them.

    Attributes:
        margins: y, one for each of `Program.stacked_rows`.
        rewards: π, what one more unit of a state's reward is worth to the margins.
    """

    margins: Float64[np.ndarray, "rows"]
    rewards: Float64[np.ndarray, "states"]


@dataclass(frozen=True)
class Program:
    """The program of the module's docstring as data.

    Attributes:
        basis: B, or None for the identity.
        lower: least reward of each state.
        upper: greatest reward of each state.
        rows: M, sparse where B is the identity.
        owner: position of each row's state among the margins.
        quadratic: P, or None for zero.
        absolute: λ₁.
        penalty: factor of p on negative margins.
    """

    basis: Float64[np.ndarray, "states rank"] | None
    lower: Float64[np.ndarray, "states"]
    upper: Float64[np.ndarray, "states"]
    rows: csr_array | Float64[np.ndarray, "rows rank"]
    owner: Int64[np.ndarray, "rows"]
    quadratic: Float64[np.ndarray, "rank rank"] | None
    absolute: float
    penalty: float

    @property
    def n_margins(self) -> int:
        """Number of states with a margin."""
        return int(self.owner[-1]) + 1

    @property
    def rank(self) -> int:
        """Number of coordinates."""
        return len(self.lower) if self.basis is None else self.basis.shape[1]

    def reward(self, point: Float64[np.ndarray, "rank"]) -> Float64[np.ndarray, "states"]:
        """The reward Bc."""
        return point if self.basis is None else self.basis @ point

    def margin(self, point: Float64[np.ndarray, "rank"]) -> Float64[np.ndarray, "margins"]:
        """The margin of each state at c."""
        margin = np.full(self.n_margins, np.inf)
        np.minimum.at(margin, self.owner, self.rows @ point)
        return margin

    def margin_sum(self, margin: Float64[np.ndarray, "margins"]) -> float:
        """Σ p(margin), the pure program's objective."""
        return float(np.minimum(margin, self.penalty * margin).sum())

    def objective(self, point: Float64[np.ndarray, "rank"]) -> float:
        """The objective at c."""
        absolute = self.absolute * float(np.abs(self.reward(point)).sum())
        return self.margin_sum(self.margin(point)) - self.curvature(point) - absolute

    def excess(self, point: Float64[np.ndarray, "rank"]) -> float:
        """How far the reward at c is out of bounds, relative to their distance from 0."""
        reward = self.reward(point)
        outside = max(np.max(reward - self.upper), np.max(self.lower - reward), 0.0)
        return float(outside / np.abs([self.lower, self.upper]).max())

    def curvature(self, point: Float64[np.ndarray, "rank"]) -> float:
        """½ cᵀPc."""
        return 0.0 if self.quadratic is None else 0.5 * float(point @ self.quadratic @ point)

    def stacked_rows(self) -> tuple[csr_array | Float64[np.ndarray, "rows rank"], Int64[np.ndarray, "rows"]]:
        """The rows with p written out, t ≤ Mc and t ≤ penalty·Mc, and their owners, ascending."""
        if self.penalty == 1.0:
            return self.rows, self.owner
        twice = np.repeat(np.arange(len(self.owner)), 2)
        factor = np.tile([1.0, self.penalty], len(self.owner))[:, None]
        return self.rows[twice] * factor, self.owner[twice]

    def bound(self, point: Float64[np.ndarray, "rank"], multipliers: Multipliers) -> float:
        """An upper bound on the objective of every feasible point, see the module's docstring.

        Args:
            point: c̄.
            multipliers: y and π; any will do, the solver's make it tight.

        Returns:
            The bound.
        """
        rows, owner = self.stacked_rows()
        y = np.maximum(multipliers.margins, np.finfo(np.float64).tiny)
        y /= np.bincount(owner, y)[owner]
        slope = rows.T @ y
        if self.quadratic is not None:
            slope = slope - self.quadratic @ point
        prices, error = slope, 0.0
        if self.basis is not None:
            prices = multipliers.rewards
            # ‖c‖ ≤ ‖r‖: the basis is orthonormal, in the cost form up to a constant that only adds to r.
            longest = float(np.abs([self.lower, self.upper]).max()) * np.sqrt(len(self.lower))
            error = float(np.linalg.norm(slope - self.basis.T @ prices)) * longest
        # The maximum over an interval that contains 0 of a concave function with a kink there is at 0 or an
        # end.
        worth = [prices * end - self.absolute * np.abs(end) for end in (self.lower, self.upper)]
        return float(np.maximum(np.maximum(*worth), 0.0).sum()) + self.curvature(point) + error


def state_program(
    rows: MarginRows, coordinates: Coordinates, target: int, settings: MaxMarginSettings, weight: float
) -> Program:
    """State the program of one problem.

    Args:
        rows: the problem's margins.
        coordinates: the scene's factorisation for the settings' form.
        target: the target's state.
        settings: form, variant, bound and penalty.
        weight: λ of the settings' variant.

    Returns:
        The program. In the cost form the target's own reward, which is 0, is left out of it.
    """
    cost = settings.form == "cost"
    n_states = len(coordinates.left)
    kept = np.delete(np.arange(n_states), target) if cost else np.arange(n_states)
    # The rows act on r(s) − r(g); r(g) is 0 in the cost form, and a variable like any other in the free form.
    weights = rows.weights
    if not cost:
        at_target = csr_array(-weights.sum(axis=1)[:, None])
        unit = csr_array(([1.0], ([0], [target])), shape=(1, n_states))
        weights = csr_array(weights + at_target @ unit)
    if coordinates.full:
        basis, rows_of_point = None, csr_array(weights[:, kept])
        least_norm = coordinates.penalty[np.ix_(kept, kept)] if settings.variant == "lp-l2" else None
    else:
        left = coordinates.left - coordinates.left[target] if cost else coordinates.left
        basis, rows_of_point = left[kept], weights @ left
        least_norm = np.diag(coordinates.singular**-2) if settings.variant == "lp-l2" else None
    return Program(
        basis=basis,
        lower=np.full(len(kept), -settings.r_max),
        upper=np.full(len(kept), 0.0 if cost else settings.r_max),
        rows=rows_of_point,
        owner=rows.owner,
        quadratic=None if least_norm is None else weight * least_norm,
        absolute=weight if settings.variant == "lp-l1" else 0.0,
        penalty=settings.penalty,
    )
