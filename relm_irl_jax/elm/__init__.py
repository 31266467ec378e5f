"""The regularised extreme learning machine: random hidden layer, MRSR ordering, PRESS selection."""

from relm_irl_jax.elm.hidden_layer import HiddenLayer
from relm_irl_jax.elm.mrsr import MRSRPath, mrsr, mrsr_path
from relm_irl_jax.elm.press import PressPath, press_curve, press_path
from relm_irl_jax.elm.regressor import Diagnostics, ELMRegressor
from relm_irl_jax.elm.storage import load_elm, save_elm

__all__ = [
    "Diagnostics",
    "ELMRegressor",
    "HiddenLayer",
    "MRSRPath",
    "PressPath",
    "load_elm",
    "mrsr",
    "mrsr_path",
    "press_curve",
    "press_path",
    "save_elm",
]
