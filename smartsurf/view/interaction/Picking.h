// Ray picking of objects and cells. Pure arithmetic; never allocates or fails.
#pragma once

#include <optional>

#include "smartsurf/view/model/Camera.h"
#include "smartsurf/view/model/FrameInput.h"

namespace smartsurf::view {

// One thing of the scene: an object or a cell.
struct SceneItem {
  enum class Kind { kObject, kCell };
  Kind kind = Kind::kCell;
  scene::ObjectId object = 0;
  int row = 0, column = 0;  // of a cell, from 0, row 0 north
  bool operator==(const SceneItem&) const = default;
};

struct PickHit {
  SceneItem item;
  double distance = 0.0;  // along the ray, u
  Eigen::Vector3d point{0.0, 0.0, 0.0};
};

// The first thing that the ray meets. Gaps between pins count as their cells.
std::optional<PickHit> pick(const Ray& ray, const scene::SurfaceSpec& surface, const FrameInput& input);

// Distance at which the ray enters the shape, in the object's own frame; none where it passes.
std::optional<double> intersect(const scene::ObjectSpec& object, const Ray& ray);

// Index of the object in the snapshot, if it is alive.
std::optional<std::size_t> find_object_index(const scene::Snapshot& snapshot, scene::ObjectId id);

}  // namespace smartsurf::view
