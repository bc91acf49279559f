# mypy: disallow-untyped-defs=False
# numba infers the types below from the first call.
"""The compiled inner loop: light from every pixel's ground or sky to the lens.

Light is linear and relative to that from white open ground; the encoding to bytes comes last.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

WET, SNOW = 1, 2  # as in Surface
TONE_STEPS_PER_UNIT = 4096  # of the tone table, per unit of light
TONE_RANGE = 4.0  # greatest light of the tone table
F = np.float32
HALF = F(0.5)
GLAZE = F(0.25)  # least cover: ice and slush stay where wheels have cleared the snow
ONE = F(1.0)


class Maps(NamedTuple):
    """Textures and tables: ripmaps (texels as uint32 of four channels, level offsets), panoramas, tone and markings."""

    macro: NDArray[np.uint32]
    macro_at: NDArray[np.int64]
    fine: NDArray[np.uint32]
    fine_at: NDArray[np.int64]
    decal: NDArray[np.uint32]
    decal_at: NDArray[np.int64]
    sharp: NDArray[np.float32]
    rough: NDArray[np.float32]
    tone: NDArray[np.uint8]
    lines: NDArray[np.float32]  # (n, 5): lateral middle, width, period, painted length, phase [m]
    profile: NDArray[np.float32]  # (n, 2): wheel track and oil band 0..1 over the lateral coordinate
    clear: NDArray[np.float32]  # (H, W) share of light that haze lets through; below 0 above the horizon


class Pixels(NamedTuple):
    """Constants of the pixels of one camera, shape (H, W) each."""

    x: NDArray[np.float32]
    y: NDArray[np.float32]
    foot_x: NDArray[np.float32]  # the pixel's footprint on the ground [m]
    foot_y: NDArray[np.float32]
    levels: NDArray[np.uint32]  # ripmap levels, four bits each: macro along, across, fine ..., decal ...
    azimuth: NDArray[np.float32]
    elevation: NDArray[np.float32]
    shine: NDArray[np.float32]  # Fresnel share of a smooth water surface
    distance: NDArray[np.float32]  # on the ground [m], -1 above the horizon


class SceneScalars(NamedTuple):
    """Scalars of a scene, all float32."""

    right: Any
    left: Any
    asphalt_b: Any
    asphalt_g: Any
    asphalt_r: Any
    grain: Any
    stains: Any
    wheel_band: Any
    oil_band: Any
    cracks: Any
    wet_darkening: Any
    water_film: Any
    puddles: Any
    cover: Any
    snow_b: Any
    snow_g: Any
    snow_r: Any
    dirt: Any
    relief: Any
    clearing: Any
    ice_gloss: Any
    wear: Any
    paint_b: Any
    paint_g: Any
    paint_r: Any
    verge_b: Any
    verge_g: Any
    verge_r: Any
    verge_grain: Any
    verge_snow: Any
    verge_end: Any  # distance where what stands there hides the open verge [m]
    sun_b: Any
    sun_g: Any
    sun_r: Any
    fill_b: Any
    fill_g: Any
    fill_r: Any
    haze_b: Any
    haze_g: Any
    haze_r: Any
    veil: Any
    # directions of the panoramas [rad]
    reach: Any
    lowest: Any
    sharp_px: Any
    rough_px: Any


class CarPose(NamedTuple):
    """Pose of the car and exposure, all float32; texture coordinates are reduced to their first period."""

    cos_heading: Any
    sin_heading: Any
    heading: Any
    t: Any
    macro_s: Any
    macro_t: Any
    fine_s: Any
    fine_t: Any
    decal_s: Any
    decal_t: Any
    lines_s: Any
    gain_b: Any
    gain_g: Any
    gain_r: Any


@njit(inline="always", fastmath=True)
def _sample(texels, offsets, rows_log2, columns_log2, per_m, s, t, i, j):
    """Four channels 0..1 at (s, t) [m] on level (i, j): bilinear, periodic, all four channels in two words."""
    row_mask = (1 << (rows_log2 - i)) - 1
    shift = columns_log2 - j
    column_mask = (1 << shift) - 1
    v = s * (per_m / F(1 << i)) + F(8191.5)  # kept positive, so that truncation is floor
    u = t * (per_m / F(1 << j)) + F(8191.5)
    vi, ui = np.int32(v), np.int32(u)
    fv, fu = np.uint32((v - F(vi)) * F(16.0)), np.uint32((u - F(ui)) * F(16.0))
    r0 = offsets[i, j] + (((vi + 1) & row_mask) << shift)
    r1 = offsets[i, j] + (((vi + 2) & row_mask) << shift)
    c0 = (ui + 1) & column_mask
    c1 = (ui + 2) & column_mask
    wd = fv * fu
    wc = (fv << np.uint32(4)) - wd
    wb = (fu << np.uint32(4)) - wd
    wa = np.uint32(256) - wb - wc - wd
    a, b = texels[np.uint64(r0 + c0)], texels[np.uint64(r0 + c1)]
    c, d = texels[np.uint64(r1 + c0)], texels[np.uint64(r1 + c1)]
    mask, eight = np.uint32(0x00FF00FF), np.uint32(8)
    even = (a & mask) * wa + (b & mask) * wb + (c & mask) * wc + (d & mask) * wd
    odd = ((a >> eight) & mask) * wa + ((b >> eight) & mask) * wb + ((c >> eight) & mask) * wc
    odd += ((d >> eight) & mask) * wd
    k = F(1.0 / 65280.0)
    low, high = np.uint32(0xFFFF), np.uint32(16)
    return (
        F(np.int32(even & low)) * k,
        F(np.int32(odd & low)) * k,
        F(np.int32(even >> high)) * k,
        F(np.int32(odd >> high)) * k,
    )


@njit(inline="always", fastmath=True)
def _panorama(image, azimuth, elevation, reach, lowest, px):
    """Light from a direction, bilinear, clamped at the rims."""
    rows, columns = image.shape[0], image.shape[1]
    u = min(max((reach - azimuth) / px - HALF, F(0.0)), F(columns - 2))
    v = min(max((elevation - lowest) / px - HALF, F(0.0)), F(rows - 2))
    ui, vi = np.int32(u), np.int32(v)
    fu, fv = u - F(ui), v - F(vi)
    c, r = np.uint64(ui), np.uint64(vi)
    c1, r1 = c + np.uint64(1), r + np.uint64(1)
    wa, wb, wc, wd = (ONE - fv) * (ONE - fu), (ONE - fv) * fu, fv * (ONE - fu), fv * fu
    return (
        image[r, c, 0] * wa + image[r, c1, 0] * wb + image[r1, c, 0] * wc + image[r1, c1, 0] * wd,
        image[r, c, 1] * wa + image[r, c1, 1] * wb + image[r1, c, 1] * wc + image[r1, c1, 1] * wd,
        image[r, c, 2] * wa + image[r, c1, 2] * wb + image[r1, c, 2] * wc + image[r1, c1, 2] * wd,
    )


@njit(inline="always", fastmath=True)
def _step(value, low, high):
    """Smooth step from 0 to 1 between two values."""
    x = min(max((value - low) / (high - low), F(0.0)), ONE)
    return x * x * (F(3.0) - F(2.0) * x)


@njit(inline="always", fastmath=True)
def _mix(b, g, r, to_b, to_g, to_r, share):
    return b + (to_b - b) * share, g + (to_g - g) * share, r + (to_r - r) * share


@njit(inline="always", fastmath=True)
def _paint(lines, s, t, foot_s, foot_t):
    """Share of the pixel's footprint that a marking covers."""
    share = F(0.0)
    for k in range(lines.shape[0]):
        width = lines[k, 1]
        inside = HALF * (width + foot_t) - abs(t - lines[k, 0])
        if inside <= F(0.0):
            continue
        part = min(ONE, inside / foot_t, width / foot_t)
        period, dash = lines[k, 2], lines[k, 3]
        if period > foot_s:
            phase = (s - lines[k, 4]) % period
            middle = abs(phase - HALF * dash)
            middle = min(middle, period - middle)
            part *= min(ONE, max(F(0.0), (HALF * (dash + foot_s) - middle) / foot_s), dash / foot_s)
        elif period > F(0.0):
            part *= dash / period
        share = max(share, part)
    return share


