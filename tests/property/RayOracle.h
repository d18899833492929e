// Random scenes and a brute-force ray cast for testing RayCaster.
//
// The oracle tests every object and minimises a convex distance function along the segment, so it shares
// nothing with the closed forms of RayCaster. Lengths in u.
#pragma once

#include <memory>
#include <random>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/surface/Field.h"
#include "smartsurf/surface/raycast/RayCaster.h"

namespace oracle {

struct Scene {
  smartsurf::surface::Field field;
  std::vector<smartsurf::scene::ObjectSpec> objects;
  smartsurf::scene::Snapshot snapshot;
};

// Contains each object shape twice. `free` selects a free layout of rotated cells.
Scene random_scene(std::mt19937& random, int rows, int columns, bool free, float pitch = 1.0F);
void scale_object(smartsurf::scene::ObjectSpec&, double factor);
void move_to(Scene&, std::size_t object, const Eigen::Vector3f& place);

// An object of random size and pose over a surface of width × depth.
smartsurf::scene::ObjectSpec random_object(std::mt19937& random, smartsurf::scene::ShapeKind, double width,
                                           double depth);
// An upright prism of `faces` faces, including its two ends.
std::shared_ptr<const smartsurf::scene::Solid> make_drum(int faces);
// Lower bound on the distance of `p`, in object axes, from one convex part; `part` is 0 except for solids. At
// most 0 inside, convex, 1-Lipschitz.
double signed_distance(const smartsurf::scene::ObjectSpec&, std::size_t part, const Eigen::Vector3d& p);

struct ExpectedHit {
  double distance;      // along the segment; the range if nothing is hit
  float tag = 0;        // 1 + the object's index in the snapshot, 1000 for a pin, 0 for no hit
  bool certain = true;  // false if an edge or a second hit is too close to decide
};
// First hit of the cell's segment.
ExpectedHit cast_ray(const Scene&, const smartsurf::surface::CellRay&, int cell);

}  // namespace oracle
