"""Frames of ROS messages, for the readers beside this file."""


def xyz(v):
    return [v.x, v.y, v.z]


def turn(q, v):
    """`v` turned by the quaternion `q`, lists of x, y, z(, w)."""
    t = [2 * (q[1] * v[2] - q[2] * v[1]), 2 * (q[2] * v[0] - q[0] * v[2]), 2 * (q[0] * v[1] - q[1] * v[0])]
    return [
        v[0] + q[3] * t[0] + q[1] * t[2] - q[2] * t[1],
        v[1] + q[3] * t[1] + q[2] * t[0] - q[0] * t[2],
        v[2] + q[3] * t[2] + q[0] * t[1] - q[1] * t[0],
    ]


def by_child(message):
    """The transforms of a TFMessage by the frame they place."""
    return {t.child_frame_id: t for t in message.transforms}


def place(tip, frames):
    """Where `tip` is in the root of `frames`, and the frames from it to the root."""
    position, frame, chain = [0.0, 0.0, 0.0], tip, [tip]
    while frame in frames:
        moved = frames[frame].transform
        rotation = [*xyz(moved.rotation), moved.rotation.w]
        position = [a + b for a, b in zip(turn(rotation, position), xyz(moved.translation))]
        frame = frames[frame].header.frame_id
        chain.append(frame)
    return position, chain
