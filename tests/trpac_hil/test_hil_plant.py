"""The car on the bus: who drives it, what it sends and when, and how pictures are taken beside it."""

from __future__ import annotations

from collections import Counter
from types import SimpleNamespace
from typing import Any

import can
import numpy as np
import pytest
from hil_fakes import MS, FakeClock

from scenarios.files import load_scenario
from trpac_core.estimator import RoadClass
from trpac_core.vision.classes import Surface
from trpac_core.vision.ife_config import IfeConfig
from trpac_core.vision.images import ImageError
from trpac_hil import camera
from trpac_hil.bus import BusSettings
from trpac_hil.camera import FAILED, HEAD, CameraJob, result_columns
from trpac_hil.codec import load_codec
from trpac_hil.driver import FAST_M_S, GRIP_SHARE, PAUSE_S, PULSE_S, RAMP_S, SLOW_M_S, Driver, EndlessDrive
from trpac_hil.plant_node import P_0_M, PLAIN_SCENARIO, PlantJob, PlantNode
from trpac_hil.shared import Numbers, Ring

CODEC = load_codec()
SCENARIO = load_scenario(PLAIN_SCENARIO)


# The driver


def test_a_pulse_is_a_trapezium_of_what_the_weaker_wheel_of_each_axle_can_carry() -> None:
    driver = Driver(peak_nm=400.0, radius_m=0.3)
    theta, load_n = np.array([0.9, 0.3, 0.5, 0.5]), np.full(4, 4000.0)
    front, rear = GRIP_SHARE * 0.3 * 4000.0 * 0.3, GRIP_SHARE * 0.5 * 4000.0 * 0.3
    shares = {0.0: 0.0, 0.5 * RAMP_S: 0.5, RAMP_S: 1.0, 0.2: 1.0, PULSE_S - 0.2 * RAMP_S: 0.2, PULSE_S: 0.0}
    shares[PULSE_S + 0.5 * PAUSE_S] = 0.0
    times, expected = np.array(list(shares)), np.array(list(shares.values()))[:, None]
    for period in (0.0, 7 * (PULSE_S + PAUSE_S)):
        driven = driver.torque_nm(times + period, 0.5 * (SLOW_M_S + FAST_M_S), theta, load_n)
        assert driven == pytest.approx(expected * [front, front, 400.0, 400.0], abs=1e-6)
    braked = driver.torque_nm(times, FAST_M_S + 0.1, theta, load_n)
    assert braked == pytest.approx(-expected * [front, front, rear, rear], abs=1e-6)


def test_it_brakes_from_fast_until_slow_and_drives_from_slow_until_fast() -> None:
    driver, theta, load_n = Driver(400.0, 0.3), np.full(4, 0.8), np.full(4, 4000.0)
    speeds = [5.0, FAST_M_S - 0.1, FAST_M_S + 0.1, 5.0, SLOW_M_S + 0.1, SLOW_M_S - 0.1, 5.0]
    signs = [np.sign(driver.torque_nm(np.array([0.2]), v, theta, load_n)[0, 0]) for v in speeds]
    assert signs == [1.0, 1.0, -1.0, -1.0, -1.0, 1.0, 1.0]


def test_the_drive_goes_on_for_ever_between_its_speeds_on_a_road_that_repeats_itself() -> None:
    drive, length_m, car = EndlessDrive(SCENARIO, 0.02), SCENARIO.end.position_m, SCENARIO.vehicle.to_core()
    speeds, slips, came_back = [], [], 0
    before = drive.now
    assert before.position_m == pytest.approx(SLOW_M_S * 0.02, rel=0.05)
    for _ in range(3000):
        drive.advance()
        now = drive.now
        assert now.time_s == pytest.approx(before.time_s + 0.02)
        way_m = (now.position_m - before.position_m) % length_m
        assert way_m == pytest.approx(0.01 * (now.speed_m_s + before.speed_m_s), abs=3e-3)
        came_back += now.position_m < before.position_m
        front_m = now.position_m + car.cog_to_front_axle_m
        segment = drive.road.segment_at(front_m + 1e-9)
        if (
            drive.road.segment_at(front_m - 0.2) is segment
            and drive.road.segment_at(front_m + 0.2) is segment
        ):
            assert now.theta[:2] == [segment.mu_left, segment.mu_right]
        assert drive.surfaces_ahead(3.0) == drive.road.segment_at(front_m + 3.0).surface_classes
        speeds.append(now.speed_m_s)
        slips.append(abs(np.array(now.wheel_speed_rad_s) * car.wheel_radius_m / now.speed_m_s - 1.0))
        before = now
    assert came_back >= 3
    assert SLOW_M_S - 1.0 < min(speeds) < SLOW_M_S
    assert FAST_M_S < max(speeds) < FAST_M_S + 1.0
    assert np.quantile(slips, 0.9) < 0.05, "it shows theta and slides little"