@njit(inline="always", fastmath=True)
def _asphalt(scene, m0, m1, m2, m3, track, oil, repair):
    """Tone of dry asphalt relative to its albedo: stains, wheel paths, cracks, repairs (grain comes later)."""
    value = ONE + scene.stains * (F(1.2) * m0 + F(1.3) * m1 + F(0.5) * m3)
    value += scene.wheel_band * track - scene.oil_band * oil
    threshold = F(0.75) - F(1.1) * scene.cracks
    crack = min(ONE, m2 * F(1.6)) * _step(m1 + F(0.7) * m3, threshold, threshold + F(0.2))
    return value * (ONE - F(0.75) * crack) * (F(0.35) + F(1.3) * repair)


@njit(inline="always", fastmath=True)
def _water(scene, m0, m1, m3, f0, f2, track, oil):
    """A water film: share of standing water, darkening, gloss of the film, and share of the grain that is left."""
    threshold = F(0.62) - F(0.75) * scene.puddles
    pool = m3 + F(0.25) * track + F(0.12) * m1 + F(0.05) * f2
    still = _step(pool, threshold, threshold + F(0.08)) * min(ONE, scene.puddles * F(5.0))
    water_film = scene.water_film + F(0.4) * m0 + F(0.4) * m3 + F(0.35) * m1 - F(0.3) * track + F(0.1) * oil
    water_film = min(max(water_film, F(0.08)), F(1.1))
    dark = ONE - (ONE - scene.wet_darkening) * min(ONE, F(0.5) + water_film)
    dark *= ONE - F(0.35) * still
    calm = ONE - F(0.65) * min(water_film, ONE)
    gloss = (F(0.05) + F(0.6) * water_film) * (ONE + F(2.4) * calm * f0 + F(0.8) * m1)
    gloss = min(max(gloss, F(0.0)), F(0.85))
    return still, dark, gloss, calm * (ONE - F(0.8) * still)


