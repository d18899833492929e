// The input of one frame. All data are borrowed and must stay valid for the duration of the call.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "smartsurf/scene/ChannelKind.h"
#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/scene/Snapshot.h"

namespace smartsurf::view {

// One channel over the surface, for heat maps and cell plots.
struct Channel {
  std::string name;               // for example "height"
  std::string unit;               // for example "u"; "" for a dimensionless channel
  std::span<const float> values;  // rows × columns, row-major, row 0 north; empty: not available
  // The channel's range. If it is unknown (low ≥ high), the range of the values is used.
  float low = 0.0F, high = 0.0F;
  // The ray along which the channel measures distances, as in scene::SensorChannel; unknown: upwards from the
  // centre of the top.
  std::optional<std::array<double, 3>> origin = {}, direction = {};
  scene::ChannelKind kind = scene::ChannelKind::kSensor;
};

// A contact point and its force.
struct ContactMark {
  Eigen::Vector3f point;  // u
  Eigen::Vector3f force;  // mass·u/s², on the object, averaged over the physics step
};

class History;  // model/Signal.h

struct FrameInput {
  const scene::Snapshot& snapshot;
  const std::vector<scene::ObjectSpec>& catalogue;  // every object ever created, index = object id
  std::span<const Channel> channels = {};           // the same set in every frame of a run
  std::span<const ContactMark> contacts = {};
  const History* history = nullptr;  // the stored frames, for plots and trails; null: none
};

}  // namespace smartsurf::view
