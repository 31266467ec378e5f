"""The maximum-margin problem as a convex program over coordinates of the reward, and its optimality certificate.

Let the reward, relative to the target's, be r = Bc with coordinates c. The program is

    maximise   Σ_s p(t_s) − ½ cᵀPc − λ₁ Σ_s |r(s)|
    subject to t_k(i) ≤ (Mc)_i  for every margin row i,    lower ≤ Bc ≤ upper,

where k(i) is the margin that row i belongs to. If the features can express every reward, c is r itself: B is the
identity, M stays sparse, and the bounds are a box. Otherwise B is a thin basis of the rewards that can be expressed.

**Certificate.** Take any y ≥ 0 whose entries sum to 1 over the rows of each margin, any π, and any point c̄. By weak
duality, no feasible c has an objective larger than

    Σ_s max {π_s r − λ₁|r| : lower_s ≤ r ≤ upper_s} + ½ c̄ᵀPc̄ + ‖e‖ max‖c‖,    e = Mᵀy − Bᵀπ − Pc̄.

This holds for y, π and c̄ from any solver, however inaccurate, so the reported gap does not rely on the solver.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64
from scipy.sparse import csr_array

from relm_irl_jax.irl.feature_factorisation import FactorisedFeatures
from relm_irl_jax.irl.margins import MarginRows, smallest_by_margin
from relm_irl_jax.irl.settings import MaxMarginSettings


@dataclass(frozen=True)
class DualVariables:
    """Lagrange multipliers of the constraints, as a solver proposes them.

    Attributes:
        margins: y, one for each of `ConvexProgram.rows_with_penalty`.
        rewards: π, the derivative of Σ p(t) with respect to the reward of each state.
    """

    margins: Float64[np.ndarray, "rows"]
    rewards: Float64[np.ndarray, "states"]


@dataclass(frozen=True)
class ConvexProgram:
    """The program of the module's docstring.

    Attributes:
        basis: B, or None for the identity.
        lower: lower bound of each state's reward.
        upper: upper bound of each state's reward.
        rows: M; sparse if B is the identity.
        margin_index: k(i), ascending.
        quadratic: P, or None for zero.
        l1_weight: λ₁.
        penalty: factor of p on negative margins.
    """

    basis: Float64[np.ndarray, "states rank"] | None
    lower: Float64[np.ndarray, "states"]
    upper: Float64[np.ndarray, "states"]
    rows: csr_array | Float64[np.ndarray, "rows rank"]
    margin_index: Int64[np.ndarray, "rows"]
    quadratic: Float64[np.ndarray, "rank rank"] | None
    l1_weight: float
    penalty: float

    @property
    def n_margins(self) -> int:
        """Number of margins t."""
        return int(self.margin_index[-1]) + 1

    @property
    def rank(self) -> int:
        """Number of coordinates c."""
        return len(self.lower) if self.basis is None else self.basis.shape[1]

    def reward(self, point: Float64[np.ndarray, "rank"]) -> Float64[np.ndarray, "states"]:
        """The reward Bc at a point c."""
        return point if self.basis is None else self.basis @ point

    def margin(self, point: Float64[np.ndarray, "rank"]) -> Float64[np.ndarray, "margins"]:
        """The margins at a point c."""
        return smallest_by_margin(self.rows @ point, self.margin_index, self.n_margins)

    def margin_sum(self, margin: Float64[np.ndarray, "margins"]) -> float:
        """Σ p(margin), the objective of the linear program (Eq. 8)."""
        return float(np.minimum(margin, self.penalty * margin).sum())

    def objective(self, point: Float64[np.ndarray, "rank"]) -> float:
        """The objective at a point c."""
        l1_term = self.l1_weight * float(np.abs(self.reward(point)).sum())
        return self.margin_sum(self.margin(point)) - self.quadratic_term(point) - l1_term

    def bound_violation(self, point: Float64[np.ndarray, "rank"]) -> float:
        """Largest violation of the reward's bounds at a point c, divided by the largest bound."""
        reward = self.reward(point)
        outside = max(np.max(reward - self.upper), np.max(self.lower - reward), 0.0)
        return float(outside / np.abs([self.lower, self.upper]).max())

    def quadratic_term(self, point: Float64[np.ndarray, "rank"]) -> float:
        """½ cᵀPc at a point c."""
        return 0.0 if self.quadratic is None else 0.5 * float(point @ self.quadratic @ point)

    def rows_with_penalty(self) -> tuple[csr_array | Float64[np.ndarray, "rows rank"], Int64[np.ndarray, "rows"]]:
        """Rows that state t ≤ p(Mc) by t ≤ Mc and t ≤ penalty·Mc, and the margin of each, ascending."""
        if self.penalty == 1.0:
            return self.rows, self.margin_index
        twice = np.repeat(np.arange(len(self.margin_index)), 2)
        factor = np.tile([1.0, self.penalty], len(self.margin_index))[:, None]
        scaled = self.rows[twice] * factor
        return scaled if isinstance(scaled, np.ndarray) else csr_array(scaled), self.margin_index[twice]

    def dual_bound(self, point: Float64[np.ndarray, "rank"], duals: DualVariables) -> float:
        """Upper bound on the objective of every feasible point, the certificate of the module's docstring.

        Args:
            point: c̄.
            duals: y and π. Any are valid; the solver's make the bound tight.

        Returns:
            The bound.
        """
        rows, margin_index = self.rows_with_penalty()
        y = np.maximum(duals.margins, np.finfo(np.float64).tiny)
        y /= np.bincount(margin_index, y)[margin_index]
        gradient = rows.T @ y
        if self.quadratic is not None:
            gradient = gradient - self.quadratic @ point
        reward_duals, error = gradient, 0.0
        if self.basis is not None:
            reward_duals = duals.rewards
            # ‖c‖ ≤ ‖r‖: the basis is orthonormal; in the cost form up to a constant, which only lengthens r.
            longest = float(np.abs([self.lower, self.upper]).max()) * np.sqrt(len(self.lower))
            error = float(np.linalg.norm(gradient - self.basis.T @ reward_duals)) * longest
        # A concave function with its kink at 0 has its maximum over an interval that contains 0 at 0 or at an end.
        at_bounds = [reward_duals * end - self.l1_weight * np.abs(end) for end in (self.lower, self.upper)]
        return float(np.maximum(np.maximum(*at_bounds), 0.0).sum()) + self.quadratic_term(point) + error