@njit(inline="always", fastmath=True)
def _snow(scene, m0, m1, m3, f0, f1, track):
    """Snow on the road: cover, colour, and share packed by wheels."""
    cover = scene.cover - scene.clearing * track * (ONE + F(0.8) * m0)
    cover += F(0.55) * m1 + F(0.3) * m0 + F(0.35) * m3 + F(0.5) * f1 + F(0.25) * f0
    cover = GLAZE + (ONE - GLAZE) * _step(cover, F(0.28), F(0.62))
    packed = track * (F(0.35) + HALF * scene.clearing)
    bump = ONE + scene.relief * (F(1.3) * f1 + F(0.6) * f0) * (ONE - F(0.4) * packed)
    bump *= ONE + scene.relief * (F(0.6) * m0 + F(0.8) * m1) - F(0.22) * packed
    grime = scene.dirt * (F(0.7) + F(1.6) * m0 + F(1.2) * m1 + HALF * track)
    grime = min(max(grime, F(0.0)), F(0.9))
    b, g, r = _mix(scene.snow_b, scene.snow_g, scene.snow_r, F(0.16), F(0.165), F(0.17), grime)
    return cover, b * bump, g * bump, r * bump, packed


@njit(inline="always", fastmath=True)
def _verge(scene, kind, m1, m3, f1, f3):
    """Colour of the ground beside the road, with its snow."""
    value = max(ONE + scene.verge_grain * (F(1.2) * f3 + F(0.9) * m1 + F(0.7) * m3), F(0.15))
    if kind == WET:
        value *= F(0.75)
    b, g, r = scene.verge_b * value, scene.verge_g * value, scene.verge_r * value
    blanket = scene.verge_snow
    if kind == SNOW:
        blanket = max(blanket, scene.cover + F(0.1))
    if blanket > F(0.0):
        cover = _step(blanket + F(0.6) * m1 + HALF * m3 + F(0.7) * f3, F(0.3), F(0.7))
        bump = ONE + scene.relief * (HALF * f1 + F(0.6) * m3 + HALF * m1)
        b, g, r = _mix(b, g, r, scene.snow_b * bump, scene.snow_g * bump, scene.snow_r * bump, cover)
    return b, g, r


