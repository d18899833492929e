// The proximity sensors of a surface: for each cell the distance from its top's centre, straight up, to the first
// object. Exact for every shape; cost follows the cells under objects, not the cells that exist.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "smartsurf/scene/Snapshot.h"

namespace smartsurf::surface {

class WorkerPool;

class Proximity {
 public:
  Proximity(const scene::SurfaceSpec&, double range);

  // catalogue[id] is the shape of the object `id` of the snapshot. Allocates only when the number of objects grows.
  void sense(const scene::Snapshot&, std::span<const scene::ObjectSpec> catalogue, WorkerPool&);

  // rows × columns, row-major, row 0 north. Nothing within the range reads as the range itself, with hit 0.
  std::span<const float> distance() const noexcept { return distance_; }  // u, in [0, range]
  std::span<const float> hit() const noexcept { return hit_; }            // 0 or 1
  float range() const noexcept { return range_; }

 private:
  // An object with the rectangle of cells that it may cover.
  struct Footprint {
    scene::ShapeKind shape;
    Eigen::Vector3f centre;
    Eigen::Matrix3f to_local;  // world → object axes
    Eigen::Vector3f extent;    // box: half edges; sphere: radius; cylinder: radius, radius, half height
    int row_begin, row_end, column_begin, column_end;
  };
  void sense_rows(const scene::Snapshot&, int begin, int end);

  scene::SurfaceSpec spec_;
  float range_;
  std::vector<float> distance_, hit_;
  std::vector<std::uint8_t> dirty_;  // one a row: holds a hit from the last sweep
  std::vector<Footprint> footprints_;
};

}  // namespace smartsurf::surface
