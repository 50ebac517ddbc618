#include "contact/lens.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "support/contact_oracle.h"
#include "support/sanitizers.h"
#include "support/scene.h"

namespace ist {
namespace {

// The position of the lens's middle between the centres of two spheres, from 0 to 1.
double middle_of_lens(double R, double r, double d) {
  using One = Eigen::Array<double, 1, 1>;
  return lens_middle<One>(One::Constant(R - r), One::Constant(d)).value();
}

// The volume of the lens by integrating the common sections along the line of centres.
double integrated(double R, double r, double d) {
  const double low = std::max(-R, d - r), high = std::min(R, d + r);
  if (high <= low) return 0.0;
  constexpr int kSlices = 20000;
  const double step = (high - low) / kSlices;
  double volume = 0.0;
  for (int i = 0; i < kSlices; ++i) {
    const double x = low + (i + 0.5) * step;
    const double section = std::min(R * R - x * x, r * r - (x - d) * (x - d));
    if (section > 0.0) volume += M_PI * section * step;
  }
  return volume;
}

TEST(Lens, IsTheVolumeOfTheIntersection) {
  test::Rng rng(21);
  for (int i = 0; i < test::scaled(300); ++i) {
    const double R = test::uniform(&rng, 0.001, 0.2), r = test::uniform(&rng, 0.001, 0.2);
    const double d = test::uniform(&rng, 0.0, 1.1) * (R + r);
    const double truth = integrated(R, r, d);
    const double sphere = 4.0 * M_PI / 3.0 * std::pow(std::min(R, r), 3);
    EXPECT_NEAR(lens_volume(R, r, d), truth, 1e-5 * sphere);
    EXPECT_NEAR(lens_volume(R, r, d), test::oracle_lens(R, r, d), 1e-12 * sphere);
    EXPECT_DOUBLE_EQ(lens_volume(R, r, d), lens_volume(r, R, d));
    EXPECT_NEAR(lens_volume(static_cast<float>(R), static_cast<float>(r), static_cast<float>(d)),
                truth, 1e-4 * sphere);
  }
}

TEST(Lens, IsExactAtTouchContainmentAndCommonCentres) {
  for (const double R : {1e-6, 0.01, 0.1, 10.0}) {
    for (const double ratio : {1e-3, 0.5, 1.0 - 1e-12, 1.0}) {
      const double r = ratio * R, sphere = 4.0 * M_PI / 3.0 * r * r * r;
      for (const double tiny : {0.0, 1e-15, 1e-9}) {
        EXPECT_NEAR(lens_volume(R, r, tiny * R), sphere, 1e-8 * sphere);
        EXPECT_NEAR(lens_volume(R, r, (1.0 - tiny) * (R - r)), sphere, 1e-8 * sphere);
        EXPECT_NEAR(lens_volume(R, r, (1.0 - tiny) * (R + r)), 0.0, 1e-12 * R * R * R);
        EXPECT_EQ(lens_volume(R, r, (1.0 + tiny) * (R + r) * (1.0 + 1e-15)), 0.0);
        const double middle = middle_of_lens(R, r, tiny * R);
        EXPECT_TRUE(middle >= 0.0 && middle <= 1.0);
      }
    }
  }
  EXPECT_EQ(lens_volume(0.0, 0.0, 0.0), 0.0);
  EXPECT_EQ(lens_volume(0.1, 0.0, 0.05), 0.0);
}

TEST(Lens, LiesInTheMiddleOfItsThickness) {
  test::Rng rng(22);
  for (int i = 0; i < test::scaled(1000); ++i) {
    const double R = test::uniform(&rng, 0.01, 0.2), r = test::uniform(&rng, 0.01, 0.2);
    const double d = test::uniform(&rng, 0.0, 1.0) * (R + r);
    const Eigen::Vector3d a = test::random_vector(&rng, 1.0);
    const Eigen::Vector3d b = a + d * test::random_vector(&rng, 1.0).normalized();
    const double length = (b - a).norm();
    const Eigen::Vector3d found = a + middle_of_lens(R, r, length) * (b - a);
    EXPECT_LT((found - test::oracle_lens_middle(a, R, b, r)).norm(), 1e-12);
  }
}

TEST(Lens, GrowsSmoothlyFromTouchToContainment) {
  for (const double r : {0.05, 0.1, 0.1 + 1e-9}) {
    constexpr double R = 0.1, kStep = 1e-5;
    double slope_before = 0.0, before = 0.0;
    for (double d = R + r + kStep; d >= 0.0; d -= kStep) {
      const double now = lens_volume(R, r, d), slope = (now - before) / kStep;
      // No face between spheres is larger than the smaller sphere's equator, nor grows faster than
      // it.
      EXPECT_LE(slope, M_PI * r * r * (1.0 + 1e-6));
      EXPECT_LE(std::abs(slope - slope_before), 4.0 * M_PI * r * kStep) << d;
      before = now;
      slope_before = slope;
    }
  }
}

}  // namespace
}  // namespace ist
