"""Reads a ROS 2 bag with two independent readers and says what is in it, as JSON; see tests/python.rs.

    read_bag.py BAG RECORDING [--rounded]

`rosbags` reads folder and metadata, `mcap-ros2-support` the file alone; neither needs ROS. What both read is compared with
the recording that the bag was made of; with --rounded the bag was made of a session, and a recording of the same trial is
rounded.
"""

import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path

from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory as ProtobufFactory
from mcap_ros2.decoder import DecoderFactory as Ros2Factory
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from ros_frames import by_child, place, xyz

bag, recording, is_rounded = Path(sys.argv[1]), Path(sys.argv[2]), "--rounded" in sys.argv


def plain(message):
    """A message as nested lists of its values, whichever reader has made it."""
    if isinstance(message, (str, int, float)):
        return message
    if hasattr(message, "__slots__") or hasattr(message, "__dataclass_fields__"):
        names = getattr(message, "__dataclass_fields__", None) or message.__slots__
        return [plain(getattr(message, name)) for name in names if not name.startswith("_")]
    return [plain(value) for value in message]


def stamp_ns(time):
    return time.sec * 10**9 + time.nanosec


# With the definitions that the bag brings; they must be those of ROS.
ros, own = get_typestore(Stores.ROS2_JAZZY), get_typestore(Stores.EMPTY)
by_rosbags, types = {}, {}
with Reader(bag) as reader:
    for connection in reader.connections:
        own.register(get_types_from_msg(connection.msgdef.data, connection.msgtype))
        assert own.hash_rihs01(connection.msgtype) == ros.hash_rihs01(connection.msgtype) == connection.digest, connection
        types[connection.topic] = connection.msgtype
        by_rosbags[connection.topic] = []
    for connection, at_ns, data in reader.messages():
        message = own.deserialize_cdr(data, connection.msgtype)
        assert bytes(ros.serialize_cdr(message, connection.msgtype)) == bytes(data), connection.topic
        by_rosbags[connection.topic].append((at_ns, message))
    counts = {topic: len(messages) for topic, messages in by_rosbags.items()}
    assert counts == {connection.topic: connection.msgcount for connection in reader.connections}

by_mcap = {topic: [] for topic in by_rosbags}
with open(bag / f"{bag.name}_0.mcap", "rb") as file:
    reader = make_reader(file, validate_crcs=True, decoder_factories=[Ros2Factory()])
    assert reader.get_header().profile == "ros2"
    for schema, channel, message, decoded in reader.iter_decoded_messages():
        assert schema.encoding == "ros2msg" and channel.message_encoding == "cdr"
        by_mcap[channel.topic].append((message.log_time, decoded))
for topic, messages in by_rosbags.items():
    assert len(messages) == len(by_mcap[topic]), topic
    for (at_ns, one), (also_at_ns, other) in zip(messages, by_mcap[topic]):
        assert at_ns == also_at_ns and plain(one) == plain(other), (topic, at_ns)

# Joint states are the recorded ones, tick by tick.
joints = {at_ns: message for at_ns, message in by_rosbags["/joint_states"]}
n_ticks = 0
with open(recording, "rb") as file:
    reader = make_reader(file, decoder_factories=[ProtobufFactory()])
    for schema, channel, message, tick in reader.iter_decoded_messages(topics=["/tick"]):
        state = joints[message.log_time]
        assert stamp_ns(state.header.stamp) == message.log_time
        # Half a step of the grids of a recording.
        for found, recorded, step in [
            (state.position, tick.q_rad, 2**-15), (state.velocity, tick.qd_rad_s, 2**-9), (state.effort, tick.tau_n_m, 2**-6)
        ]:
            assert len(found) == len(recorded)
            assert all(abs(a - b) <= step * is_rounded for a, b in zip(found, recorded)), (message.log_time, step)
        n_ticks += 1
assert n_ticks == len(joints)

# The frames lead from the root to the tip, where the pose says it is.
fixed = by_child(by_rosbags["/tf_static"][0][1])
poses = dict(by_rosbags["/skillet/pose"])
tip = by_rosbags["/skillet/wrench"][0][1].header.frame_id
gap = 0.0
for at_ns, message in by_rosbags["/tf"]:
    assert all(stamp_ns(t.header.stamp) == at_ns for t in message.transforms)
    position, chain = place(tip, fixed | by_child(message))
    assert chain[-1] == poses[at_ns].header.frame_id
    gap = max(gap, math.dist(position, xyz(poses[at_ns].pose.position)))

# The whole bag in the other storage of rosbag2.
with tempfile.TemporaryDirectory() as folder:
    converted = Path(folder) / "sqlite"
    convert = [sys.executable, "-m", "rosbags.convert", "--src", bag, "--dst", converted, "--dst-storage", "sqlite3"]
    subprocess.run(convert, check=True, stdout=subprocess.DEVNULL)
    with Reader(converted) as reader:
        assert reader.message_count == sum(counts.values())

events = [json.loads(message.data) for _, message in by_rosbags["/skillet/policy"]]
description = by_rosbags["/robot_description"][0][1].data
print(json.dumps({
    "types": types, "counts": counts, "events": events, "gap_m": gap, "chain": chain,
    "joints": list(by_rosbags["/joint_states"][0][1].name),
    "objects": sorted({t.child_frame_id for _, m in by_rosbags["/tf"] for t in m.transforms} - set(chain)),
    "is_described": "<robot" in description,
    "desired_gap_m": max(math.dist(xyz(poses[at].pose.position), xyz(m.pose.position)) for at, m in by_rosbags["/skillet/pose_desired"]),
    "force_n": max(math.hypot(*xyz(m.wrench.force)) for _, m in by_rosbags["/skillet/wrench"]),
}))
