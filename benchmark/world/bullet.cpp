#include "world/bullet.h"

#include <BulletCollision/BroadphaseCollision/btDbvt.h>
#include <BulletCollision/CollisionShapes/btBoxShape.h>
#include <BulletCollision/CollisionShapes/btCylinderShape.h>
#include <BulletCollision/CollisionShapes/btSphereShape.h>
#include <BulletCollision/CollisionShapes/btTriangleShape.h>
#include <BulletCollision/NarrowPhaseCollision/btGjkPairDetector.h>
#include <BulletCollision/NarrowPhaseCollision/btPointCollector.h>
#include <BulletCollision/NarrowPhaseCollision/btVoronoiSimplexSolver.h>

#include <algorithm>
#include <unordered_map>
#include <utility>
#include <variant>

namespace ist::benchmark {
namespace {

constexpr double kTolerance = 0.001;  // [m]
constexpr double kMaxDistance = 1.0;  // [m]

btVector3 to_bullet(const Eigen::Vector3d& p) {
  return {static_cast<btScalar>(p.x()), static_cast<btScalar>(p.y()), static_cast<btScalar>(p.z())};
}

btTransform to_bullet(const Eigen::Isometry3d& X) {
  btMatrix3x3 R;
  for (int i = 0; i < 3; ++i) R[i] = to_bullet(Eigen::Vector3d(X.linear().row(i).transpose()));
  return btTransform(R, to_bullet(Eigen::Vector3d(X.translation())));
}

// [m] The distance of two convex shapes, 0 where they meet.
double gjk(const btConvexShape& a, const btConvexShape& b, const btTransform& X_AB) {
  btVoronoiSimplexSolver simplex;
  btGjkPairDetector detector(&a, &b, &simplex, nullptr);
  btGjkPairDetector::ClosestPointInput input;
  input.m_transformA = btTransform::getIdentity();
  input.m_transformB = X_AB;
  btPointCollector found;
  detector.getClosestPoints(input, found, nullptr);
  return found.m_hasResult ? std::max(static_cast<double>(found.m_distance), 0.0) : 0.0;
}

// A convex shape, or triangles: the leaves of a tree, in the element's frame. A convex shape is the
// only leaf.
struct Element {
  std::vector<std::unique_ptr<btConvexShape>> shapes;
  btDbvt tree;
  std::size_t body = 0;    // link, or frame
  Eigen::Isometry3d X_BE;  // element frame -> the body's

  void add(std::unique_ptr<btConvexShape> shape) {
    btVector3 low, high;
    shape->getAabb(btTransform::getIdentity(), low, high);
    tree.insert(btDbvtVolume::FromMM(low, high), shape.get());
    shapes.push_back(std::move(shape));
  }
};

void add_shape(const Shape& shape, Element* element) {
  if (const auto* box = std::get_if<Box>(&shape)) {
    auto one = std::make_unique<btBoxShape>(to_bullet(0.5 * box->size));
    one->setMargin(0);
    element->add(std::move(one));
  } else if (const auto* cylinder = std::get_if<Cylinder>(&shape)) {
    const Eigen::Vector3d half(cylinder->radius, cylinder->radius, 0.5 * cylinder->length);
    auto one = std::make_unique<btCylinderShapeZ>(to_bullet(half));
    one->setMargin(0);
    element->add(std::move(one));
  } else if (const auto* sphere = std::get_if<Sphere>(&shape)) {
    element->add(std::make_unique<btSphereShape>(static_cast<btScalar>(sphere->radius)));
  } else {
    const auto& mesh = std::get<TriangleMesh>(shape);
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      auto one = std::make_unique<btTriangleShape>(
          to_bullet(mesh.corner(t, 0)), to_bullet(mesh.corner(t, 1)), to_bullet(mesh.corner(t, 2)));
      one->setMargin(0);
      element->add(std::move(one));
    }
    element->tree.optimizeTopDown();
  }
}

std::vector<std::unique_ptr<Element>> elements_of(const LinkGeometry& geometry, std::size_t body,
                                                  const Eigen::Isometry3d& X) {
  std::vector<std::unique_ptr<Element>> elements;
  for (const GeometryElement& one : geometry) {
    elements.push_back(std::make_unique<Element>());
    elements.back()->body = body;
    elements.back()->X_BE = X * one.X_LE;
    add_shape(one.shape, elements.back().get());
  }
  return elements;
}

class Peer : public BulletWorld {
 public:
  Peer(const std::vector<LinkGeometry>& links, const std::vector<WorldObject>& objects,
       const std::vector<std::size_t>& frames)
      : links_(links.size()) {
    for (std::size_t i = 0; i < links.size(); ++i) {
      for (auto& one : elements_of(links[i], i, Eigen::Isometry3d::Identity())) {
        robot_.push_back(std::move(one));
      }
    }
    for (std::size_t i = 0; i < objects.size(); ++i) {
      for (auto& one : elements_of(objects[i].geometry, frames[i], objects[i].X_BO)) {
        world_.push_back(std::move(one));
      }
    }
    last_.resize(robot_.size());
    nearest_object_.assign(robot_.size(), 0);
  }

