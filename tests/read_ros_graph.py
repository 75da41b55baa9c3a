"""Stands in for a ROS 2 graph and reads what `skillet bridge ros2` publishes there, as JSON; see tests/ros2_live.rs.

    read_ros_graph.py PORT DOMAIN NAMESPACE

The router is Zenoh's own, set as rmw_zenohd sets it, and the readers are peers with rmw_zenoh's settings for nodes. None of them
knows Skillet: `zenoh-ros2-sdk` lists the graph, reads /tf and what comes beside messages; `pyzeros` subscribes, with types and hashes of its own; Zenoh's
advanced subscriber, which a ROS subscription is, asks for latched messages; `rosbags` decodes everything.

Prints one line when it has seen enough, and another one when the node has left the graph.
"""

import json
import math
import os
import sys
import threading
import time
import traceback

os.environ.setdefault("GIT_PYTHON_REFRESH", "quiet")  # of the SDK; it is given every definition

import pyzeros.utils
import zenoh
import zenoh.ext
import zenoh_ros2_sdk
from pyzeros.node import Node
from pyzeros.sub import RawSub
from ros2_pyterfaces.cydr.geometry_msgs.msg import PoseStamped, WrenchStamped
from ros2_pyterfaces.cydr.sensor_msgs.msg import JointState
from ros2_pyterfaces.cydr.std_msgs.msg import String
from ros_frames import by_child, place, xyz
from rosbags.typesys import Stores, get_typestore
from zenoh_ros2_sdk.attachment import Attachment
from zenoh_ros2_sdk.qos import QosDurability, QosProfile

PORT, DOMAIN, NAMESPACE = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
STARTED_NS = time.time_ns()
WATCHDOG_S = 80
ros = get_typestore(Stores.ROS2_JAZZY)
changed = threading.Condition()


def fail(kind, error, trace):
    """Sessions that are open keep the interpreter from ending."""
    traceback.print_exception(kind, error, trace)
    os._exit(1)


sys.excepthook = fail


def until(what, condition):
    """Waits until `condition` holds, and returns it."""
    with changed:
        if not changed.wait_for(condition, WATCHDOG_S):
            raise TimeoutError(f"{what}: not within {WATCHDOG_S} s")
        return condition()


def stamp_ns(time):
    return time.sec * 10**9 + time.nanosec


# As DEFAULT_RMW_ZENOH_ROUTER_CONFIG.json5 sets it.
router = zenoh.Config()
for setting, value in {
    "mode": "router",
    "listen/endpoints": [f"tcp/127.0.0.1:{PORT}"],
    "scouting/multicast/enabled": False,
    "scouting/gossip/enabled": True,
    "scouting/gossip/target": {"router": ["router", "peer"], "peer": ["router"]},
    "timestamping/enabled": True,
}.items():
    router.insert_json5(setting, json.dumps(value))
router = zenoh.open(router)

# Its configuration of a session is rmw_zenoh's.
session = zenoh_ros2_sdk.ZenohSession.get_instance("127.0.0.1", PORT).session

# Who is there, and who leaves.
tokens, left = set(), set()


def on_token(sample):
    with changed:
        (tokens if sample.kind == zenoh.SampleKind.PUT else left).add(str(sample.key_expr))
        changed.notify_all()


liveliness = session.liveliness().declare_subscriber(f"@ros2_lv/{DOMAIN}/**", on_token, history=True)
until("a node with eight topics", lambda: len([token for token in tokens if "/skillet_" in token]) >= 9)

# Topics by what they carry; pyzeros finds key and hash by itself.
node = Node("reader", session=session, domain_id=DOMAIN)
read = {
    "/joint_states": JointState, "/skillet/pose": PoseStamped, "/skillet/pose_desired": PoseStamped,
    "/skillet/wrench": WrenchStamped, "/skillet/policy": String,
}
received = {name: [] for name in read}


def subscribe(name, of_type):
    def on_sample(sample):
        with changed:
            received[name].append((time.time_ns(), sample.payload.to_bytes(), sample.attachment.to_bytes()))
            changed.notify_all()

    return RawSub(of_type, NAMESPACE + name, on_sample, session=node)


subscriptions = [subscribe(name, of_type) for name, of_type in read.items()]
transforms = []


def on_transforms(message):
    with changed:
        transforms.append(message)
        changed.notify_all()


def definition(name):
    text, digest = ros.generate_msgdef(name, ros_version=2)[0], ros.hash_rihs01(name)
    return {"msg_type": name, "msg_definition": text, "type_hash": digest, "domain_id": DOMAIN, "router_port": PORT}


frames = zenoh_ros2_sdk.ROS2Subscriber(NAMESPACE + "/tf", callback=on_transforms, **definition("tf2_msgs/msg/TFMessage"))


def events():
    return [
        json.loads(ros.deserialize_cdr(data, "std_msgs/msg/String").data) for _, data, _ in received["/skillet/policy"]
    ]


until("joint states and transforms", lambda: len(received["/joint_states"]) >= 300 and len(transforms) >= 200)
until("a trial", lambda: {"policy", "outcome", "trial", "measures"} <= {event["event"] for event in events()})
for subscription in [*subscriptions, frames]:
    subscription.close()

