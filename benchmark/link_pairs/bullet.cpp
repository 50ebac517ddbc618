// Bullet's GJK measures convex shapes. Of two triangle meshes it has contacts within a margin
// (btGImpactMeshShape, btBvhTriangleMeshShape beside convex shapes), and no distance. So the
// meshes are measured with its parts: an AABB tree of triangles for each link, best first, and its
// GJK for two triangles.

#include <BulletCollision/BroadphaseCollision/btDbvt.h>
#include <BulletCollision/CollisionShapes/btConvexHullShape.h>
#include <BulletCollision/CollisionShapes/btTriangleShape.h>
#include <BulletCollision/NarrowPhaseCollision/btGjkPairDetector.h>
#include <BulletCollision/NarrowPhaseCollision/btPointCollector.h>
#include <BulletCollision/NarrowPhaseCollision/btVoronoiSimplexSolver.h>
#include <LinearMath/btConvexHullComputer.h>

#include <algorithm>
#include <limits>

#include "link_pairs/peers.h"

namespace ist::benchmark {
namespace {

constexpr double kTolerance = 0.001;  // [m]

btVector3 to_bullet(const Eigen::Vector3d& p) {
  return {static_cast<btScalar>(p.x()), static_cast<btScalar>(p.y()), static_cast<btScalar>(p.z())};
}

btTransform to_bullet(const Eigen::Isometry3d& X) {
  btMatrix3x3 R;
  for (int i = 0; i < 3; ++i) {
    R[i] = to_bullet(Eigen::Vector3d(X.linear().row(i).transpose()));
  }
  return btTransform(R, to_bullet(Eigen::Vector3d(X.translation())));
}

// [m] The distance of two convex shapes, 0 where they meet.
double gjk(const btConvexShape& a, const btTransform& X_A, const btConvexShape& b,
           const btTransform& X_B, btVector3* axis) {
  btVoronoiSimplexSolver simplex;
  btGjkPairDetector detector(&a, &b, &simplex, nullptr);
  detector.setCachedSeparatingAxis(*axis);
  btGjkPairDetector::ClosestPointInput input;
  input.m_transformA = X_A;
  input.m_transformB = X_B;
  btPointCollector found;
  detector.getClosestPoints(input, found, nullptr);
  *axis = detector.getCachedSeparatingAxis();
  return found.m_hasResult ? std::max(static_cast<double>(found.m_distance), 0.0) : 0.0;
}

const btVector3 kAnyAxis(0, 1, 0);

class Hulls : public PairPeer {
 public:
  explicit Hulls(const Robot& robot) : pairs_(robot.pairs), axis_(pairs_.size(), kAnyAxis) {
    for (const auto& triangles : robot.triangles) {
      std::vector<btVector3> corners;
      for (const auto& t : triangles) {
        for (const Eigen::Vector3d& p : t.p) corners.push_back(to_bullet(p));
      }
      btConvexHullComputer computer;
      computer.compute(&corners[0][0], sizeof(btVector3), static_cast<int>(corners.size()), 0, 0);
      hulls_.push_back(std::make_unique<btConvexHullShape>());
      for (int i = 0; i < computer.vertices.size(); ++i) {
        hulls_.back()->addPoint(computer.vertices[i], false);
      }
      hulls_.back()->recalcLocalAabb();
      hulls_.back()->setMargin(0);
    }
  }
  std::string name() const override { return "Bullet, convex hulls alone"; }
  double tolerance() const override { return kTolerance; }
  bool is_warm() const override { return true; }

  void run(const std::vector<Eigen::Isometry3d>& X_FL, std::vector<double>* distances) override {
    std::vector<btTransform> X;
    for (const auto& X_F : X_FL) X.push_back(to_bullet(X_F));
    for (std::size_t k = 0; k < pairs_.size(); ++k) {
      const auto [a, b] = pairs_[k];
      (*distances)[k] = gjk(*hulls_[a], X[a], *hulls_[b], X[b], &axis_[k]);
    }
  }

