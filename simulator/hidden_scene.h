#pragma once

#include "scene.h"

namespace ist::sim {

/// How obstacles are hidden from the cameras.
struct HiddenRules {
  double period = 2.0;  ///< [s] in the second half of each, a board is before every camera
  double dwell = 3.5;   ///< [s] an obstacle stays where it meets the undisturbed arm
};

/// The same scene, in which obstacles stop on the arm's way for a while and are hidden half of the
/// time: a board goes before each camera, far from the arm, and away again.
/// @param rules  that the scene was made with
Scene hidden_half_of_the_time(Scene scene, const SceneRules& rules, const HiddenRules& hidden);

}  // namespace ist::sim