def test_steps_at_once_are_as_many_steps_and_end_in_the_same_place() -> None:
    one, many = EndlessDrive(SCENARIO, 0.001), EndlessDrive(SCENARIO, 0.001)
    for steps in (1, 7, 10, 25):
        for _ in range(steps):
            one.advance()
        many.advance(steps)
        assert many.now == one.now


# What it sends


class Listener:
    """Stands where the plant's bus stands; keeps what is sent, decoded, with its time."""

    def __init__(self, clock: FakeClock) -> None:
        self.clock, self.looks = clock, 0
        self.by_id = CODEC.by_id(CODEC.messages)
        self.heard: list[tuple[int, str, dict[str, float]]] = []

    def send(self, frame_id: int, extended: bool, data: bytes) -> None:
        coded = self.by_id[frame_id, extended]
        self.heard.append((self.clock.now_ns(), coded.message.name, coded.decode(data)[0]))

    def receive(self) -> list[can.Message]:
        self.looks += 1
        return []

    def named(self, name: str) -> list[tuple[int, dict[str, float]]]:
        return [(at_ns, values) for at_ns, sent, values in self.heard if sent == name]


def sent_in(seconds: float, **job: Any) -> tuple[Listener, PlantNode, list[tuple[int, Any]]]:
    """What a plant sends, and where the car was in each slot."""
    clock = FakeClock()
    bus = Listener(clock)
    node = PlantNode(PlantJob(bus=BusSettings("virtual", "none"), **job), lambda: bus, clock)
    advance, places = node.drive.advance, []

    def watched(steps: int) -> None:
        advance(steps)
        ahead = tuple(int(s) for s in node.drive.surfaces_ahead(P_0_M))
        places.append((clock.now_ns(), node.drive.now, ahead))

    node.drive.advance = watched  # type: ignore[method-assign]
    rate_hz = job.get("rate_hz", 1000.0)
    node.run(clock.now_ns(), lambda: False, round(seconds * rate_hz))
    return bus, node, places


@pytest.fixture(scope="module")
def driven() -> tuple[Listener, PlantNode, list[tuple[int, Any]]]:
    return sent_in(12.0, rate_hz=200.0, camera_fps=20.0, camera_delay_s=0.06)


def test_each_slot_has_its_signals_as_the_sensors_read_them_and_the_bus_is_emptied(driven: Any) -> None:
    bus, node, places = driven
    assert Counter(name for _, name, _ in bus.heard) == {
        "WheelSpeeds": 2400, "WheelTorques": 2400, "VehicleMotion": 2400, "PlantTruth": 1200, "RoadClass": 239
    }  # fmt: skip
    assert bus.looks == 2400
    assert node.left_out == 0
    noise, channels = SCENARIO.sensors, ("FL", "FR", "RL", "RR")
    read = {name: bus.named(name) for name in ("WheelSpeeds", "WheelTorques", "VehicleMotion")}
    pairs = [
        *((read["WheelSpeeds"], f"WheelSpeed_{w}", lambda p, i=i: p.wheel_speed_rad_s[i], noise.wheel_speed_noise_rad_s)
          for i, w in enumerate(channels)),
        *((read["WheelTorques"], f"WheelTorque_{w}", lambda p, i=i: p.wheel_torque_nm[i], noise.wheel_torque_noise_nm)
          for i, w in enumerate(channels)),
        (read["VehicleMotion"], "VehicleSpeed", lambda p: p.speed_m_s, noise.vehicle_speed_noise_m_s),
        (read["VehicleMotion"], "AccelX", lambda p: p.accel_x_m_s2, noise.accel_x_noise_m_s2),
    ]  # fmt: skip
    errors = {}
    for sent, signal, true, deviation in pairs:
        step = next(
            float(s.scale) for m in CODEC.messages.values() for s in m.message.signals if s.name == signal
        )
        error = np.array([v[signal] for _, v in sent]) - [true(place) for _, place, _ in places]
        assert error.std() == pytest.approx(np.hypot(deviation, step / np.sqrt(12.0)), rel=0.1), signal
        assert abs(error.mean()) < 0.1 * error.std() + 0.5 * step
        errors[signal] = error
    likeness = np.corrcoef(list(errors.values())) - np.eye(len(errors))
    assert abs(likeness).max() < 0.12, "each channel has noise of its own"
    truth = [[values[f"Theta_{w}"] for w in channels] for _, values in bus.named("PlantTruth")]
    assert truth == pytest.approx(np.array([place.theta for _, place, _ in places[::2]]), abs=0.01)