@njit(inline="always", fastmath=True)
def _road(scene, kind, macro, fine, track, oil, repair, bitumen, paint):
    """Reflectance of the road, gloss of its water film, and share of standing water."""
    m0, m1, m2, m3 = macro
    f0, f1, f2 = fine
    value = _asphalt(scene, m0, m1, m2, m3, track, oil, repair)
    b, g, r = scene.asphalt_b * value, scene.asphalt_g * value, scene.asphalt_r * value
    if paint > F(0.0):
        paint *= ONE - _step(scene.wear * F(1.5) - F(0.55) + F(0.9) * m1 + F(0.8) * f0, F(0.0), HALF)
        b, g, r = _mix(b, g, r, scene.paint_b, scene.paint_g, scene.paint_r, paint)
    grain = F(4.5) * scene.grain * f0
    gloss, still = F(0.1) * bitumen, F(0.0)
    if kind >= WET:
        still, dark, gloss, calm = _water(scene, m0, m1, m3, f0, f2, track, oil)
        grain *= calm
        b, g, r = b * dark, g * dark, r * dark
    grain = max(grain + ONE, F(0.15))
    b, g, r = b * grain, g * grain, r * grain
    if kind == SNOW:
        cover, white_b, white_g, white_r, packed = _snow(scene, m0, m1, m3, f0, f1, track)
        b, g, r = _mix(b, g, r, white_b, white_g, white_r, cover)
        still *= (ONE - cover) * F(0.6)
        gloss = gloss * (ONE - cover) + scene.ice_gloss * packed * cover
    return b, g, r, gloss, still


@njit(inline="always", fastmath=True)
def _mirrored(scene, rough, sharp, b, g, r, azimuth, elevation, shine, gloss, still, ripple):
    """Colour with the reflections of a wet surface: blurred on rough stone, sharp in standing water."""
    sway = ripple * F(0.05)
    mb, mg, mr = _panorama(
        rough,
        azimuth + sway,
        F(0.03) - elevation * F(1.15) + sway,
        scene.reach,
        scene.lowest,
        scene.rough_px,
    )
    b, g, r = _mix(b, g, r, mb, mg, mr, gloss * shine)
    if still > F(0.02):
        mb, mg, mr = _panorama(
            sharp,
            azimuth + F(0.1) * sway,
            F(0.2) * sway - elevation,
            scene.reach,
            scene.lowest,
            scene.sharp_px,
        )
        b, g, r = _mix(b, g, r, mb, mg, mr, still * min(ONE, F(0.06) + shine))
    return b, g, r


