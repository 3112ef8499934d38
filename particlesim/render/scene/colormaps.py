"""Colour maps, groups' colours, and the conversion between sRGB and linear light.

viridis, magma, inferno (S. van der Walt, N. Smith, E. Firing), turbo (A. Mikhailov) and coolwarm (K.
Moreland) are given by 33 equally spaced sRGB colours; linear interpolation between them stays within 2/255
of the published 256. steel is this project's own, for signed values on a dark background: light blue, grey, orange, so that
values near zero are dim and both ends are bright. blackbody is computed: Planck's spectrum through the CIE 1931 colour
matching functions in the approximation of C. Wyman, P.-P. Sloan and P. Shirley, JCGT 2(2), 2013.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

_KNOTS = {
    "viridis": "440154470d6048186a482374472d7b4536814240863f49893b528b375a8d33638d"
    "2f6a8e2c728e297a8e26818e23898e21908c1f988b1f9f8821a68528ae8031b57b"
    "3ebc744cc26c5dc9636ece5882d34c96d83fabdc32c0df24d5e21aeae51afde725",
    "magma": "0000040303110a0822130d331d114628115a36106a430f7650127c5d177f691c81"
    "7621818226818f2a819c2e7fa9327db63779c33b75cf4170db486ae65163ee5c5e"
    "f5695cf9785dfb8761fd9668fea571feb47bfec387fed194fde0a2fceeb0fcfdbf",
    "inferno": "0000040403120b0724150b37210c4a2e0a5a3c09654a0c6b57106d63146e70196e"
    "7d1e6d89226a962766a32b61af315cbb3755c63e4dd14644db4f3be35932eb6528"
    "f1711ef67f14f98d0afb9c06fcab0ffbba1ff9ca32f5d949f2e865f3f586fcffa4",
    "turbo": "30123b392a734040a14456c7466be3467ff64293ff37a7fa29bbec1dcdd818dcc3"
    "1ee8b031f2994cf97e6bfd648aff4da3fd3cb8f735cced34dee037edd03af8c03a"
    "fdae35fe982cfb8022f56817ec520fe04009d23105c02302ac1701950d017a0403",
    "coolwarm": "3b4cc0445acc4d68d75775e16282ea6c8ef1779af782a5fb8db0fe98b9ffa3c2fe"
    "aec9fcb8d0f9c2d5f4ccd9eed5dbe6dddddde5d8d1ecd3c5f1ccb9f4c4adf7bba0"
    "f7b194f7a687f49a7bf18d6fec7f63e57058de604dd55042cb3e38c0282fb40426",
    "steel": "19c3ff3aa6f04f8bd05f7a9f6f757c9a7a62cf8044f5822aff5a1f",
}
NAMES = (*_KNOTS, "blackbody")

_GROUPS = "4cc9f0ff9f1cb8e05ef0597bb388ebffd9662ec4b6ff7f50a0b4c8d0a3ff7fd1ae8a6d4f"
PLAIN = (0.30, 0.74, 0.94)
"""sRGB colour of particles that are coloured by nothing."""

STONE = (0.56, 0.55, 0.53)
"""sRGB colour of spheres that particles collide with."""

WATER = (0.25, 0.52, 0.72)
"""sRGB colour of the surface of a fluid."""

CLOTH = ((0.83, 0.78, 0.69), (0.72, 0.33, 0.27), (0.38, 0.51, 0.66), (0.56, 0.58, 0.38))
"""sRGB colours of surfaces that are coloured by nothing: linen, brick, slate and olive."""


def _hex_colors(text: str) -> Array:
    return np.frombuffer(bytes.fromhex(text), np.uint8).reshape(-1, 3) / 255.0


def to_linear(srgb: npt.ArrayLike) -> Array:
    """sRGB components (0 to 1) → linear light, IEC 61966-2-1."""
    s = np.asarray(srgb, float)
    return np.asarray(np.where(s <= 0.04045, s / 12.92, ((s + 0.055) / 1.055) ** 2.4))


def to_srgb(linear: npt.ArrayLike) -> Array:
    """Linear light (0 to 1) → sRGB components."""
    v = np.clip(np.asarray(linear, float), 0.0, 1.0)
    return np.asarray(np.where(v <= 0.0031308, 12.92 * v, 1.055 * v ** (1 / 2.4) - 0.055))


def luminance(srgb: npt.ArrayLike) -> Array:
    """Relative luminance Y of sRGB colours, shape [..., 3] → [...]."""
    return np.asarray(to_linear(srgb) @ np.array([0.2126, 0.7152, 0.0722]))


def colormap(name: str, count: int = 256) -> Array:
    """`count` sRGB colours from the low to the high end, shape [count, 3]. Raises KeyError for an unknown
    name."""
    if name == "blackbody":
        return _blackbody(count)
    knots = _hex_colors(_KNOTS[name])
    x = np.linspace(0, len(knots) - 1, count)
    return np.stack([np.interp(x, np.arange(len(knots)), channel) for channel in knots.T], axis=1)


def group_colors(count: int) -> Array:
    """`count` distinct sRGB colours, shape [count, 3]; they repeat after the twelfth."""
    return np.resize(_hex_colors(_GROUPS), (count, 3))


def _blackbody(count: int) -> Array:
    """The colour of a body heated from 900 K to 6500 K, its luminance rising from a dim glow to white."""
    share = np.linspace(0, 1, count)
    rgb = _planck_rgb(900.0 * (6500.0 / 900.0) ** share)
    rgb = np.clip(rgb, 0.0, None)
    rgb /= rgb.max(axis=1, keepdims=True)
    return to_srgb(rgb * (0.03 + 0.97 * share**1.5)[:, None])


def _planck_rgb(kelvin: Array) -> Array:
    """Linear sRGB of Planck radiation, any scale, shape [n] → [n, 3]."""
    nm = np.arange(380.0, 781.0, 5.0)
    # c₂ = h c / k_B = 1.438777e7 nm K
    radiance = nm**-5.0 / np.expm1(1.438777e7 / (nm * kelvin[:, None]))
    radiance /= radiance.max(axis=1, keepdims=True)
    xyz = radiance @ np.stack([_lobe_x(nm), _lobe_y(nm), _lobe_z(nm)], axis=1)
    to_rgb = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])
    return np.asarray(xyz @ to_rgb.T)


def _lobe(nm: Array, peak: float, below: float, above: float) -> Array:
    return np.exp(-0.5 * ((nm - peak) * np.where(nm < peak, below, above)) ** 2)


def _lobe_x(nm: Array) -> Array:
    return (
        0.362 * _lobe(nm, 442.0, 0.0624, 0.0374)
        + 1.056 * _lobe(nm, 599.8, 0.0264, 0.0323)
        - 0.065 * _lobe(nm, 501.1, 0.0490, 0.0382)
    )


def _lobe_y(nm: Array) -> Array:
    return 0.821 * _lobe(nm, 568.8, 0.0213, 0.0247) + 0.286 * _lobe(nm, 530.9, 0.0613, 0.0322)


def _lobe_z(nm: Array) -> Array:
    return 1.217 * _lobe(nm, 437.0, 0.0845, 0.0278) + 0.681 * _lobe(nm, 459.0, 0.0385, 0.0725)
