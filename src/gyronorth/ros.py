"""A node of ROS 2: `sensor_msgs/Imu` in; heading, attitude and diagnostics out. It needs ROS only when it runs.

    python -m gyronorth.ros --ros-args -p latitude_deg:=48.1 -p sensor:=stim300

Subscribes to `imu/data_raw` (REP 145: forward-left-up, rad/s, m/s^2) and publishes once a second

- `heading/imu`: `sensor_msgs/Imu` with the orientation in east-north-up (REP 103) and its covariance; the element 0 of
  the covariance is -1 while the heading is not valid, which means that there is none;
- `heading/azimuth`: `compass_interfaces/Azimuth`, true north, NED orientation, where that package is installed;
- `diagnostics`: `diagnostic_msgs/DiagnosticArray`, OK while valid, WARN while aligning, ERROR otherwise.

The mapping to messages is made of plain functions that set fields by name.
"""

from __future__ import annotations

from math import degrees
from typing import Any

import numpy as np

from gyronorth.arrays import Array
from gyronorth.errors import InputError
from gyronorth.estimate import HeadingEstimate
from gyronorth.streaming import StreamingHeading

#: Messages by whose stamps the rate is measured, and their largest scatter, relative.
MEASURED, SCATTER = 200, 0.05
#: `diagnostic_msgs/DiagnosticStatus`.
OK, WARN, ERROR = b"\x00", b"\x01", b"\x02"
#: `compass_interfaces/Azimuth`.
UNIT_RAD, ORIENTATION_NED, REFERENCE_GEOGRAPHIC = 0, 1, 1
#: Codes that more standing takes away.
ALIGNING = frozenset({"too_short", "too_noisy"})


def sample_of(message: Any) -> tuple[Array, Array]:
    """Rate, rad/s, and specific force, m/s^2, (3,) each, forward-right-down, of a `sensor_msgs/Imu`."""
    rate, force = message.angular_velocity, message.linear_acceleration
    return np.array([rate.x, -rate.y, -rate.z]), np.array([force.x, -force.y, -force.z])


def seconds_of(stamp: Any) -> float:
    """A `builtin_interfaces/Time` in s."""
    return stamp.sec + 1e-9 * stamp.nanosec


def fill_imu(message: Any, estimate: HeadingEstimate) -> Any:
    """Orientation and covariance of a `sensor_msgs/Imu`; rate and acceleration are marked as not given."""
    message.angular_velocity_covariance = [-1.0, *[0.0] * 8]
    message.linear_acceleration_covariance = [-1.0, *[0.0] * 8]
    found = estimate.orientation
    if found is None or not estimate.valid or estimate.sigma is None:
        message.orientation_covariance = [-1.0, *[0.0] * 8]
        return message
    x, y, z, w = found.quaternion_enu.tolist()
    message.orientation.x, message.orientation.y, message.orientation.z, message.orientation.w = x, y, z, w
    covariance = found.covariance_enu
    if covariance is None:  # level is not known to a figure: as well as the heading
        covariance = np.eye(3) * estimate.sigma**2
    message.orientation_covariance = covariance.ravel().tolist()
    return message


def fill_azimuth(message: Any, estimate: HeadingEstimate) -> Any:
    """A `compass_interfaces/Azimuth` of a valid estimate."""
    assert estimate.heading is not None
    assert estimate.sigma is not None
    message.azimuth, message.variance = estimate.heading, estimate.sigma**2
    message.unit, message.orientation, message.reference = UNIT_RAD, ORIENTATION_NED, REFERENCE_GEOGRAPHIC
    return message


def diagnosis(estimate: HeadingEstimate) -> tuple[bytes, str, dict[str, str]]:
    """Level, message and values of a `diagnostic_msgs/DiagnosticStatus`."""
    codes = [reason.code for reason in estimate.reasons]
    level = OK if not codes else WARN if set(codes) <= ALIGNING else ERROR
    said = "valid" if not codes else "; ".join(reason.message for reason in estimate.reasons)
    values = {
        "heading_deg": "" if estimate.heading is None else f"{degrees(estimate.heading):.3f}",
        "sigma_deg": "" if estimate.sigma is None else f"{degrees(estimate.sigma):.3f}",
        "duration_s": f"{estimate.duration:.1f}",
        "reasons": ",".join(codes),
        "warnings": ",".join(warning.code for warning in estimate.warnings),
    }
    return level, said, values


