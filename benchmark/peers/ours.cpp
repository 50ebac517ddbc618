#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "peers/method.h"
#include "support/whole_cloud.h"

namespace ist::benchmark {
namespace {

// max_error decides the speed, the tolerance the error.
constexpr double kMaxErrors[] = {0.01, 0.005, 0.002};        // [m]
constexpr double kTolerances[] = {0.0, 0.001, 0.005, 0.02};  // [m]

class Ours : public Method {
 public:
  Ours(const std::shared_ptr<const RobotModel>& model, double max_error_, double tolerance_)
      : ingest_(test::whole_cloud(false)),
        query_(model, config(tolerance_)),
        known_(model->links.size(), true) {
    name = "ist_proximity";
    kind = "ours";
    max_error = max_error_;
    tolerance = tolerance_;
    largest_error = tolerance + kRounding;
    for (const LinkModel& link : model->links) spheres += link.tree.sphere_count();
  }

  void ingest(const Frame& frame) override {
    ingest_.run(frame.raw(), frame.X_FS, {}, 0.0, &snapshot_);
  }

  void query(const Poses& X_FL, std::vector<Answer>* answers) override {
    query_.run(X_FL, known_, {&snapshot_}, &results_);
    for (std::size_t i = 0; i < results_.size(); ++i) {
      (*answers)[i] = {results_[i].distance, results_[i].p_FCl, results_[i].p_FCo};
    }
  }

 private:
  static QueryConfig config(double tolerance) {
    QueryConfig config;
    config.max_distance = 10.0;
    config.tolerance = tolerance;
    return config;
  }

  Ingest ingest_;
  CloudSnapshot snapshot_;
  ProximityQuery query_;
  std::vector<bool> known_;
  std::vector<LinkProximity> results_;
};

}  // namespace

void add_ours(const Robot& robot, Methods* methods) {
  for (const double max_error : kMaxErrors) {
    const auto model = robot.pack(max_error);
    for (const double tolerance : kTolerances) {
      methods->push_back(std::make_unique<Ours>(model, max_error, tolerance));
    }
  }
}

}  // namespace ist::benchmark