@njit(nogil=True, cache=True, fastmath=True)
def shade(pixels, maps, scene, pose, starts, surfaces, image, drivable, shadow, surface):
    """Fill the picture and the label maps.

    ``starts`` are the segments' starts ahead of the front axle [m], ``surfaces`` their classes; the outputs have
    shapes (H, W, 3) and (H, W).
    """
    # Unpacked here, because reading an array from its tuple costs reference counting at every pixel.
    xs, ys, foot_x, foot_y, level_words, azimuths, elevations, shines, distances = pixels
    macro, macro_at, fine, fine_at, decal, decal_at, sharp, rough, tone, lines, profile, clears = maps
    height, width = xs.shape
    top = np.uint64(tone.shape[0] - 1)
    four = np.uint32(15)
    for row in range(height):
        for col in range(width):
            azimuth = azimuths[row, col] + pose.heading
            elevation = elevations[row, col]
            distance = distances[row, col]
            on_road, shaded_label, kind = False, False, np.int8(-1)
            if distance < F(0.0):
                b, g, r = _panorama(sharp, azimuth, elevation, scene.reach, scene.lowest, scene.sharp_px)
            else:
                x, y = xs[row, col], ys[row, col]
                ahead = x * pose.cos_heading - y * pose.sin_heading
                aside = x * pose.sin_heading + y * pose.cos_heading
                t = pose.t + aside
                on_road = scene.right <= t <= scene.left
                if not on_road and distance > scene.verge_end:
                    b, g, r = _panorama(
                        sharp, azimuth, max(elevation, F(0.002)), scene.reach, scene.lowest, scene.sharp_px
                    )
                else:
                    kind = surfaces[0]
                    for k in range(1, starts.shape[0]):
                        if ahead >= starts[k]:
                            kind = surfaces[k]
                    levels = level_words[row, col]
                    m0, m1, m2, m3 = _sample(
                        macro,
                        macro_at,
                        11,
                        10,
                        F(50.0),
                        pose.macro_s + ahead,
                        pose.macro_t + aside,
                        levels & four,
                        (levels >> np.uint32(4)) & four,
                    )
                    f0, f1, f2, f3 = _sample(
                        fine,
                        fine_at,
                        10,
                        10,
                        F(250.0),
                        pose.fine_s + ahead,
                        pose.fine_t + aside,
                        (levels >> np.uint32(8)) & four,
                        (levels >> np.uint32(12)) & four,
                    )
                    shaded, label, repair, bitumen = F(0.0), F(0.0), HALF, F(0.0)
                    if F(-15.2) < t < F(15.2):
                        shaded, label, repair, bitumen = _sample(
                            decal,
                            decal_at,
                            12,
                            9,
                            F(1.0 / 0.06),
                            pose.decal_s + ahead,
                            pose.decal_t + aside,
                            (levels >> np.uint32(16)) & four,
                            (levels >> np.uint32(20)) & four,
                        )
                    m0, m1, m3 = m0 - HALF, m1 - HALF, m3 - HALF
                    f0, f1, f2, f3 = f0 - HALF, f1 - HALF, f2 - HALF, f3 - HALF
                    gloss, still = F(0.0), F(0.0)
                    if on_road:
                        spot = min(int((t - scene.right) * F(50.0)), profile.shape[0] - 1)
                        track, oil = profile[spot, 0], profile[spot, 1]
                        paint = _paint(
                            lines,
                            pose.lines_s + ahead,
                            t,
                            foot_x[row, col],
                            foot_y[row, col],
                        )
                        b, g, r, gloss, still = _road(
                            scene, kind, (m0, m1, m2, m3), (f0, f1, f2), track, oil, repair, bitumen, paint
                        )
                        shaded_label = label >= F(0.502)
                    else:
                        b, g, r = _verge(scene, kind, m1, m3, f1, f3)
                        kind = np.int8(-1)
                    lit = ONE - shaded
                    b = max(b, F(0.004)) * (scene.fill_b + scene.sun_b * lit)
                    g = max(g, F(0.004)) * (scene.fill_g + scene.sun_g * lit)
                    r = max(r, F(0.004)) * (scene.fill_r + scene.sun_r * lit)
                    if gloss + still > F(0.02):
                        shine = shines[row, col]
                        b, g, r = _mirrored(
                            scene, rough, sharp, b, g, r, azimuth, elevation, shine, gloss, still, f2
                        )
                    b, g, r = _mix(scene.haze_b, scene.haze_g, scene.haze_r, b, g, r, clears[row, col])
            image[row, col, 0] = tone[min(np.uint64((b + scene.veil) * pose.gain_b), top)]
            image[row, col, 1] = tone[min(np.uint64((g + scene.veil) * pose.gain_g), top)]
            image[row, col, 2] = tone[min(np.uint64((r + scene.veil) * pose.gain_r), top)]
            drivable[row, col] = on_road
            shadow[row, col] = shaded_label
            surface[row, col] = kind
