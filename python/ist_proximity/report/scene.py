"""The scene of a report: points of a file, or of a message in a bag."""

import dataclasses
import io
import pathlib

import numpy as np


class SceneError(Exception):
    """A scene that cannot be read; the text says why and what to do."""


@dataclasses.dataclass
class Scene:
    """Points, where they were seen from, and the joints at that instant."""

    points: object  # what Obstacles takes: a path, or a message
    sensor_pose: np.ndarray  # (4, 4), frame of the points -> root link's frame
    positions: dict  # joint positions [rad, m] by name; empty: not known
    origin: str  # where it comes from, for the reader


def pose(xyz_rpy):
    """(4, 4) of x y z roll pitch yaw [m, rad], fixed axes, as in a URDF."""
    x, y, z, roll, pitch, yaw = xyz_rpy
    cr, cp, cy = np.cos((roll, pitch, yaw))
    sr, sp, sy = np.sin((roll, pitch, yaw))
    X = np.eye(4)
    X[:3, :3] = [[cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
                 [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
                 [-sp, cp * sr, cp * cr]]
    X[:3, 3] = x, y, z
    return X


def load(path, root_link, topic=None, sensor_pose=None):
    """Reads a scene.

    path: .pcd, .ply or .bag. root_link: of the robot. topic: of a bag's cloud; None: the only one.
    sensor_pose: x y z roll pitch yaw of the points' frame in the root link's frame; None: from the
    bag's transforms, or the same frame.
    """
    path = pathlib.Path(path)
    if path.suffix.lower() == '.bag':
        return _load_bag(path, root_link, topic, sensor_pose)
    X = np.eye(4) if sensor_pose is None else pose(sensor_pose)
    return Scene(str(path), X, {}, path.name)


def _clouds(bag, topic):
    topics = bag.get_type_and_topic_info().topics
    found = [name for name, info in topics.items() if info.msg_type == 'sensor_msgs/PointCloud2']
    if topic is None and len(found) == 1:
        return found[0]
    if topic in found:
        return topic
    listed = ', '.join(found) or 'none'
    raise SceneError(f'choose the topic of the cloud with --topic; PointCloud2 in the bag: {listed}')


def _load_bag(path, root_link, topic, sensor_pose):
    try:
        import rosbag
        import tf2_py
    except ImportError as error:
        raise SceneError(f'a bag needs ROS on this machine ({error})') from error
    try:
        bag = rosbag.Bag(str(path))
    except (rosbag.ROSBagException, OSError) as error:
        raise SceneError(f'{path} cannot be read as a bag: {error}') from error
    with bag:
        topic = _clouds(bag, topic)
        count = bag.get_message_count(topic)
        if count == 0:
            raise SceneError(f'the bag has no message on {topic}')
        # The one in the middle: at the start transforms may be missing.
        cloud = None
        for index, (_, message, _) in enumerate(bag.read_messages(topics=[topic])):
            cloud = message
            if index >= count // 2:
                break
        X = pose(sensor_pose) if sensor_pose is not None else _transform(
            bag, tf2_py, root_link, cloud.header)
        positions = _joint_positions(bag, cloud.header.stamp)
    origin = f'{path.name}, {topic}, message {count // 2 + 1} of {count}'
    return Scene(cloud, X, positions, origin)


def _transform(bag, tf2_py, root_link, header):
    import rospy
    from geometry_msgs.msg import TransformStamped
    frame = header.frame_id.lstrip('/')
    if frame == root_link:
        return np.eye(4)
    buffer = tf2_py.BufferCore(rospy.Duration(1e6))
    for topic, message, _ in bag.read_messages(topics=['/tf', '/tf_static', 'tf', 'tf_static']):
        for raw in message.transforms:
            # A bag's own types have the same bytes, and tf2 wants those of geometry_msgs.
            buffer_of_bytes = io.BytesIO()
            raw.serialize(buffer_of_bytes)
            transform = TransformStamped().deserialize(buffer_of_bytes.getvalue())
            if topic.endswith('static'):
                buffer.set_transform_static(transform, 'bag')
            else:
                buffer.set_transform(transform, 'bag')
    try:
        found = buffer.lookup_transform_core(root_link, frame, header.stamp).transform
    except tf2_py.TransformException as error:
        raise SceneError(f"the bag has no transform from the cloud's frame {frame!r} to the robot's "
                         f'root link {root_link!r} ({error}); give --sensor-pose') from error
    q = np.array([found.rotation.x, found.rotation.y, found.rotation.z, found.rotation.w])
    x, y, z, w = q / np.linalg.norm(q)
    X = np.eye(4)
    X[:3, :3] = [[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                 [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                 [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]
    X[:3, 3] = found.translation.x, found.translation.y, found.translation.z
    return X


def _joint_positions(bag, stamp):
    """The joint positions whose stamps are nearest to `stamp`."""
    nearest, positions = {}, {}
    for _, message, _ in bag.read_messages(topics=['/joint_states', 'joint_states']):
        age = abs((message.header.stamp - stamp).to_sec())
        for name, position in zip(message.name, message.position):
            if age < nearest.get(name, np.inf):
                nearest[name], positions[name] = age, position
    return positions