def test_a_picture_is_told_of_once_its_delay_is_over_and_says_what_lay_ahead_when_it_was_taken(
    driven: Any,
) -> None:
    bus, _, places = driven
    ahead = {at_ns: surfaces for at_ns, _, surfaces in places}
    start_ns = places[0][0]
    for number, (at_ns, values) in enumerate(bus.named("RoadClass")):
        taken_ns = start_ns + number * 50 * MS
        assert at_ns == taken_ns + 60 * MS
        assert (values["RoadClass_Age"], values["RoadClass_Number"]) == (60.0, number % 256)
        assert (values["RoadClass_Left"], values["RoadClass_Right"]) == ahead[taken_ns]
        assert values["RoadClassConfidence_Left"] == values["RoadClassConfidence_Right"] == pytest.approx(0.9)
    assert len({values["RoadClass_Left"] for _, values in bus.named("RoadClass")}) > 1


def test_a_plant_without_a_camera_says_nothing_of_the_road() -> None:
    assert sent_in(0.3, rate_hz=100.0, camera_fps=0.0)[0].named("RoadClass") == []


# Pictures


@pytest.mark.parametrize(("work_ms", "numbers"), [(30, [0, 1, 2, 3, 4, 5]), (120, [0, 1, 2, 3, 4, 6])])
def test_each_picture_is_taken_when_it_is_due_and_where_that_is_too_fast_the_newest(
    work_ms: int, numbers: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = FakeClock()
    monkeypatch.setattr(camera, "SystemClock", lambda: clock)
    start_ns, taken = clock.now_ns() + 10 * MS, []

    def classes_of(image: int, motion: Any) -> list[RoadClass]:
        taken.append((image, motion.speed_m_s))
        clock.time_ns += work_ms * MS
        if image == 2:
            raise ImageError("torn")
        return [RoadClass(Surface.WET, 0.4)]

    told: list[str] = []

    class Told:
        send = staticmethod(lambda kind, text: told.append(text))
        stopped = property(lambda self: len(taken) == 6)

    control = Told()
    control.start_ns = start_ns  # type: ignore[attr-defined]
    job = CameraJob(SimpleNamespace(picture=lambda number: number), IfeConfig(), 10.0)  # type: ignore[arg-type]
    motion, results = Numbers(5), Ring(result_columns(1), 64)
    motion.set([12.0, 0.0, 0.0, 0.0, 0.0])
    camera._play(job, SimpleNamespace(classes=classes_of), motion, results, control)  # type: ignore[arg-type]
    rows = results.read()
    assert taken == [(number, 12.0) for number in numbers]
    assert rows[:, 0].tolist() == numbers
    assert rows[:, 1].tolist() == [start_ns + number * 100 * MS for number in numbers]
    assert rows[:, 3].tolist() == [number - count for count, number in enumerate(numbers)]
    assert rows[:, 4] == pytest.approx(work_ms)
    assert (rows[:, 2] - rows[:, 1]).min() >= work_ms * MS
    classes = rows[:, HEAD:].tolist()
    assert classes == [[FAILED, 0.0] if number == 2 else [float(Surface.WET), 0.4] for number in numbers]
    assert len(told) == 1