  const std::vector<double>& run(const std::vector<Eigen::Isometry3d>& X_FL,
                                 const std::vector<Eigen::Isometry3d>& X_FB) override {
    place(X_FB);
    nearest_.assign(links_, kMaxDistance);
    for (std::size_t i = 0; i < robot_.size(); ++i) {
      double* least = &nearest_[robot_[i]->body];
      *least = search(i, X_FL[robot_[i]->body] * robot_[i]->X_BE, *least);
    }
    return nearest_;
  }

 private:
  struct Entry {
    btScalar bound;  // [m]
    const btDbvtNode *a, *b;
    bool operator<(const Entry& other) const { return bound > other.bound; }  // least on top
  };
  struct Closest {
    const btConvexShape *a = nullptr, *b = nullptr;
  };

  static btDbvtVolume placed(const btDbvtVolume& box, const btTransform& X) {
    const btVector3 center = X * box.Center();
    return btDbvtVolume::FromCE(center, X.getBasis().absolute() * box.Extents());
  }

  // The tree over all elements of the world; those that have moved are updated.
  void place(const std::vector<Eigen::Isometry3d>& X_FB) {
    const bool is_first = leaves_.empty();
    for (std::size_t i = 0; i < world_.size(); ++i) {
      Element& one = *world_[i];
      const bool moved = is_first || X_FB[one.body].matrix() != X_FB_[one.body].matrix();
      if (!moved) continue;
      const Eigen::Isometry3d X_FE = X_FB[one.body] * one.X_BE;
      btDbvtVolume box = placed(one.tree.m_root->volume, to_bullet(X_FE));
      if (is_first) {
        X_FE_.push_back(X_FE);
        indices_.push_back(i);
      } else {
        X_FE_[i] = X_FE;
        broad_.update(leaves_[i], box);
      }
      if (is_first) boxes_.push_back(box);
    }
    X_FB_ = X_FB;
    if (!is_first) return;
    for (std::size_t i = 0; i < world_.size(); ++i) {
      leaves_.push_back(broad_.insert(boxes_[i], &indices_[i]));
    }
    broad_.optimizeTopDown();
  }

  static btScalar gap(const btDbvtVolume& a, const btDbvtVolume& b) {
    btVector3 gap = (b.Center() - a.Center()).absolute() - b.Extents() - a.Extents();
    gap.setMax(btVector3(0, 0, 0));
    return gap.length();
  }

