// Ray picking of objects and cells. No function allocates or fails.
#pragma once

#include <optional>

#include "smartsurf/view/model/Camera.h"
#include "smartsurf/view/model/FrameInput.h"
#include "smartsurf/view/model/SceneItem.h"

namespace smartsurf::view {

struct PickHit {
  SceneItem item;
  double distance = 0.0;  // along the ray, u
  Eigen::Vector3d point{0.0, 0.0, 0.0};
};

// The first object or cell along the ray. On a regular grid, gaps between pins belong to the cells, as does a
// skin over them.
std::optional<PickHit> pick(const Ray& ray, const scene::SurfaceSpec& surface, const FrameInput& input);

// Distance, u, at which the ray enters the object's shape; the ray is in the object's frame. Empty if it
// misses.
std::optional<double> intersect(const scene::ObjectSpec& object, const Ray& ray);

}  // namespace smartsurf::view
