// The input of one frame: borrowed values, valid for the duration of a call.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/scene/Snapshot.h"

namespace smartsurf::view {

// Values of one channel over the surface, for heat maps and the panels of cells.
struct Channel {
  std::string name;               // "height", "proximity"
  std::string unit;               // "u"; "" where there is none
  std::span<const float> values;  // rows × columns, row-major, row 0 north
  // The range that the channel can take, where it is known (low < high); else that of the values serves.
  float low = 0.0F, high = 0.0F;
};

// A point where two things touch, and the force there.
struct ContactMark {
  Eigen::Vector3f point;  // u
  Eigen::Vector3f force;  // mass·u/s², on the object, averaged over the physics step
};

struct FrameInput {
  const scene::Snapshot& snapshot;
  const std::vector<scene::ObjectSpec>& catalogue;  // every object ever made, index = id
  std::span<const Channel> channels = {};           // the same in every moment of a run
  std::span<const ContactMark> contacts = {};
};

}  // namespace smartsurf::view