  // [m] The least distance of an element of the robot, or `least` where none is less.
  double search(std::size_t i, const Eigen::Isometry3d& X_FA, double least) {
    const auto before = last_[i].find(nearest_object_[i]);
    if (before != last_[i].end() && before->second.a != nullptr) {
      const Closest& closest = before->second;
      const Eigen::Isometry3d X_AB = X_FA.inverse() * X_FE_[before->first];
      least = std::min(least, gjk(*closest.a, *closest.b, to_bullet(X_AB)));
    }
    const btDbvtVolume box = placed(robot_[i]->tree.m_root->volume, to_bullet(X_FA));
    std::vector<Entry>& queue = broad_queue_;
    queue.assign(1, {gap(box, broad_.m_root->volume), broad_.m_root, nullptr});
    while (!queue.empty() && static_cast<double>(queue.front().bound) < least - kTolerance) {
      std::pop_heap(queue.begin(), queue.end());
      const btDbvtNode* node = queue.back().a;
      queue.pop_back();
      if (node->isleaf()) {
        const std::size_t object = *static_cast<const std::size_t*>(node->data);
        const double distance = measure(i, object, X_FA.inverse() * X_FE_[object], least);
        if (distance < least) nearest_object_[i] = object;
        least = std::min(least, distance);
        continue;
      }
      for (const btDbvtNode* child : node->childs) {
        queue.push_back({gap(box, child->volume), child, nullptr});
        std::push_heap(queue.begin(), queue.end());
      }
    }
    return least;
  }

  // [m] Of two elements, best first over their leaves.
  double measure(std::size_t i, std::size_t object, const Eigen::Isometry3d& X, double least) {
    X_AB_ = to_bullet(X);
    absolute_ = X_AB_.getBasis().absolute();
    Closest& closest = last_[i][object];
    if (closest.a != nullptr) least = std::min(least, gjk(*closest.a, *closest.b, X_AB_));
    queue_.clear();
    push(robot_[i]->tree.m_root, world_[object]->tree.m_root);
    while (!queue_.empty() && static_cast<double>(queue_.front().bound) < least - kTolerance) {
      std::pop_heap(queue_.begin(), queue_.end());
      const Entry entry = queue_.back();
      queue_.pop_back();
      if (entry.a->isleaf() && entry.b->isleaf()) {
        const auto* of_a = static_cast<const btConvexShape*>(entry.a->data);
        const auto* of_b = static_cast<const btConvexShape*>(entry.b->data);
        const double distance = gjk(*of_a, *of_b, X_AB_);
        if (distance < least) {
          least = distance;
          closest = {of_a, of_b};
        }
      } else if (entry.b->isleaf() ||
                 (entry.a->isinternal() &&
                  entry.a->volume.Lengths().length2() > entry.b->volume.Lengths().length2())) {
        for (const btDbvtNode* child : entry.a->childs) push(child, entry.b);
      } else {
        for (const btDbvtNode* child : entry.b->childs) push(entry.a, child);
      }
    }
    return least;
  }

  void push(const btDbvtNode* a, const btDbvtNode* b) {
    const btVector3 center = X_AB_ * b->volume.Center(), half = absolute_ * b->volume.Extents();
    btVector3 apart = (center - a->volume.Center()).absolute() - half - a->volume.Extents();
    apart.setMax(btVector3(0, 0, 0));
    queue_.push_back({apart.length(), a, b});
    std::push_heap(queue_.begin(), queue_.end());
  }

  std::size_t links_;
  std::vector<std::unique_ptr<Element>> robot_, world_;
  std::vector<std::unordered_map<std::size_t, Closest>> last_;  // by the robot's element, by object
  std::vector<std::size_t> nearest_object_;                     // by the robot's element
  btDbvt broad_;
  std::vector<btDbvtNode*> leaves_;   // by the world's element
  std::vector<btDbvtVolume> boxes_;   // likewise, at first
  std::vector<std::size_t> indices_;  // likewise
  std::vector<Eigen::Isometry3d> X_FE_, X_FB_;
  btTransform X_AB_;
  btMatrix3x3 absolute_;
  std::vector<Entry> queue_, broad_queue_;  // heaps
  std::vector<double> nearest_;
};

}  // namespace

std::unique_ptr<BulletWorld> bullet_world(const std::vector<LinkGeometry>& links,
                                          const std::vector<WorldObject>& objects,
                                          const std::vector<std::size_t>& frames) {
  return std::make_unique<Peer>(links, objects, frames);
}

}  // namespace ist::benchmark