def convex_program(
    rows: MarginRows, features: FactorisedFeatures, target: int, settings: MaxMarginSettings, weight: float
) -> ConvexProgram:
    """Formulate the program of one problem.

    Args:
        rows: the rows of the problem's margins.
        features: the scene's features, factorised for the settings' form.
        target: the target's state.
        settings: form, variant, r_max and penalty.
        weight: λ of the settings' variant.

    Returns:
        The program. In the cost form it leaves out the target, whose reward is 0.
    """
    cost = settings.form == "cost"
    n_states = len(features.left_vectors)
    kept = np.delete(np.arange(n_states), target) if cost else np.arange(n_states)
    # The rows apply to r(s) − r(g); r(g) is 0 in the cost form, and a variable like any other in the free form.
    coefficients = rows.coefficients
    if not cost:
        at_target = csr_array(-coefficients.sum(axis=1)[:, None])
        unit = csr_array(([1.0], ([0], [target])), shape=(1, n_states))
        coefficients = csr_array(coefficients + at_target @ unit)
    if features.full_rank:
        basis, rows_of_point = None, csr_array(coefficients[:, kept])
        squared_norm = features.norm_matrix[np.ix_(kept, kept)] if settings.variant == "lp-l2" else None
    else:
        left = features.left_vectors - features.left_vectors[target] if cost else features.left_vectors
        basis, rows_of_point = left[kept], coefficients @ left
        squared_norm = np.diag(features.singular_values**-2) if settings.variant == "lp-l2" else None
    return ConvexProgram(
        basis=basis,
        lower=np.full(len(kept), -settings.r_max),
        upper=np.full(len(kept), 0.0 if cost else settings.r_max),
        rows=rows_of_point,
        margin_index=rows.margin_index,
        quadratic=None if squared_norm is None else weight * squared_norm,
        l1_weight=weight if settings.variant == "lp-l1" else 0.0,
        penalty=settings.penalty,
    )