def rate_of(stamps: list[float]) -> float:
    """The rate of messages, Hz, by their stamps.

    Raises
    ------
    InputError
        If they do not rise, or are too uneven to tell a rate.
    """
    steps = np.diff(stamps)
    usual = float(np.median(steps)) if len(steps) else 0.0
    if usual <= 0:
        raise InputError("The stamps of the messages do not rise; stamps of the driver are expected in header.stamp.")
    mean = (stamps[-1] - stamps[0]) / len(steps)
    if abs(mean / usual - 1) > SCATTER:
        raise InputError(
            f"The messages come every {mean:.4g} s on average, most of them after {usual:.4g} s: some are lost. Set "
            "the rate: -p rate_hz:=200."
        )
    return 1 / mean


class Collector:
    """Messages in, estimates out."""

    def __init__(self, *, latitude: float, rate_hz: float | None = None, **settings: Any) -> None:
        self._settings = {"latitude": latitude, "accelerometer": True, **settings}
        self._waiting: list[tuple[float, Array, Array]] = []
        self._heading = None if rate_hz is None else StreamingHeading(rate_hz=rate_hz, **self._settings)

    def add(self, message: Any) -> None:
        """Take a `sensor_msgs/Imu`."""
        self._waiting.append((seconds_of(message.header.stamp), *sample_of(message)))

    def estimate(self) -> HeadingEstimate | None:
        """The heading of all that came; None before the rate is known."""
        if self._heading is None:
            if len(self._waiting) < MEASURED:
                return None
            rate_hz = rate_of([stamp for stamp, _, _ in self._waiting])
            self._heading = StreamingHeading(rate_hz=rate_hz, **self._settings)
        if self._waiting:
            _, rates, forces = zip(*self._waiting, strict=True)
            self._heading.add(np.array(rates), np.array(forces))
            self._waiting.clear()
        return self._heading.estimate()


def main() -> None:
    """Run the node until it is shut down."""
    import rclpy  # pyright: ignore[reportMissingImports]
    from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue  # pyright: ignore[reportMissingImports]
    from rclpy.node import Node  # pyright: ignore[reportMissingImports]
    from rclpy.qos import qos_profile_sensor_data  # pyright: ignore[reportMissingImports]
    from sensor_msgs.msg import Imu  # pyright: ignore[reportMissingImports]

    try:
        from compass_interfaces import msg as compass  # pyright: ignore[reportMissingImports]
    except ImportError:
        compass = None

    class HeadingNode(Node):
        """Messages in and out."""

        def __init__(self) -> None:
            super().__init__("gyronorth")
            declared = {
                name: self.declare_parameter(name, default).value
                for name, default in (("latitude_deg", 0.0), ("sensor", ""), ("method", "auto"), ("rate_hz", 0.0))
            }
            self._collector = Collector(
                latitude=float(np.radians(declared["latitude_deg"])),
                rate_hz=declared["rate_hz"] or None,
                sensor=declared["sensor"] or None,
                method=declared["method"],
            )
            self._imu = self.create_publisher(Imu, "heading/imu", 10)
            self._azimuth = compass and self.create_publisher(compass.Azimuth, "heading/azimuth", 10)
            self._diagnostics = self.create_publisher(DiagnosticArray, "diagnostics", 10)
            self.create_subscription(Imu, "imu/data_raw", self._collector.add, qos_profile_sensor_data)
            self.create_timer(1.0, self._publish)

        def _publish(self) -> None:
            found = self._collector.estimate()
            if found is None:
                return
            now = self.get_clock().now().to_msg()
            imu = fill_imu(Imu(), found)
            imu.header.stamp, imu.header.frame_id = now, "imu_link"
            self._imu.publish(imu)
            if compass is not None and self._azimuth is not None and found.valid:
                azimuth = fill_azimuth(compass.Azimuth(), found)
                azimuth.header.stamp, azimuth.header.frame_id = now, "imu_link"
                self._azimuth.publish(azimuth)
            level, said, values = diagnosis(found)
            pairs = [KeyValue(key=key, value=value) for key, value in values.items()]
            status = DiagnosticStatus(level=level, name="gyronorth: heading", message=said, values=pairs)
            array = DiagnosticArray(status=[status])
            array.header.stamp = now
            self._diagnostics.publish(array)

    rclpy.init()
    node = HeadingNode()
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
