"""The compiled inner loop: light from every ground pixel to the lens.

Light is linear and relative to what white open ground sends back; the encoding to bytes comes last.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

DRY, WET, SNOW = 0, 1, 2
TONE_STEPS_PER_UNIT = 4096
TONE_RANGE = 4.0


class Maps(NamedTuple):
    """Ripmaps: texels, level offsets; and the sky panoramas."""

    macro: np.ndarray
    macro_at: np.ndarray
    fine: np.ndarray
    fine_at: np.ndarray
    decal: np.ndarray
    decal_at: np.ndarray
    sharp: np.ndarray
    rough: np.ndarray
    tone: np.ndarray
    lines: np.ndarray  # (n, 5): lateral middle, width, period, painted length, phase [m]
    profile: np.ndarray  # (n, 2): wheel track and oil band 0..1 over the lateral coordinate
    starts: np.ndarray
    surfaces: np.ndarray


class Pixels(NamedTuple):
    """What does not change while one camera drives: shape (H, W) each."""

    x: np.ndarray
    y: np.ndarray
    level_x: np.ndarray  # log2 of the pixel's footprint in metres, dithered
    level_y: np.ndarray
    azimuth: np.ndarray
    elevation: np.ndarray
    shine: np.ndarray  # Fresnel share of a smooth water surface
    distance: np.ndarray  # on the ground [m], -1 above the horizon


class Look(NamedTuple):
    """The scalars of a look that the loop needs."""

    right: float
    left: float
    asphalt_b: float
    asphalt_g: float
    asphalt_r: float
    grain: float
    stains: float
    wheel_band: float
    oil_band: float
    cracks: float
    wet_darkening: float
    film: float
    puddles: float
    cover: float
    snow_b: float
    snow_g: float
    snow_r: float
    dirt: float
    relief: float
    clearing: float
    ice_gloss: float
    wear: float
    paint_b: float
    paint_g: float
    paint_r: float
    verge_b: float
    verge_g: float
    verge_r: float
    verge_grain: float
    verge_snow: float
    sun_b: float
    sun_g: float
    sun_r: float
    fill_b: float
    fill_g: float
    fill_r: float
    haze_b: float
    haze_g: float
    haze_r: float
    visibility: float
    veil: float
    macro_s: float
    macro_t: float
    fine_s: float
    fine_t: float


@njit(inline="always")
def _level(footprint_log2: float, texel_log2: float, levels: int) -> int:
    level = int(np.floor(footprint_log2 - texel_log2 + 0.5))
    return min(max(level, 0), levels - 1)


@njit(inline="always", fastmath=True)
def _sample(texels, offsets, along, across, texel, s, t, i, j):  # noqa: ANN
    """Four channels at (s, t) [m] on level (i, j), bilinear, periodic, 0..1."""
    rows = along >> i
    columns = across >> j
    v = s / (texel * (1 << i)) - 0.5
    u = t / (texel * (1 << j)) - 0.5
    v0 = np.floor(v)
    u0 = np.floor(u)
    fv = np.float32(v - v0)
    fu = np.float32(u - u0)
    r0 = int(v0) & (rows - 1)
    r1 = (r0 + 1) & (rows - 1)
    c0 = int(u0) & (columns - 1)
    c1 = (c0 + 1) & (columns - 1)
    base = offsets[i, j]
    a = base + r0 * columns + c0
    b = base + r0 * columns + c1
    c = base + r1 * columns + c0
    d = base + r1 * columns + c1
    k = np.float32(1.0 / 255.0)
    wb = (1 - fv) * fu * k
    wa = (1 - fv) * (1 - fu) * k
    wc = fv * (1 - fu) * k
    wd = fv * fu * k
    return (
        texels[a, 0] * wa + texels[b, 0] * wb + texels[c, 0] * wc + texels[d, 0] * wd,
        texels[a, 1] * wa + texels[b, 1] * wb + texels[c, 1] * wc + texels[d, 1] * wd,
        texels[a, 2] * wa + texels[b, 2] * wb + texels[c, 2] * wc + texels[d, 2] * wd,
        texels[a, 3] * wa + texels[b, 3] * wb + texels[c, 3] * wc + texels[d, 3] * wd,
    )


@njit(inline="always", fastmath=True)
def _panorama(image, azimuth, elevation, reach, lowest, px):  # noqa: ANN
    """Light from a direction, bilinear, clamped at the rims."""
    rows, columns = image.shape[0], image.shape[1]
    u = min(max((reach - azimuth) / px - 0.5, 0.0), columns - 1.001)
    v = min(max((elevation - lowest) / px - 0.5, 0.0), rows - 1.001)
    c, r = int(u), int(v)
    fu, fv = np.float32(u - c), np.float32(v - r)
    wa, wb, wc, wd = (1 - fv) * (1 - fu), (1 - fv) * fu, fv * (1 - fu), fv * fu
    return (
        image[r, c, 0] * wa + image[r, c + 1, 0] * wb + image[r + 1, c, 0] * wc + image[r + 1, c + 1, 0] * wd,
        image[r, c, 1] * wa + image[r, c + 1, 1] * wb + image[r + 1, c, 1] * wc + image[r + 1, c + 1, 1] * wd,
        image[r, c, 2] * wa + image[r, c + 1, 2] * wb + image[r + 1, c, 2] * wc + image[r + 1, c + 1, 2] * wd,
    )


@njit(inline="always", fastmath=True)
def _step(value, low, high):  # noqa: ANN
    """Smooth step from 0 to 1 between two values."""
    x = min(max((value - low) / (high - low), 0.0), 1.0)
    return x * x * (3.0 - 2.0 * x)


@njit(inline="always", fastmath=True)
def _paint(lines, s, t, foot_s, foot_t):  # noqa: ANN
    """Share of the pixel's footprint that a marking covers."""
    share = np.float32(0.0)
    for k in range(lines.shape[0]):
        off = abs(t - lines[k, 0])
        width = lines[k, 1]
        if off < 0.5 * (width + foot_t):
            wide = min(1.0, (0.5 * (width + foot_t) - off) / foot_t, width / foot_t)
            if lines[k, 2] > 0.0:
                period = lines[k, 2]
                phase = (s - lines[k, 4]) % period
                middle = abs(phase - 0.5 * lines[k, 3])
                middle = min(middle, period - middle)
                run = min(
                    1.0, max(0.0, (0.5 * (lines[k, 3] + foot_s) - middle) / foot_s), lines[k, 3] / foot_s
                )
                if foot_s > period:
                    run = lines[k, 3] / period
                wide *= run
            share = max(share, np.float32(wide))
    return share


