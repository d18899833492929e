// Finds objects that an experiment has probably placed by mistake.
#pragma once

#include <string>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::scene {

// One line for each kind of mistake, with the first such object and the number of the others: larger than the
// table; smaller than its gaps; beside the table; below the cells; inside them, or their border; inside
// another object at the start. Fixed objects, those with joints and those in motion may be anywhere, and
// objects may touch. Only what certainly overlaps is reported: spheres, boxes and capsules are exact, the
// other shapes count by what they contain, and only a million of pairs are tested. O(n log n) for objects
// that are spread over the table.
std::vector<std::string> unlikely_placements(const SceneSpec&);

}  // namespace smartsurf::scene
