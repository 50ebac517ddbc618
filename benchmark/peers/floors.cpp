#include <cstring>

#include "peers/flat.h"

// The cost of reading memory alone, and the simplest method that works.
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

class BruteForce : public BySpheres {
 public:
  explicit BruteForce(const SphereSet& set) : BySpheres(set) {
    name = "brute force, SIMD";
    kind = Kind::kSpheres;
    largest_error = set.gap + kRounding;
    least_error = -set.gap;  // a sphere may protrude through a hole of the mesh
  }
  void ingest(const Frame& frame) override { points_.read(frame); }

 protected:
  bool nearest(const Eigen::Vector3d& center, double /*max_distance*/, Nearest* found) override {
    found->p_FCo = points_.at(nearest_of_all(points_, center.cast<float>())).cast<double>();
    found->distance = (found->p_FCo - center).norm();
    return true;
  }

 private:
  Points points_;
};

}  // namespace

void add_floors(const Robot& /*robot*/, const SphereSet& spheres, Methods* methods) {
  methods->push_back(std::make_unique<Memcpy>());
  methods->push_back(std::make_unique<BruteForce>(spheres));
}

}  // namespace ist::benchmark