@njit(nogil=True, cache=True, fastmath=True)
def shade(  # noqa: PLR
    pixels, maps, look, scales, s0, t0, heading, gains, image, drivable, shadow, surface
):  # noqa: ANN
    """Fills the picture and the label maps; ``scales`` is (reach, lowest, sharp px, rough px) of the panorama [rad]."""
    height, width = pixels.x.shape
    cos_h, sin_h = np.cos(heading), np.sin(heading)
    tone, top = maps.tone, maps.tone.shape[0] - 1
    reach, lowest, sharp_px, rough_px = scales
    half = np.float32(0.5)
    for row in range(height):
        for col in range(width):
            azimuth = pixels.azimuth[row, col] + heading
            elevation = pixels.elevation[row, col]
            x = pixels.x[row, col]
            distance = pixels.distance[row, col]
            if distance < 0.0:  # above the horizon
                b, g, r = _panorama(maps.sharp, azimuth, elevation, reach, lowest, sharp_px)
                b, g, r = b + look.veil, g + look.veil, r + look.veil
                image[row, col, 0] = tone[min(int(b * gains[0]), top)]
                image[row, col, 1] = tone[min(int(g * gains[1]), top)]
                image[row, col, 2] = tone[min(int(r * gains[2]), top)]
                drivable[row, col] = False
                shadow[row, col] = False
                surface[row, col] = -1
                continue
            y = pixels.y[row, col]
            s = s0 + x * cos_h - y * sin_h
            t = t0 + x * sin_h + y * cos_h
            kind = maps.surfaces[0]
            for k in range(1, maps.starts.shape[0]):
                if s >= maps.starts[k]:
                    kind = maps.surfaces[k]
            on_road = look.right <= t <= look.left
            lx, ly = pixels.level_x[row, col], pixels.level_y[row, col]

            m0, m1, m2, m3 = _sample(
                maps.macro, maps.macro_at, 2048, 1024, 0.02, s + look.macro_s, t + look.macro_t,
                _level(lx, -5.644, 9), _level(ly, -5.644, 8),
            )  # fmt: skip
            f0, f1, f2, f3 = _sample(
                maps.fine, maps.fine_at, 1024, 1024, 0.004, s + look.fine_s, t + look.fine_t,
                _level(lx, -7.966, 9), _level(ly, -7.966, 9),
            )  # fmt: skip
            shaded, label, repair, bitumen = np.float32(0.0), np.float32(0.0), half, np.float32(0.0)
            if -15.3 < t < 15.3:
                shaded, label, repair, bitumen = _sample(
                    maps.decal, maps.decal_at, 4096, 512, 0.06, s, t + 15.36,
                    _level(lx, -4.059, 6), _level(ly, -4.059, 6),
                )  # fmt: skip
            m0 -= half
            m1 -= half
            m3 -= half
            f0 -= half
            f1 -= half
            f3 -= half
            gloss = np.float32(0.0)
            still = np.float32(0.0)
            if on_road:
                spot = min(int((t - look.right) * 50.0), maps.profile.shape[0] - 1)
                track, oil = maps.profile[spot, 0], maps.profile[spot, 1]
                value = 1.0 + 1.3 * look.stains * m0 + 0.5 * look.stains * m1
                value += look.wheel_band * track - look.oil_band * oil
                worn = _step(m1 + 0.7 * m3, 0.75 - 1.1 * look.cracks, 0.95 - 1.1 * look.cracks)
                crack = min(1.0, m2 * 1.5) * worn
                value *= (1.0 - 0.75 * crack) * (0.35 + 1.3 * repair)
                rough = 1.0 + 2.6 * look.grain * f0
                b, g, r = look.asphalt_b * value, look.asphalt_g * value, look.asphalt_r * value
                foot_s, foot_t = 2.0**lx, 2.0**ly
                paint = _paint(maps.lines, s, t, foot_s, foot_t)
                if paint > 0.0:
                    paint *= 1.0 - _step(look.wear * 1.5 - 0.55 + 0.9 * m1 + 0.8 * f0, 0.0, 0.5)
                    b += (look.paint_b - b) * paint
                    g += (look.paint_g - g) * paint
                    r += (look.paint_r - r) * paint
                if kind == WET or kind == SNOW:
                    film = look.film + 0.5 * m0 + 0.5 * m3 + 0.35 * m1 - 0.2 * track + 0.15 * oil
                    still = _step(
                        m3 + 0.25 * track + 0.12 * m1 + 0.05 * f2,
                        0.62 - 0.75 * look.puddles,
                        0.70 - 0.75 * look.puddles,
                    )
                    still *= min(1.0, look.puddles * 5.0)
                    film = min(max(film, 0.1), 1.1)
                    dark = 1.0 - (1.0 - look.wet_darkening) * min(1.0, 0.45 + film)
                    calm = 1.0 - 0.55 * min(film, 1.0)
                    gloss = min(0.9, (0.1 + 0.55 * film) * (1.0 + 1.2 * calm * f0))
                    gloss = max(gloss, 0.0)
                    dark *= 1.0 - 0.35 * still
                    rough = 1.0 + (rough - 1.0) * calm * (1.0 - 0.8 * still)
                    b, g, r = b * dark, g * dark, r * dark
                b, g, r = b * rough, g * rough, r * rough
                if kind == DRY:
                    gloss = np.float32(0.03) + 0.1 * bitumen
                elif kind == SNOW:
                    cover = (
                        look.cover
                        - look.clearing * track * (1.0 + 0.8 * m0)
                        + 0.55 * m1
                        + 0.3 * m0
                        + 0.35 * m3
                    )
                    cover = _step(cover + 0.5 * f1 + 0.25 * f0, 0.28, 0.62)
                    packed = track * (0.35 + 0.5 * look.clearing)
                    bump = 1.0 + look.relief * (0.75 * f1 + 0.25 * f0) * (1.0 - 0.4 * packed)
                    bump *= 1.0 + (0.45 * look.relief * m0 + 0.3 * look.relief * m1) - 0.22 * packed
                    grime = min(max(look.dirt * (0.7 + 1.6 * m0 + 1.2 * m1 + 0.5 * track), 0.0), 0.9)
                    white_b = (look.snow_b + (0.16 - look.snow_b) * grime) * bump
                    white_g = (look.snow_g + (0.165 - look.snow_g) * grime) * bump
                    white_r = (look.snow_r + (0.17 - look.snow_r) * grime) * bump
                    b += (white_b - b) * cover
                    g += (white_g - g) * cover
                    r += (white_r - r) * cover
                    still *= (1.0 - cover) * 0.6
                    gloss = gloss * (1.0 - cover) + look.ice_gloss * packed * cover
            else:
                value = 1.0 + look.verge_grain * (1.2 * f3 + 0.9 * m1 + 0.7 * m3)
                value = max(value, 0.15)
                b, g, r = look.verge_b * value, look.verge_g * value, look.verge_r * value
                if kind == WET:
                    b, g, r = b * 0.75, g * 0.75, r * 0.75
                blanket = look.verge_snow
                if kind == SNOW:
                    blanket = max(blanket, look.cover + 0.1)
                if blanket > 0.0:
                    cover = _step(blanket + 0.6 * m1 + 0.5 * m3 + 0.7 * f3, 0.3, 0.7)
                    bump = 1.0 + look.relief * (0.5 * f1 + 0.6 * m3 + 0.5 * m1)
                    b += (look.snow_b * bump - b) * cover
                    g += (look.snow_g * bump - g) * cover
                    r += (look.snow_r * bump - r) * cover
            lit = 1.0 - shaded
            b = max(b, 0.004) * (look.fill_b + look.sun_b * lit)
            g = max(g, 0.004) * (look.fill_g + look.sun_g * lit)
            r = max(r, 0.004) * (look.fill_r + look.sun_r * lit)
            if gloss + still > 0.01:
                shine = pixels.shine[row, col]
                sway = (f2 - half) * 0.05
                mb, mg, mr = _panorama(
                    maps.rough, azimuth + sway, 0.03 - elevation * 1.15 + sway, reach, lowest, rough_px
                )
                share = gloss * shine
                b += (mb - b) * share
                g += (mg - g) * share
                r += (mr - r) * share
                if still > 0.02:
                    mb, mg, mr = _panorama(
                        maps.sharp, azimuth + 0.1 * sway, 0.2 * sway - elevation, reach, lowest, sharp_px
                    )
                    share = still * min(1.0, 0.06 + shine)
                    b += (mb - b) * share
                    g += (mg - g) * share
                    r += (mr - r) * share
            clear = np.exp(-distance / look.visibility)
            b = look.haze_b + (b - look.haze_b) * clear + look.veil
            g = look.haze_g + (g - look.haze_g) * clear + look.veil
            r = look.haze_r + (r - look.haze_r) * clear + look.veil
            image[row, col, 0] = tone[min(int(b * gains[0]), top)]
            image[row, col, 1] = tone[min(int(g * gains[1]), top)]
            image[row, col, 2] = tone[min(int(r * gains[2]), top)]
            drivable[row, col] = on_road
            shadow[row, col] = on_road and label >= 0.502
            surface[row, col] = kind if on_road else -1