# A late subscription of latched topics, as rmw_zenoh declares it.
latched = {}
for name, type_name in [("/tf_static", "tf2_msgs/msg/TFMessage"), ("/robot_description", "std_msgs/msg/String")]:
    def on_latched(sample, name=name, type_name=type_name):
        with changed:
            latched.setdefault(name, []).append(ros.deserialize_cdr(sample.payload.to_bytes(), type_name))
            changed.notify_all()

    key = f"{DOMAIN}{NAMESPACE}{name}/{pyzeros.utils.ros_type_to_dds_type(type_name)}/{ros.hash_rihs01(type_name)}"
    history = zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=1)
    subscriptions.append(zenoh.ext.declare_advanced_subscriber(session, key, on_latched, history=history))
until("latched messages", lambda: len(latched) == 2)
time.sleep(0.5)  # a second one would be wrong
assert all(len(messages) == 1 for messages in latched.values()), latched

# Every message has the number, the time and the publisher that ROS reports with it, and rosbags decodes it, too.
messages, counts = {}, {}
for name, of_type in read.items():
    token = next(t for t in tokens if f"/{(NAMESPACE + name).replace('/', '%')}/" in t and "/skillet_" in t)
    numbers, messages[name] = [], []
    for at_ns, data, label in received[name]:
        assert len(label) == 33
        label = Attachment.from_bytes(label)
        assert label.gid == pyzeros.utils.rmw_zenoh_gid(token), name
        assert STARTED_NS < label.timestamp_ns <= at_ns
        numbers.append(label.sequence_id)
        type_name = of_type.get_type_name()
        message = ros.deserialize_cdr(data, type_name)
        assert bytes(ros.serialize_cdr(message, type_name)) == data, name
        messages[name].append(message)
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers))), name
    counts[name] = len(numbers)

# Stamps are those of ticks, and now.
stamps = [stamp_ns(message.header.stamp) for message in messages["/joint_states"]]
steps = [b - a for a, b in zip(stamps, stamps[1:])]
delays = [at_ns - stamp for stamp, (at_ns, _, _) in zip(stamps, received["/joint_states"])]

# The frames lead from the root to the tip, where the pose says it is.
fixed = by_child(latched["/tf_static"][0])
poses = {stamp_ns(message.header.stamp): message for message in messages["/skillet/pose"]}
tip = messages["/skillet/wrench"][0].header.frame_id
gap, n_placed, chain = 0.0, 0, []
for message in transforms:
    at_ns = stamp_ns(message.transforms[0].header.stamp)
    if at_ns in poses:
        position, chain = place(tip, fixed | by_child(message))
        gap, n_placed = max(gap, math.dist(position, xyz(poses[at_ns].pose.position))), n_placed + 1



def listed():
    """The graph as `ros2 topic list` and `ros2 topic info` would show it; on a busy host the SDK asks more than once."""
    sdk = {"domain_id": DOMAIN, "router_port": PORT, "timeout": 2.0}
    while time.time_ns() < STARTED_NS + WATCHDOG_S * 10**9:
        graph = zenoh_ros2_sdk.get_topic_names_and_types(**sdk)
        info = {name: zenoh_ros2_sdk.get_topic_info(name, verbose=True, **sdk) for name, _ in graph}
        if len([topic for topic in info.values() if topic and topic.publishers]) >= 8:
            return graph, info
    raise TimeoutError(f"the SDK lists {graph}")


graph, info = listed()
endpoints = {name: endpoint for name, topic in info.items() if topic for endpoint in topic.publishers}
print(json.dumps({
    "types": {name: types for name, types in graph},
    "nodes": sorted({f"{endpoint.node_namespace} {endpoint.node_name}" for endpoint in endpoints.values()}),
    "latched": sorted(name for name, e in endpoints.items() if QosProfile.decode(e.qos).durability == QosDurability.TRANSIENT_LOCAL),
    "node_tokens": sorted(token for token in tokens if "/NN/" in token and "/skillet_" in token),
    "counts": counts, "transforms": len(transforms), "placed": n_placed, "gap_m": gap, "chain": chain,
    "step_ms_min": min(steps) / 1e6, "step_ms_median": sorted(steps)[len(steps) // 2] / 1e6,
    "on_grid": sum(step % 10**6 == 0 for step in steps) / len(steps), "rate_hz": len(steps) / (stamps[-1] - stamps[0]) * 1e9,
    "delay_ms_min": min(delays) / 1e6, "delay_ms_median": sorted(delays)[len(delays) // 2] / 1e6,
    "delay_ms_max": max(delays) / 1e6,
    "joints": list(messages["/joint_states"][0].name), "events": events(),
    "is_described": "<robot" in latched["/robot_description"][0].data,
    "rosout": [token for token in tokens if "/%rosout/" in token],
}), flush=True)

mine = {token for token in tokens if "/skillet_" in token}
until("the node leaves", lambda: mine <= left)
print(json.dumps({"left": len(mine)}), flush=True)
os._exit(0)
