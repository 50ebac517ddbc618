#include <limits>
#include <nanoflann.hpp>
#include <optional>

#include "peers/flat.h"

// A k-d tree over all points, asked for the point nearest to each sphere.
namespace ist::benchmark {
namespace {

struct Cloud {
  Points points;
  std::size_t kdtree_get_point_count() const { return points.size(); }
  float kdtree_get_pt(std::size_t i, std::size_t axis) const {
    return axis == 0 ? points.x[i] : axis == 1 ? points.y[i] : points.z[i];
  }
  template <typename Box>
  bool kdtree_get_bbox(Box& /*box*/) const {
    return false;
  }
};

using Tree =
    nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Cloud>, Cloud, 3>;

class Nanoflann : public Method {
 public:
  explicit Nanoflann(const SphereSet& set) : set_(set) {
    name = "nanoflann";
    kind = Kind::kSpheres;
    spheres = set.size();
    largest_error = set.gap + kRounding;
    least_error = -set.gap;
  }

  void ingest(const Frame& frame) override {
    tree_.reset();
    cloud_.points.read(frame);
    tree_.emplace(3, cloud_, nanoflann::KDTreeSingleIndexAdaptorParams(16));
    tree_->buildIndex();
  }

  void query(const std::vector<Eigen::Isometry3d>& X_FL, std::vector<Answer>* answers) override {
    for (std::size_t link = 0; link < X_FL.size(); ++link) {
      Answer& best = (*answers)[link];
      best.distance = std::numeric_limits<double>::infinity();
      for (const SphereSet::Sphere& sphere : set_.links[link]) {
        const Eigen::Vector3d center = X_FL[link] * sphere.center;
        const Eigen::Vector3f c = center.cast<float>();
        std::size_t index = 0;
        float distance_sq = 0.0F;
        nanoflann::KNNResultSet<float> found(1);
        found.init(&index, &distance_sq);
        // Only what is nearer than the link's other spheres are.
        const auto bound = static_cast<float>(best.distance + sphere.radius);
        if (bound <= 0.0F) continue;
        if (bound < 1e15F) distance_sq = bound * bound;
        tree_->findNeighbors(found, c.data(), nanoflann::SearchParams());
        if (found.size() == 0) continue;
        const Answer answer =
            sphere_answer(center, sphere.radius, cloud_.points.at(index).cast<double>());
        if (answer.distance < best.distance) best = answer;
      }
    }
  }

 private:
  SphereSet set_;
  Cloud cloud_;
  std::optional<Tree> tree_;
};

}  // namespace

void add_nanoflann(const SphereSet& spheres, Methods* methods) {
  methods->push_back(std::make_unique<Nanoflann>(spheres));
}

}  // namespace ist::benchmark
