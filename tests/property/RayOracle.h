// Scenes of random objects over random cells, and what a segment meets first in them: every object tried, by
// a search for the least of a convex function along the segment, which has nothing in common with the closed
// forms.
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

// Every object shape twice; `free`: cells turned, in a layout that is not rectangular.
Scene random_scene(std::mt19937& random, int rows, int columns, bool free, float pitch = 1.0F);
void scale_object(smartsurf::scene::ObjectSpec&, double factor);
void move_to(Scene&, std::size_t object, const Eigen::Vector3f& place);

// An object of that shape at a random place and turn.
smartsurf::scene::ObjectSpec random_object(std::mt19937& random, smartsurf::scene::ShapeKind, double width,
                                           double depth);
// An upright drum of that many faces, two of them its ends.
std::shared_ptr<const smartsurf::scene::Solid> make_drum(int faces);
// Of one piece of it, in its own axes: at most 0 inside, convex, and not steeper than a distance.
double signed_distance(const smartsurf::scene::ObjectSpec&, std::size_t part, const Eigen::Vector3d& p);

struct ExpectedHit {
  double distance;      // along the segment; its range where nothing is met
  float tag = 0;        // 1 + the object's place in the snapshot, 1000 for a pin, 0 for nothing
  bool certain = true;  // false where an edge is too near to say
};
// What the segment of a cell meets first.
ExpectedHit cast_ray(const Scene&, const smartsurf::surface::CellRay&, int cell);

}  // namespace oracle
