"""What MoveIt's planning scenes have said so far."""

import numpy as np
from scene_objects import (
    ADD,
    APPEND,
    IDENTITY,
    MOVE,
    REMOVE,
    Fault,
    append,
    compose,
    frame_of,
    is_same,
    move,
    read_object,
    read_pose,
    write_pose,
)

from ist_proximity.msg import WorldOctomap

OCTOMAP = "<octomap>"  # its name among MoveIt's objects
MAX_SHAPES = 100000  # of a scene; the node has limits of its own
MAX_NAMES = 20000  # of an allowed collision matrix
MAX_NAMED = 3  # objects in one sentence


def attached_name(name):
    """The world may have an object of the same name."""
    return name + " (attached)"


def sentence(name, fault, link=None):
    title = "object '%s'" % name[:200]
    return "%s: %s" % (title + (", attached to link '%s'" % link if link is not None else ""), fault)


class Attachment:
    def __init__(self, link, touch_links):
        self.link, self.touch_links = link, touch_links


class SceneState:
    """Objects by the names that the node knows them by, and faults."""

    def __init__(self, fixed_frame, use_matrix):
        self.fixed_frame, self.use_matrix = fixed_frame, use_matrix
        self.objects, self.attached = {}, {}  # the latter by the name in self.objects
        self.faults, self.attach_faults = {}, {}  # by name of the object; OCTOMAP: the octomap's
        self.octomap, self.matrix, self.matrix_fault = WorldOctomap(), {}, ""

    def apply(self, scene):
        """Takes a scene. Where a limit is passed, which raises Fault, a full scene is needed next."""
        attached = [one.object for one in scene.robot_state.attached_collision_objects]
        stated = scene.world.collision_objects + attached
        self._limit(sum(len(one.primitives) + len(one.meshes) + len(one.planes) for one in stated))
        if not scene.is_diff:
            self.objects, self.attached, self.faults, self.attach_faults = {}, {}, {}, {}
        self._attach_all(scene)
        for message in scene.world.collision_objects:
            try:
                self._change(message)
            except Fault as fault:
                self.faults[message.id] = sentence(message.id, fault)
        self._take_octomap(scene)
        self._take_matrix(scene)
        shapes = sum(len(one.shapes) for one in self.objects.values())
        self._limit(max(shapes, len(self.faults), len(self.attach_faults)))

    def _limit(self, count):
        if count > MAX_SHAPES:
            raise Fault("it has %d shapes, allowed are %d" % (count, MAX_SHAPES))

    def _remove(self, name):
        self.objects.pop(name, None)
        self.attached.pop(name, None)
        self.faults.pop(name, None)

    def _change(self, message):
        name = message.id
        if message.operation == REMOVE:
            # As in MoveIt, no name means all.
            for one in [name] if name else [k for k in {**self.objects, **self.faults} if k not in self.attached]:
                self._remove(one)
            return
        if name in self.attached:
            raise Fault("an attached object has that name as well; names must be unique")
        stated, X_PM = read_object(message, self.fixed_frame)
        known = self.objects.get(name)
        if message.operation == MOVE:
            if known is None:
                raise Fault("it is to be moved, and was never added")
            stated = move(known, stated, X_PM, message)
        elif message.operation == APPEND and known is not None:
            stated = append(known, stated, message)
        elif message.operation not in (ADD, APPEND):
            raise Fault("operation is %d; allowed is 0 to 3" % message.operation)
        if not stated.shapes:
            raise Fault("it has no shape")
        self.objects[name] = stated
        self.faults.pop(name, None)

    def _attach_all(self, scene):
        state = scene.robot_state
        joints = state.joint_state.name or state.multi_dof_joint_state.joint_names
        says_nothing = not joints and not state.attached_collision_objects
        if not (state.is_diff or says_nothing):
            for name in list(self.attached):
                self._remove(name)
            self.attach_faults = {}
        for message in state.attached_collision_objects:
            link = message.link_name.lstrip("/")
            name = attached_name(message.object.id)
            try:
                if message.object.operation == REMOVE:
                    self._detach(message.object.id, link)
                else:
                    self._attach(name, link, message)
            except Fault as fault:
                self.attach_faults[name] = sentence(message.object.id, fault, link)

    def _attach(self, name, link, message):
        """The object of the same name in the world is there no more, unless this one cannot be used."""
        if not link:
            raise Fault("no link is named")
        if name in self.objects and name not in self.attached:
            raise Fault("the scene's world has an object of that name as well; names must be unique")
        stated, _ = read_object(message.object, self.fixed_frame)
        grows = message.object.operation == APPEND and name in self.objects
        if grows or message.object.operation not in (ADD, APPEND):
            raise Fault("it can neither be moved nor grow: send all of it with ADD")
        in_world = self.objects.get(message.object.id)
        if not stated.shapes:
            if in_world is None:
                raise Fault("it has no shapes, and the scene's world has no object of this name")
            stated = in_world
        self._remove(message.object.id)
        self._remove(name)
        self.attach_faults.pop(name, None)
        self.objects[name] = stated.but(name=name, target=link)
        self.attached[name] = Attachment(link, [one.lstrip("/") for one in message.touch_links])

    def _detach(self, object_name, link):
        """Puts attached objects into the world, where they are now; no name means all of the link, or of all."""
        self.attach_faults.pop(attached_name(object_name), None)
        for name, attachment in list(self.attached.items()):
            if object_name and name != attached_name(object_name) or link and attachment.link != link:
                continue
            known = self.objects[name]
            self._remove(name)
            in_world = name[: -len(attached_name(""))]
            # As in MoveIt, an object that the world has stays what it is.
            self.objects.setdefault(in_world, known.but(name=in_world, target=self.fixed_frame))

    def restate(self, look_up):
        """Makes objects stand in their new frames, where they are now. `look_up` gives X_TB or raises Fault.

        Returns whether anything has changed."""
        is_changed = False
        for name, one in list(self.objects.items()):
            if one.target is None:
                continue
            try:
                X_TB = IDENTITY if one.target == one.frame else look_up(one.target, one.frame)
            except Fault as fault:
                text = "it moves with frame '%s' in place of '%s' from now on, but it is not known where: %s"
                is_changed |= name not in self.faults
                self.faults.setdefault(name, sentence(name, text % (one.target, one.frame, fault)))
                continue
            is_changed = True
            self.objects[name] = one.but(frame=one.target, X_BP=compose(X_TB, one.X_BP), target=None)
            self.faults.pop(name, None)
        return is_changed

    def _take_octomap(self, scene):
        stated = scene.world.octomap
        is_removed = any(one.id == OCTOMAP and one.operation == REMOVE for one in scene.world.collision_objects)
        data, kind = stated.octomap.data, stated.octomap.id
        if not (data or kind or is_removed or not scene.is_diff):
            return
        self.faults.pop(OCTOMAP, None)
        if not data:
            self.octomap = WorldOctomap()
            return
        try:
            X_BM = read_pose(stated.origin, "its origin")
            # MoveIt leaves the origin aside then, and the definition of the message does not.
            if not frame_of(stated.header) and not is_same(X_BM, IDENTITY):
                raise Fault("it has an origin and no frame_id")
        except Fault as fault:
            self.faults[OCTOMAP] = "the octomap of its planning scene cannot be used: %s" % fault
            return
        octomap = WorldOctomap(binary=stated.octomap.binary, id=kind, resolution=stated.octomap.resolution)
        octomap.header.frame_id = frame_of(stated.header) or self.fixed_frame
        octomap.data = np.array(data, np.int8).tobytes()
        write_pose(X_BM, octomap.origin)
        self.octomap = octomap

    def _take_matrix(self, scene):
        """Pairs that may touch, where both entries say so: names by name."""
        matrix = scene.allowed_collision_matrix
        names = matrix.entry_names
        if not self.use_matrix or (scene.is_diff and not names):
            return
        self.matrix, self.matrix_fault = {}, ""
        rows = [list(entry.enabled) for entry in matrix.entry_values]
        if len(names) > MAX_NAMES or [len(row) for row in rows] != [len(names)] * len(names):
            reason = "it is not square" if len(names) <= MAX_NAMES else "it has %d names" % len(names)
            self.matrix_fault = "the allowed collision matrix is not used: " + reason
        elif names:
            allowed = np.array(rows, bool)
            allowed &= allowed.T
            for name, row in zip(names, allowed):
                self.matrix[name] = {names[i] for i in np.flatnonzero(row)} - {name}

    def allowed_links(self, name):
        attachment = self.attached.get(name)
        own = attachment.touch_links + [attachment.link] if attachment else []
        in_matrix = name[: -len(attached_name(""))] if attachment else name
        links = self.matrix.get(in_matrix, set())
        return own + sorted(one for one in links if not {one, attached_name(one)} & self.objects.keys())

    def incomplete(self):
        """Why not all of the scene is known; empty: it is."""
        faults = [self.faults[name] for name in sorted(self.faults)]
        faults += [self.attach_faults[name] for name in sorted(self.attach_faults)]
        more = ["and %d more cannot be used" % (len(faults) - 1)] if len(faults) > 1 else []
        return "; ".join(faults[:1] + more)

    def doubt(self):
        """What is not measured or not used, a sentence; empty: nothing."""
        doubts = [self.matrix_fault] if self.matrix_fault else []
        if self.attached:
            some = sorted(self.attached.items())[:MAX_NAMED]
            text = ", ".join(
                "'%s' (to '%s')" % (name[: -len(attached_name(""))][:200], one.link) for name, one in some
            )
            if len(self.attached) > len(some):
                text += " and %d more" % (len(self.attached) - len(some))
            doubts.insert(
                0,
                "attached to the robot are %s: measured against the robot's other links alone, not against "
                "clouds, the octomap and other objects (~attach_object does that)" % text,
            )
        return "; ".join(doubts)