 private:
  std::vector<LinkPair> pairs_;
  std::vector<btVector3> axis_;  // by pair: that of the last search
  std::vector<std::unique_ptr<btConvexHullShape>> hulls_;
};

class Meshes : public PairPeer {
 public:
  explicit Meshes(const Robot& robot) : pairs_(robot.pairs), last_(pairs_.size()) {
    for (const auto& triangles : robot.triangles) {
      links_.push_back(std::make_unique<Link>());
      Link& link = *links_.back();
      for (const auto& t : triangles) {
        link.triangles.emplace_back(to_bullet(t.p[0]), to_bullet(t.p[1]), to_bullet(t.p[2]));
        link.triangles.back().setMargin(0);
      }
      for (btTriangleShape& triangle : link.triangles) {
        btDbvtVolume box = btDbvtVolume::FromPoints(triangle.m_vertices1, 3);
        link.tree.insert(box, &triangle);
      }
      link.tree.optimizeTopDown();
    }
  }
  std::string name() const override { return "Bullet, triangles, to 1 mm, warm"; }
  double tolerance() const override { return kTolerance; }
  bool is_warm() const override { return true; }

  void run(const std::vector<Eigen::Isometry3d>& X_FL, std::vector<double>* distances) override {
    for (std::size_t k = 0; k < pairs_.size(); ++k) (*distances)[k] = search(k, X_FL);
  }

 private:
  struct Link {
    std::vector<btTriangleShape> triangles;
    btDbvt tree;
  };
  struct Entry {
    btScalar bound;  // [m]
    const btDbvtNode *a, *b;
    bool operator<(const Entry& other) const { return bound > other.bound; }  // least on top
  };
  struct Closest {
    const btTriangleShape *a = nullptr, *b = nullptr;
  };

  // [m] Between the box of A and the box about that of B, along A's axes.
  btScalar bound(const btDbvtNode& a, const btDbvtNode& b) const {
    const btVector3 center = X_AB_ * b.volume.Center(), half = absolute_ * b.volume.Extents();
    btVector3 gap = (center - a.volume.Center()).absolute() - half - a.volume.Extents();
    gap.setMax(btVector3(0, 0, 0));
    return gap.length();
  }

  double measure(const btTriangleShape* a, const btTriangleShape* b) {
    btVector3 axis = kAnyAxis;
    return gjk(*a, btTransform::getIdentity(), *b, X_AB_, &axis);
  }

  double search(std::size_t pair, const std::vector<Eigen::Isometry3d>& X_FL) {
    const auto [a, b] = pairs_[pair];
    X_AB_ = to_bullet(Eigen::Isometry3d(X_FL[a].inverse() * X_FL[b]));
    absolute_ = X_AB_.getBasis().absolute();
    Closest& closest = last_[pair];
    double least = std::numeric_limits<double>::infinity();
    if (closest.a != nullptr) least = measure(closest.a, closest.b);
    queue_.clear();
    push(links_[a]->tree.m_root, links_[b]->tree.m_root);
    while (!queue_.empty() && static_cast<double>(queue_.front().bound) < least - kTolerance) {
      std::pop_heap(queue_.begin(), queue_.end());
      const Entry entry = queue_.back();
      queue_.pop_back();
      if (entry.a->isleaf() && entry.b->isleaf()) {
        const auto* of_a = static_cast<const btTriangleShape*>(entry.a->data);
        const auto* of_b = static_cast<const btTriangleShape*>(entry.b->data);
        const double distance = measure(of_a, of_b);
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
    queue_.push_back({bound(*a, *b), a, b});
    std::push_heap(queue_.begin(), queue_.end());
  }

  std::vector<LinkPair> pairs_;
  std::vector<Closest> last_;  // by pair
  std::vector<std::unique_ptr<Link>> links_;
  btTransform X_AB_;
  btMatrix3x3 absolute_;
  std::vector<Entry> queue_;  // a heap
};

}  // namespace

std::vector<std::unique_ptr<PairPeer>> bullet_peers(const Robot& robot) {
  std::vector<std::unique_ptr<PairPeer>> peers;
  peers.push_back(std::make_unique<Hulls>(robot));
  peers.push_back(std::make_unique<Meshes>(robot));
  return peers;
}

}  // namespace ist::benchmark
