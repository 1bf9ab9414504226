"""Faults around the node: how each is provoked, its words, and how it is cleared."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseWithCovarianceStamped, Quaternion
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.serialization import serialize_message
from std_msgs.msg import String
from tanker_pose.msg import FeaturePointArray

from harness import messages, paper
from harness.peer import BEST_EFFORT, LATCHED, RELIABLE
from harness.scene import FRAMES_PER_STEP, SIMULATED_S, Scene, rates, stamped

# A camera counts as steady after 3 s.
STEADY_S = 5.0
FAR_AHEAD = 1_000_000


@dataclass(frozen=True)
class Case:
    """A fault: how it comes, what is said of it, how it goes."""

    key: str
    words: str
    provoke: Callable[[Scene], object]
    clear: Callable[[Scene], object]
    arguments: tuple[str, ...] = ()


def both(scene: Scene) -> None:
    scene.speak("/camera_info", "/feature_points")


def add_deaf_publisher(scene: Scene) -> None:
    # rclpy's own warning of it is deprecated by rclpy itself.
    quiet = PublisherEventCallbacks(use_default_callbacks=False)
    publisher = scene.peer.node.create_publisher(
        FeaturePointArray, "/feature_points", BEST_EFFORT, event_callbacks=quiet
    )
    scene.others.append(publisher)


def add_subscriber(kind: type, qos) -> Callable[[Scene], None]:
    def add(scene: Scene) -> None:
        quiet = SubscriptionEventCallbacks(use_default_callbacks=False)
        subscription = scene.peer.node.create_subscription(
            kind, "/pose", lambda message: None, qos, event_callbacks=quiet
        )
        scene.others.append(subscription)

    return add


def add_wrong_publisher(scene: Scene) -> None:
    scene.others.append(scene.peer.node.create_publisher(String, "/camera_info", RELIABLE))


def remove_publisher(scene: Scene) -> None:
    scene.peer.node.destroy_publisher(scene.others.pop())


def remove_subscriber(scene: Scene) -> None:
    scene.peer.node.destroy_subscription(scene.others.pop())


def stop_detector(scene: Scene) -> None:
    both(scene)
    scene.steps_for(2.0)
    scene.remove("/feature_points")


def stop_camera(scene: Scene) -> None:
    both(scene)
    scene.steps_for(STEADY_S)
    scene.hush("/camera_info")


def name_another_frame(scene: Scene) -> None:
    both(scene)
    scene.frame_id = "other_camera"


def name_the_same_frame(scene: Scene) -> None:
    scene.frame_id = messages.CAMERA_FRAME


def misplace_a_marker(scene: Scene) -> None:
    # As with a map in which it stands elsewhere: it is off the same way in every image.
    both(scene)
    good = Scene.message

    def message(topic: str) -> object:
        told = good(scene, topic)
        if topic == "/feature_points":
            told.points[5].u += 30.0
        return told

    scene.message = message


def misplace_all_markers(scene: Scene) -> None:
    # A map that is some centimetres off everywhere: 2 px, the same in every image.
    spoil_pixels(scene, lambda: np.random.default_rng(5).normal(0.0, 2.0, (len(paper.MARKERS), 2)))


def scatter_markers(scene: Scene) -> None:
    # A detector that is four times worse than its sigma.
    rng = np.random.default_rng(6)
    spoil_pixels(scene, lambda: rng.normal(0.0, 4 * messages.SIGMA_PX, (len(paper.MARKERS), 2)))


def spoil_pixels(scene: Scene, errors: Callable[[], np.ndarray]) -> None:
    both(scene)
    good = Scene.message

    def message(topic: str) -> object:
        told = good(scene, topic)
        if topic == "/feature_points":
            for point, (u, v) in zip(told.points, errors(), strict=True):
                point.u += u
                point.v += v
        return told

    scene.message = message


def pitch_the_tanker(scene: Scene) -> None:
    both(scene)
    good = Scene.message
    pose = paper.camera_from_tanker(0.0, 20.0, 0.0, (15.0, 0.0, 4.5))

    def message(topic: str) -> object:
        return (
            messages.exact_frame(FRAMES_PER_STEP * scene.index, pose)
            if topic == "/feature_points"
            else good(scene, topic)
        )

    scene.message = message


def stamp_by_a_clock_that_is_ahead(by_s: float) -> Callable[[Scene], None]:
    def provoke(scene: Scene) -> None:
        scene.message = lambda topic: stamped(
            Scene.message(scene, topic), scene.peer.node.get_clock().now(), by_s
        )
        both(scene)

    return provoke


def stamp_since_start(scene: Scene) -> None:
    def message(topic: str) -> object:
        told = Scene.message(scene, topic)
        told.header.stamp = Time(sec=500 + scene.index)
        return told

    scene.message = message
    both(scene)


def jump(by: int) -> Callable[[Scene], None]:
    def provoke(scene: Scene) -> None:
        scene.index = FAR_AHEAD
        both(scene)
        # Until frames are taken, or there is nothing to jump from.
        scene.step_until(lambda: "estimate_rate_hz" in rates(scene), "estimates")
        scene.index += by

    return provoke


def turn_clock(by_s: int) -> Callable[[Scene], None]:
    def provoke(scene: Scene) -> None:
        scene.speak("/clock")
        scene.step_until(
            lambda: scene.reports and scene.reports[-1].header.stamp.sec >= SIMULATED_S,
            "simulated time",
        )
        scene.clock_s += by_s

    return provoke


def send_undecodable(scene: Scene) -> None:
    # As from a definition with a field less at the end.
    both(scene)
    good = Scene.message
    scene.message = lambda topic: (
        serialize_message(good(scene, topic))[:-5]
        if topic == "/feature_points"
        else good(scene, topic)
    )


def send_good(scene: Scene) -> None:
    del scene.message


def stop_clock(scene: Scene) -> None:
    turn_clock(0)(scene)
    scene.hush("/clock")


def nothing(scene: Scene) -> None:
    """What is over by itself."""


RELIABLE_INPUT = ("-p", "qos_overrides./feature_points.subscription.reliability:=reliable")
SIM_TIME = ("-p", "use_sim_time:=true")

def report_attitudes(scene: Scene) -> None:
    scene.speak("/mavros/imu/data", "/tanker_attitude")


def turn_an_aircraft(topic: str, orientation: Quaternion) -> Callable[[Scene], None]:
    def provoke(scene: Scene) -> None:
        both(scene)
        report_attitudes(scene)
        good = Scene.message

        def message(of: str) -> object:
            told = good(scene, of)
            if of == topic:
                told.orientation = orientation
            return told

        scene.message = message

    return provoke


# Of the receiver and of the tanker, which comes with every step.
REPORTED = (
    *("-p", "attitude:=imu", "-p", "reported_attitude_sigma_deg:=2.0"),
    *("-p", "attitude_max_age_s:=0.5", "-p", "tanker_attitude_max_age_s:=0.5"),
)

CASES = {
    "publisher offers less": Case(
        "incompatible_qos",
        "a publisher of /feature_points offers reliability best_effort, requested is reliable",
        add_deaf_publisher,
        remove_publisher,
        RELIABLE_INPUT,
    ),
    "subscriber requests more": Case(
        "incompatible_qos",
        "a subscriber of /pose requests durability transient_local, offered is volatile",
        add_subscriber(PoseWithCovarianceStamped, LATCHED),
        remove_subscriber,
    ),
    "publisher of another type": Case(
        "wrong_type",
        "a publisher of /camera_info sends std_msgs/msg/String, expected sensor_msgs/msg/CameraInfo",
        add_wrong_publisher,
        remove_publisher,
    ),
    "subscriber of another type": Case(
        "wrong_type",
        "a subscriber of /pose expects std_msgs/msg/String",
        add_subscriber(String, RELIABLE),
        remove_subscriber,
    ),
    "silent detector": Case(
        "silent_publisher",
        "/feature_points",
        lambda scene: scene.have("/feature_points"),
        lambda scene: scene.speak("/feature_points"),
    ),
    "silent camera": Case(
        "silent_publisher",
        "/camera_info",
        lambda scene: scene.have("/camera_info"),
        lambda scene: scene.speak("/camera_info"),
    ),
    "camera without detector": Case(
        "no_detections",
        "camera info arrives on /camera_info, but /feature_points has no publisher of matching type",
        lambda scene: scene.speak("/camera_info"),
        lambda scene: scene.speak("/feature_points"),
    ),
    "detector gone": Case(
        "no_detections",
        "no more detections on /feature_points",
        stop_detector,
        lambda scene: scene.speak("/feature_points"),
    ),
    "detector without camera": Case(
        "no_camera_info",
        "NO_CAMERA_INFO",
        lambda scene: scene.speak("/feature_points"),
        lambda scene: scene.speak("/camera_info"),
    ),
    "camera stops": Case(
        "stale_camera_info",
        "no camera info on /camera_info for 5 s",
        stop_camera,
        lambda scene: scene.speak("/camera_info"),
    ),
    "two frames": Case(
        "frame_mismatch", "other_camera", name_another_frame, name_the_same_frame
    ),
    "marker in the wrong place": Case(
        "suspect_marker",
        "marker 6 was left out of 100% of the frames that show it",
        misplace_a_marker,
        send_good,
    ),
    "map that is off": Case(
        "not_trusted",
        "the residuals point the same way in every frame: the marker map or the calibration",
        misplace_all_markers,
        send_good,
    ),
    "sigma that is too small": Case(
        "not_trusted",
        "the sigmas (pixel_sigma_px, or those of the detections) are too small",
        scatter_markers,
        send_good,
    ),
    "tanker off its nominal attitude": Case(
        "unexpected_attitude",
        "the tanker stands 20.0° off its nominal attitude",
        pitch_the_tanker,
        send_good,
    ),
    "detector's clock ahead": Case(
        "clock_offset",
        "s in the future by this machine's clock: the clock of the machine that stamps the images (camera or detector) is "
        "not synchronised",
        stamp_by_a_clock_that_is_ahead(23.0),
        stamp_by_a_clock_that_is_ahead(0.0),
    ),
    "images of yesterday": Case(
        "clock_offset",
        "s old by this machine's clock",
        stamp_by_a_clock_that_is_ahead(-86_400.0),
        stamp_by_a_clock_that_is_ahead(0.0),
    ),
    "stamps since the start of a machine": Case(
        "clock_offset",
        "they are counted from a start-up",
        stamp_since_start,
        stamp_by_a_clock_that_is_ahead(0.0),
    ),
    "stamps go back": Case("stamp_jump", "back by", jump(-1000), nothing),
    "stamps go far ahead": Case("stamp_jump", "ahead by", jump(10_000), nothing),
    "clock goes back": Case("clock_jump", "back by", turn_clock(-500), nothing, SIM_TIME),
    "clock goes far ahead": Case("clock_jump", "ahead by", turn_clock(5000), nothing, SIM_TIME),
    "detector of another definition": Case(
        "undecodable",
        "a message on feature_points cannot be decoded",
        send_undecodable,
        send_good,
    ),
    "clock stops": Case(
        "no_clock",
        "/clock has stopped",
        stop_clock,
        lambda scene: scene.speak("/clock"),
        SIM_TIME,
    ),
    "no clock": Case(
        "no_clock", "no /clock message has arrived", nothing, lambda scene: scene.speak("/clock"), SIM_TIME
    ),
    "tanker that does not report its attitude": Case(
        "no_reported_attitude",
        "the receiver's attitude: need 2 samples of the attitude, got 0",
        both,
        report_attitudes,
        REPORTED,
    ),
    "receiver that would fly on its back": Case(
        "unusable_attitude",
        "samples of the receiver's attitude are not used: expected the rotation from FLU",
        turn_an_aircraft("/mavros/imu/data", Quaternion(x=1.0, w=0.0)),
        send_good,
        REPORTED,
    ),
    "attitudes that contradict the image": Case(
        "attitude_contradiction",
        "one of the attitudes that both aircraft report is wrong: by both attitudes the tanker stands 60.0°",
        turn_an_aircraft(
            "/tanker_attitude", Quaternion(z=float(np.sin(np.pi / 6)), w=float(np.cos(np.pi / 6)))
        ),
        send_good,
        REPORTED,
    ),
}
