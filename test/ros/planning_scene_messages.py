"""moveit_msgs/PlanningScene without its package: classes that genpy makes of the definitions' text.

genpy computes the md5sums and writes the bytes, so that the node's own reader is compared with the format
itself. Comments of the definitions are left out; they are no part of the md5sum.
"""

import functools
import hashlib

import genpy.dynamic
import geometry_msgs.msg
from sensor_msgs.msg import JointState, MultiDOFJointState
from std_msgs.msg import ColorRGBA, Header
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

# The fields as of moveit_msgs 0.11 and later (Noetic), by message, and those that others have.
SCENE = """string name
RobotState robot_state
string robot_model_name
geometry_msgs/TransformStamped[] fixed_frame_transforms
AllowedCollisionMatrix allowed_collision_matrix
LinkPadding[] link_padding
LinkScale[] link_scale
ObjectColor[] object_colors
PlanningSceneWorld world
bool is_diff
"""
POSE = "geometry_msgs/Pose pose\n"
SUBFRAMES = "string[] subframe_names\ngeometry_msgs/Pose[] subframe_poses\n"
OBJECT = """Header header
%sstring id
object_recognition_msgs/ObjectType type
shape_msgs/SolidPrimitive[] primitives
geometry_msgs/Pose[] primitive_poses
shape_msgs/Mesh[] meshes
geometry_msgs/Pose[] mesh_poses
shape_msgs/Plane[] planes
geometry_msgs/Pose[] plane_poses
%sbyte ADD=0
byte REMOVE=1
byte APPEND=2
byte MOVE=3
byte operation
"""
OTHERS = {
    "moveit_msgs/RobotState": """sensor_msgs/JointState joint_state
sensor_msgs/MultiDOFJointState multi_dof_joint_state
AttachedCollisionObject[] attached_collision_objects
bool is_diff
""",
    "moveit_msgs/AttachedCollisionObject": """string link_name
CollisionObject object
string[] touch_links
trajectory_msgs/JointTrajectory detach_posture
float64 weight
""",
    "object_recognition_msgs/ObjectType": "string key\nstring db\n",
    "shape_msgs/SolidPrimitive": """uint8 BOX=1
uint8 SPHERE=2
uint8 CYLINDER=3
uint8 CONE=4
uint8 type
float64[] dimensions
uint8 BOX_X=0
uint8 BOX_Y=1
uint8 BOX_Z=2
uint8 SPHERE_RADIUS=0
uint8 CYLINDER_HEIGHT=0
uint8 CYLINDER_RADIUS=1
uint8 CONE_HEIGHT=0
uint8 CONE_RADIUS=1
""",
    "shape_msgs/Mesh": "MeshTriangle[] triangles\ngeometry_msgs/Point[] vertices\n",
    "shape_msgs/MeshTriangle": "uint32[3] vertex_indices\n",
    "shape_msgs/Plane": "float64[4] coef\n",
    "moveit_msgs/AllowedCollisionMatrix": "string[] entry_names\nAllowedCollisionEntry[] entry_values\n"
    "string[] default_entry_names\nbool[] default_entry_values\n",
    "moveit_msgs/AllowedCollisionEntry": "bool[] enabled\n",
    "moveit_msgs/LinkPadding": "string link_name\nfloat64 padding\n",
    "moveit_msgs/LinkScale": "string link_name\nfloat64 scale\n",
    "moveit_msgs/ObjectColor": "string id\nstd_msgs/ColorRGBA color\n",
    "moveit_msgs/PlanningSceneWorld": "CollisionObject[] collision_objects\n"
    "octomap_msgs/OctomapWithPose octomap\n",
    "octomap_msgs/OctomapWithPose": "Header header\ngeometry_msgs/Pose origin\n"
    "octomap_msgs/Octomap octomap\n",
    "octomap_msgs/Octomap": "Header header\nbool binary\nstring id\nfloat64 resolution\nint8[] data\n",
}
# Those that are installed.
for kind in "Point Pose Quaternion Transform TransformStamped Twist Vector3 Wrench".split():
    OTHERS["geometry_msgs/" + kind] = getattr(geometry_msgs.msg, kind)._full_text.split("=" * 80)[0]
for kind in (ColorRGBA, Header, JointState, JointTrajectory, JointTrajectoryPoint, MultiDOFJointState):
    OTHERS[kind._type] = kind._full_text.split("=" * 80)[0]

COMPONENTS = """uint32 SCENE_SETTINGS=1
uint32 ROBOT_STATE=2
uint32 ROBOT_STATE_ATTACHED_OBJECTS=4
uint32 WORLD_OBJECT_NAMES=8
uint32 WORLD_OBJECT_GEOMETRY=16
uint32 OCTOMAP=32
uint32 TRANSFORMS=64
uint32 ALLOWED_COLLISION_MATRIX=128
uint32 LINK_PADDING_AND_SCALING=256
uint32 OBJECT_COLORS=512
uint32 components
"""


def get_planning_scene_type(types):
    """The service moveit_msgs/GetPlanningScene, for the classes of planning_scene_types()."""
    components = genpy.dynamic.generate_dynamic("moveit_msgs/PlanningSceneComponents", COMPONENTS)
    Components = components["moveit_msgs/PlanningSceneComponents"]
    Scene = types["moveit_msgs/PlanningScene"]

    class Request(Components):
        """The request's one field is of that type, so its bytes are the same."""

    class Response(Scene):
        """The response's one field is the scene."""

    # As genmsg does it: of the text of the request and of the response, types by their md5sums.
    text = "%s components%s scene" % (Components._md5sum, Scene._md5sum)

    class Service:
        """What rospy.Service needs."""

        _type = "moveit_msgs/GetPlanningScene"
        _md5sum = hashlib.md5(text.encode()).hexdigest()
        _request_class = Request
        _response_class = Response

    return Service


@functools.lru_cache
def planning_scene_types(is_noetic):
    """Classes by the names of messages: moveit_msgs/PlanningScene and all that it holds."""
    definitions = dict(OTHERS)
    definitions["moveit_msgs/CollisionObject"] = OBJECT % ((POSE, SUBFRAMES) if is_noetic else ("", ""))
    text = SCENE
    for name, fields in definitions.items():
        text += "\n" + "=" * 80 + "\nMSG: %s\n%s" % (name, fields)
    return genpy.dynamic.generate_dynamic("moveit_msgs/PlanningScene", text)
