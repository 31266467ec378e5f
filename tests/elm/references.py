"""Slow, direct versions of what the library computes, written from the formulas alone."""

from itertools import product

import numpy as np


def standardise(matrix):
    """Zero mean, unit norm; constant columns zero."""
    rest = matrix - matrix.mean(axis=0)
    norm = np.linalg.norm(rest, axis=0)
    return rest / np.where(norm > 1e-12, norm, 1)


def correlation(residual, X, norm):
    return np.linalg.norm(residual.T @ X, ord=norm, axis=0)


def projection(X, T):
    return X @ np.linalg.lstsq(X, T, rcond=None)[0]


def mrsr_by_enumeration(H, T):
    """MRSR for the 1-norm, trying all 2^p sign vectors; columns of H must be independent."""
    X, T = standardise(H), standardise(T)
    signs = np.array(list(product((-1, 1), repeat=T.shape[1])))
    Y = np.zeros_like(T)
    order = [int(np.argmax(correlation(T, X, 1)))]
    while len(order) < X.shape[1]:
        target = projection(X[:, order], T)
        c = correlation(T - Y, X[:, order], 1).max()
        rest = np.setdiff1d(np.arange(X.shape[1]), order)
        a, b = signs @ (T - Y).T @ X[:, rest], signs @ (target - Y).T @ X[:, rest]
        with np.errstate(divide="ignore"):
            gamma = (c - a) / (c - b)
        gamma[(gamma <= 0) | (gamma > 1)] = np.inf
        order.append(int(rest[np.argmin(gamma.min(axis=0))]))
        Y = Y + gamma.min() * (target - Y)
    return order


def replay(H, T, path):
    """Fit after every step of a path, from its order and step lengths alone; yields (active columns, T - Y)."""
    X, T = standardise(H), standardise(T)
    Y = np.zeros_like(T)
    for k in range(path.entered):
        active = path.order[: k + 1]
        Y = Y + path.step[k] * (projection(X[:, active], T) - Y)
        yield X, active, T - Y


def leave_out(H, T, ridge=0.0, intercept=False, groups=None):
    """Residuals of refits without one sample or group after the other, each judged on what was left out."""
    groups = np.arange(len(H)) if groups is None else np.asarray(groups)
    errors = np.empty_like(T)
    for group in np.unique(groups):
        out = groups == group
        shift_h = H[~out].mean(axis=0) if intercept else np.zeros(H.shape[1])
        shift_t = T[~out].mean(axis=0) if intercept else np.zeros(T.shape[1])
        stacked = np.vstack([H[~out] - shift_h, np.sqrt(ridge) * np.eye(H.shape[1])])
        targets = np.vstack([T[~out] - shift_t, np.zeros((H.shape[1], T.shape[1]))])
        beta = np.linalg.lstsq(stacked, targets, rcond=None)[0]
        errors[out] = T[out] - shift_t - (H[out] - shift_h) @ beta
    return errors


def curve_by_refits(H, T, ridge=0.0, intercept=False, groups=None):
    """Mean squared error of what was left out, of every prefix."""
    prefixes = range(1, H.shape[1] + 1)
    return np.array([np.mean(leave_out(H[:, :k], T, ridge, intercept, groups) ** 2) for k in prefixes])
