#include <cstring>
#include <limits>

#include "peers/flat.h"

// What memory alone costs, and the simplest thing that works.
namespace ist::benchmark {
namespace {

class Memcpy : public Method {
 public:
  Memcpy() {
    name = "memcpy";
    kind = Kind::kFloor;
  }
  void ingest(const Frame& frame) override {
    copy_.resize(frame.data.size());
    std::memcpy(copy_.data(), frame.data.data(), frame.bytes());
  }
  void query(const std::vector<Eigen::Isometry3d>& /*X_FL*/,
             std::vector<Answer>* /*answers*/) override {}

 private:
  std::vector<float> copy_;
};

class BruteForce : public Method {
 public:
  explicit BruteForce(const SphereSet& set) : set_(set) {
    name = "brute force, SIMD";
    kind = Kind::kSpheres;
    spheres = set.size();
    largest_error = set.gap + kRounding;
    least_error = -set.gap;  // a ball may come out through a hole of the mesh
  }
  void ingest(const Frame& frame) override { points_.read(frame); }
  void query(const std::vector<Eigen::Isometry3d>& X_FL, std::vector<Answer>* answers) override {
    for (std::size_t link = 0; link < X_FL.size(); ++link) {
      Answer& best = (*answers)[link];
      best.distance = std::numeric_limits<double>::infinity();
      for (const SphereSet::Sphere& sphere : set_.links[link]) {
        const Eigen::Vector3d center = X_FL[link] * sphere.center;
        const std::size_t i = nearest_of_all(points_, center.cast<float>());
        const Answer answer = sphere_answer(center, sphere.radius, points_.at(i).cast<double>());
        if (answer.distance < best.distance) best = answer;
      }
    }
  }

 private:
  SphereSet set_;
  Points points_;
};

}  // namespace

void add_floors(const Robot& /*robot*/, const SphereSet& spheres, Methods* methods) {
  methods->push_back(std::make_unique<Memcpy>());
  methods->push_back(std::make_unique<BruteForce>(spheres));
}

}  // namespace ist::benchmark
